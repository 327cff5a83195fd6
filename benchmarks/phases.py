"""Where the time goes: each phase by itself, and shares of whole searches."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from importlib import import_module
from typing import Any

import numpy as np

from benchmarks import literal
from benchmarks.cases import Case, Context, case, chosen_problem
from benchmarks.measure import Report, Row, Spread, Times, row, together

#: phase -> where its time is spent, "module:name" or "module:Class.name"; a function that is imported is
#: named where it is called. Time inside a phase that belongs to another phase counts for that other one only.
CHECKS = {
    "path in the plane": "repair.check.checker:Checker._spliced",
    "driven states": "repair.vehicle.model:KinematicSingleTrack.angles",
    "limits": "repair.check.checker:broken_limits",
    "margin check": "repair.check.checker:boxes_entered",
    "collision check": "repair.check.checker:Checker._met",
    "road check": "repair.check.edge:RoadEdge.left_at",
    "kinematic check, direct": "repair.vehicle.model:KinematicSingleTrack.first_undrivable",
    "kinematic check, drivability checker": "repair.vehicle.model:official_check",
    "rest of the check": "repair.check.checker:Checker.check",
    "problem, culling": "repair.problem.factory:ProblemFactory.at",
    "ways past (passings)": "repair.problem.factory:open_passings",
}
SOLVING = {
    "ego": {
        "fit to the reference": "repair.solvers.ego.backend:fit_to_curve",
        "{p, v} pairs": "repair.solvers.ego.stages:anchor_pairs",
        "cost and gradient": "repair.solvers.ego.spline_cost:SplineCost.__call__",
        "deformation": "repair.solvers.ego.stages:Stages.deform",
        "refinement": "repair.solvers.ego.stages:Stages.refine",
        "rest of the solve": "repair.solvers.ego.backend:EgoBackend.solve",
    },
    "qptr": {
        "corridor": "repair.baselines.qptr.backend:build_corridor",
        "QP assembly": "repair.baselines.qptr.backend:_axis",
        "QP": "repair.baselines.qptr.backend:solve_projection",
        "rest of the solve": "repair.baselines.qptr.backend:QptrBackend.solve",
    },
    "casadi": {
        "NLP look-up": "repair.solvers.casadi.backend:build_model",
        "NLP layout": "repair.solvers.casadi.backend:lay_out",
        "separation": "repair.solvers.casadi.sides:separate",
        "separation, later rounds": "repair.solvers.casadi.backend:separate",
        "rounds of windows": "repair.solvers.casadi.backend:open_sides",
        "residuals": "repair.solvers.casadi.backend:residuals_of",
        "QP (presolve)": "repair.solvers.casadi.model:Model.presolve",
        "NLP solve": "repair.solvers.casadi.model:Model.solve",
        "rest of the solve": "repair.solvers.casadi.backend:CasadiBackend.solve",
    },
}
LITERAL = {
    "fit to the reference": "benchmarks.literal:fit_reference",
    "{p, v} pairs": "benchmarks.literal:make_pairs",
    "collision check": "benchmarks.literal:first_collision",
    "sampling": "benchmarks.literal:LiteralCurve.sample",
    "optimisation": "scipy.optimize:minimize",
    "kinematic check, direct": "benchmarks.literal:drivable",
}
#: phase of the package -> phase of the literal transcription that does the same
COUNTERPART = {name: name for name in LITERAL if name != "optimisation"}


def resolve(target: str) -> tuple[Any, str] | None:
    """Owner and attribute that a target names, None where it is not there (any more)."""
    module, _, path = target.partition(":")
    try:
        owner: Any = import_module(module)
    except ImportError:
        return None
    *parents, last = path.split(".")
    for name in parents:
        owner = getattr(owner, name, None)
    return (owner, last) if owner is not None and hasattr(owner, last) else None


class Stopwatch:
    """Own time of every phase while it is running."""

    def __init__(self, targets: dict[str, str]) -> None:
        self.targets = targets
        self.spent: dict[str, float] = {}
        self._inner: list[float] = []

    def timed(self, name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        """The same call, whose own time counts for a phase; that of other timed calls inside it does not."""

        @wraps(call)
        def measured(*args: Any, **keys: Any) -> Any:
            self._inner.append(0.0)
            begin = time.process_time()
            try:
                return call(*args, **keys)
            finally:
                lasted = time.process_time() - begin
                self.spent[name] = self.spent.get(name, 0.0) + lasted - self._inner.pop()
                if self._inner:
                    self._inner[-1] += lasted

        return measured

    @contextmanager
    def running(self) -> Iterator[None]:
        """Put the stopwatch into every phase that can be found."""
        before: list[tuple[Any, str, Any]] = []
        try:
            for name, target in self.targets.items():
                found = resolve(target)
                if found is not None:
                    original = found[0].__dict__.get(found[1], getattr(*found))
                    before.append((*found, original))
                    setattr(*found, self.timed(name, getattr(*found)))
            yield
        finally:
            for owner, name, original in reversed(before):
                setattr(owner, name, original)


def _shares(
    call: Callable[[], Any], targets: dict[str, str], rounds: int
) -> tuple[dict[str, list[float]], list[float]]:
    """Own time of every phase per call, round by round [s], and the whole."""
    watch, parts, whole = Stopwatch(targets), {name: [] for name in targets}, []
    call()
    with watch.running():
        call()
        for _ in range(rounds):
            watch.spent.clear()
            begin = time.process_time()
            call()
            whole.append(time.process_time() - begin)
            for name in targets:
                parts[name].append(watch.spent.get(name, 0.0))
    return parts, whole


def shares(context: Context, number: int, backend: str) -> Report:
    """Phases of one backend's whole search."""
    made = case(context.path(number), number, backend)
    kind = backend.split(maxsplit=1)[0]
    targets = {**SOLVING[kind], **CHECKS}
    parts, whole = _shares(made.search, targets, context.rounds(41, 9))
    label, run, _ = case(context.path(number), number, "ego").baseline()
    slow_parts, slow_whole = _shares(run, LITERAL, context.rounds(5, 2))
    base = Spread.of(slow_whole).median
    group = f"phases of a search: {context.title(number)}, {backend}, Delta T 0.4 s"
    report = Report()
    total = Spread.of(whole).scaled(1e3)
    parts["everything else"] = list(np.asarray(whole) - sum(np.asarray(x) for x in parts.values()))
    for name, spent in parts.items():
        if not any(spent):
            if name in targets and resolve(targets[name]) is None:
                report.remarks.append(f"{group}: {name} is not measured, {targets[name]} does not exist")
            continue
        cpu = Spread.of(spent).scaled(1e3)
        own = COUNTERPART.get(name) if kind == "ego" else None
        slow = Spread.of(slow_parts[own]).median if own else 0.0
        compared = Spread.of((slow or base) / np.maximum(spent, 1e-9))
        against = "literal, same phase" if slow else label
        report.rows.append(
            Row(group, name, "ms", cpu, None, compared, against, f"{100 * cpu.median / total.median:.0f} %")
        )
    report.rows.append(
        Row(group, "whole, with the stopwatch", "ms", total, None, Spread.of(base / np.asarray(whole)), label)
    )
    if kind == "ego":
        stages = ("deformation", "refinement", "cost and gradient")
        solving = sum(np.asarray(parts[name]) for name in stages if name in parts)
        slow = Spread.of(slow_parts["optimisation"]).median
        report.rows.append(Row(
            group, "deformation + refinement", "ms", Spread.of(solving).scaled(1e3), None,
            Spread.of(slow / np.maximum(solving, 1e-9)), "literal, same phase",
        ))  # fmt: skip
    return report


def preparation(context: Context, number: int) -> Report:
    """What is done once for a scene, each step by itself."""
    from repair.check.checker import Checker
    from repair.check.conflict import detect_conflict
    from repair.reference.registry import make_reference
    from repair.scene.commonroad import load_scene
    from repair.scene.frame import FrenetFrame
    from repair.scene.reading import read_file
    from repair.world.occupancy import build_occupancy

    path = context.path(number)
    made = case(path, number, "ego")
    p, config = made.prepared, made.config
    scene = p.scene
    offsets = config.scene.s_offset, config.scene.l_offset
    calls: dict[str, Callable[[], Any]] = {
        "scene load (file to Scene)": lambda: load_scene(path),
        "of which reading the file": lambda: read_file(path),
        "frame along a path": lambda: FrenetFrame.from_points(scene.frame.points),
        "occupancy": lambda: build_occupancy(scene.obstacles, scene.frame, scene.dt, *offsets),
        "checker (collision world, road)": lambda: Checker(scene, p.limits, config.checker),
        "reference": lambda: make_reference(scene, config.reference, p.occupancy),
        "conflict (TTC)": lambda: detect_conflict(p.reference, p.boxes, p.checker, p.t_reference),
    }
    group = f"once for a scene: {context.title(number)}"
    rounds = context.rounds(9, 3)
    label, run, _ = made.baseline()
    slow = together({"": run}, context.rounds(5, 2), warm_up=1)[""]
    base = Times((Spread.of(slow.cpu).median,) * rounds, (Spread.of(slow.wall).median,) * rounds)
    times = together(calls, rounds, warm_up=1)
    return Report([row(group, name, times[name], base, label) for name in calls])


def parts(context: Context, number: int) -> Report:
    """Single calls on the repair at t_rep = 0, next to their literal counterparts."""
    from repair.vehicle.commonroad_ks import official_check
    from repair.vehicle.transitions import direct_check

    made = case(context.path(number), number, "ego")
    problem, checker = chosen_problem(made), made.prepared.checker
    curve: Any = made.backend.solve(problem).curve
    slow_curve = literal.LiteralCurve(curve.t_start, curve.spacing, curve.degree, curve.points.tolist())
    times = checker.times(problem.t_end)
    states = checker.drive(curve, problem.t_end)
    coarse, vehicle, dt = (
        states.every(checker.config.substeps),
        made.prepared.scene.vehicle,
        problem.dt,
    )
    transitions = len(coarse) - 1
    calls: dict[str, Callable[[], Any]] = {
        "literal sampling": lambda: slow_curve.sample(times),
        f"sampling at {len(times)} times": lambda: curve.sample(times),
        "literal collision": lambda: literal.first_collision(problem, slow_curve),
        "collision check of true rectangles": lambda: checker.world.contact(
            states.x, states.y, states.orientation
        ),
        f"kinematic check, direct, {transitions} transitions": lambda: direct_check(coarse, dt, vehicle),
        "whole check": lambda: checker.check(problem, curve),
    }
    if checker.road is not None:
        calls["road check"] = lambda: checker.road.first_off_road(states.x, states.y, states.orientation)
    against = {
        f"sampling at {len(times)} times": "literal sampling",
        "collision check of true rectangles": "literal collision",
    }
    measured = together(calls, context.rounds(21, 5))
    official = together({"": lambda: official_check(coarse, dt, vehicle)}, context.rounds(3, 1), warm_up=0)[
        ""
    ]
    slow = Spread.of(official.cpu).median
    group = f"single calls at t_rep 0: {context.title(number)}"
    report = Report()
    for name, found in measured.items():
        if name in ("literal sampling", "literal collision"):
            continue
        other = measured.get(against.get(name, ""))
        label = against.get(name, "")
        if name.startswith("kinematic"):
            other = Times((slow,) * len(found.cpu), (slow,) * len(found.wall))
            label = "drivability checker"
        report.rows.append(row(group, name, found, other, label, unit="us"))
    return report


def nlp_build(context: Context, number: int) -> Report:
    """Making the NLP: the first time for a structure, and every time after."""
    report, group = Report(), f"NLP build: {context.title(number)}"
    for backend in ("casadi sqpmethod", "casadi ipopt"):
        from repair.solvers.casadi.model import build_model as build

        made: Case = case(context.path(number), number, backend)
        problem = made.prepared.source.at(0.0)[0]
        structure = made.backend.structure(problem)
        fresh = getattr(build, "__wrapped__", build)

        def first(fresh: Any = fresh, structure: Any = structure) -> None:
            made = fresh(structure)
            assert made.nlp is not None  # the NLP is made when it is first asked for

        calls = {"first": first, "again": lambda b=build, s=structure: b(s)}
        times = together(calls, context.rounds(9, 3), warm_up=1)
        report.rows.append(row(group, f"{backend}, first time", times["first"]))
        report.rows.append(
            row(group, f"{backend}, from the cache", times["again"], times["first"], "first time")
        )
    return report
