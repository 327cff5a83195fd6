"""How the cost grows: control points, obstacles, horizon. Exponents are slopes of log time over log size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks import literal
from benchmarks.cases import Case, Context, case, chosen_problem, scene_of
from benchmarks.measure import Report, Spread, Target, exponent, row, together
from repair.preparation import prepare
from repair.scene.traffic.obstacle import Obstacle
from repair.solvers.registry import make_backend

POINTS = (20, 40, 80, 160, 320)
COUNTS = (1, 5, 20, 50, 100, 200, 500)
HORIZONS = (3.0, 4.0, 5.0, 6.0, 8.0)
#: Beyond this the literal transcription would take minutes.
LITERAL_POINTS = 40


def control_points(context: Context) -> Report:
    """One ego repair, checks included, from 20 to 320 control points over the same 4 s."""
    group, report = f"control points: {context.title(1)}, one ego repair with checks", Report()
    base = case(context.path(1), 1, "ego")
    duration = base.prepared.t_end
    calls: dict[str, Callable[[], Any]] = {}
    slow: dict[int, Callable[[], Any]] = {}
    for n in POINTS:
        config = replace(base.config, repair=replace(base.config.repair, spacing=duration / (n - 3) + 1e-7))
        prepared = replace(base.prepared, settings=config.repair, config=config)
        made = Case(prepared, make_backend("ego", config), config)
        problem = chosen_problem(made)

        def repair(made: Case = made, problem: Any = problem) -> Any:
            return made.prepared.checker.check(problem, made.backend.solve(problem).curve)

        calls[str(n)] = repair
        if n <= LITERAL_POINTS:
            slow[n] = lambda p=problem, c=config: literal.probe(p, base.prepared.checker, c, "direct")
    rounds = context.rounds(15, 5)
    times = together(calls, rounds)
    literal_times = together({str(n): call for n, call in slow.items()}, rounds_literal(context), warm_up=1)
    medians = []
    for n in POINTS:
        medians.append(Spread.of(times[str(n)].cpu).median)
        if n in slow:
            typical = Spread.of(literal_times[str(n)].cpu).median
            against = replace(times[str(n)], cpu=(typical,) * rounds)
            report.rows.append(row(group, f"{n} points", times[str(n)], against, "literal repair"))
        else:
            report.rows.append(row(group, f"{n} points", times[str(n)], note="literal: minutes, not run"))
    growth, grid = medians[-1] / medians[0], POINTS[-1] / POINTS[0]
    whole, late = exponent(POINTS, medians), exponent(POINTS[-3:], medians[-3:])
    report.remarks.append(f"{group}: time ~ points^{whole:.2f} (from {POINTS[-3]} on: ^{late:.2f})")
    report.targets.append(Target(
        "growth from 20 to 320 control points", f"<= {grid:g} x (linear)", f"{growth:.1f} x", growth <= grid
    ))  # fmt: skip
    return report


def rounds_literal(context: Context) -> int:
    return context.rounds(3, 1)


def _standing(template: Obstacle, number: int, centre: np.ndarray, heading: float) -> Obstacle:
    """A parked car at a pose, made of another obstacle's arrays."""
    half = np.array([2.25, 0.9])
    count = template.n_steps + 1
    corners = np.array([[1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]]) * half
    cos, sin = np.cos(heading), np.sin(heading)
    outline = centre + corners @ np.array([[cos, sin], [-sin, cos]])

    def always(row: Any) -> Any:
        array = np.broadcast_to(np.asarray(row, dtype=np.float64), (count, *np.shape(row))).copy()
        array.setflags(write=False)
        return array

    return replace(
        template,
        id=900_000 + number,
        kind="parkedVehicle",
        role="static",
        vertices=always(outline),
        rectangles=always([*centre, heading, *half]),
        circles=None,
        polygons=(),
        states=always([*centre, heading, 0.0]),
    )


def _parked(scene: Any, count: int, near: bool) -> tuple[Obstacle, ...]:
    """Cars beside the path: ``near`` along the first 40 m, out of the lane; else 45 to 55 m to the side."""
    frame, s0 = scene.frame, float(scene.start[0, 0])
    rng = np.random.default_rng(7)
    s = s0 + rng.uniform(0.0, 40.0, count)
    side = np.where(rng.random(count) < 0.5, -1.0, 1.0)
    lateral = side * (rng.uniform(6.0, 12.0, count) if near else rng.uniform(45.0, 55.0, count))
    heading = np.interp(s, frame.s, frame.heading_table)
    x, y = (np.interp(s, frame.s, frame.points[:, k]) for k in (0, 1))
    centres = np.column_stack([x - lateral * np.sin(heading), y + lateral * np.cos(heading)])
    return tuple(_standing(scene.obstacles[0], i, centres[i], float(heading[i])) for i in range(count))


def obstacles(context: Context, near: bool) -> Report:
    """Preparing and searching with 1 to 500 more obstacles, in or out of the ego's reach."""
    kind = "beside the lane" if near else "out of reach"
    group, report = f"obstacles {kind}: {context.title(1)}, ego", Report()
    scene = scene_of(context.path(1))
    counts = COUNTS if not context.quick else COUNTS[::3]
    searches: dict[str, Callable[[], Any]] = {}
    preparing: dict[str, Callable[[], Any]] = {}
    for n in counts:
        full = replace(scene, obstacles=(*scene.obstacles, *_parked(scene, n, near)))
        made = case(context.path(1), 1, "ego", scene=full)
        searches[f"{n}"] = made.search
        preparing[f"{n}"] = lambda full=full, config=made.config: prepare(full, config)
    slow = case(context.path(1), 1, "ego")
    times = together({"literal": slow.literal, **searches}, context.rounds(9, 3))
    prepared = together(preparing, context.rounds(5, 2), warm_up=1)
    for n in counts:
        report.rows.append(row(group, f"search, {n} more", times[f"{n}"], times["literal"], "literal search"))
    for n in counts:
        report.rows.append(row(group, f"preparation, {n} more", prepared[f"{n}"]))
    for label, found in (("search", times), ("preparation", prepared)):
        medians = [Spread.of(found[f"{n}"].cpu).median for n in counts]
        total = [n + len(scene.obstacles) for n in counts]
        power, growth = exponent(total, medians), medians[-1] / medians[0]
        report.remarks.append(
            f"{group}: {label} ~ obstacles^{power:.2f}; {counts[0]} to {counts[-1]}: {growth:.2f} x"
        )
        if not near:
            name = f"{label} with obstacles out of reach"
            report.targets.append(Target(name, "exponent < 1 (sublinear)", f"{power:.2f}", power < 1.0))
    return report


def horizon(context: Context, backend: str) -> Report:
    """The whole search for longer and longer repairs."""
    group, report = f"horizon: {context.title(1)}, {backend}, Delta T 0.4 s", Report()
    made = {h: case(context.path(1), 1, backend, f"repair.horizon={h:g}") for h in HORIZONS}
    made = {h: c for h, c in made.items() if abs(c.prepared.t_end - h) < 1e-9}
    calls = {f"{h:g}": c.search for h, c in made.items()}
    times = together(calls, context.rounds(9, 3), warm_up=1)
    slow = together({"": made[4.0].literal}, context.rounds(3, 1), warm_up=0)[""] if 4.0 in made else None
    plans = []
    for h, c in made.items():
        found = c.search()
        plans.append(Spread.of(times[f"{h:g}"].cpu).median / max(len(found.probes), 1))
        against = None
        if slow is not None and h == 4.0:
            against = replace(times[f"{h:g}"], cpu=(Spread.of(slow.cpu).median,) * len(times[f"{h:g}"].cpu))
        report.rows.append(row(
            group, f"{h:g} s", times[f"{h:g}"], against, "literal search", f"{len(found.probes)} plans"
        ))  # fmt: skip
    report.remarks.append(f"{group}: time per plan ~ horizon^{exponent(list(made), plans):.2f}")
    return report
