"""Whole searches, and one repair: every backend against the literal transcription."""

from __future__ import annotations

from typing import Any

from benchmarks import literal
from benchmarks.cases import BACKENDS, GUIDED, Context, case, chosen_problem, verdict
from benchmarks.measure import Report, Spread, Target, ratio, rounds_within, row, together
from repair.errors import RepairError

# Times faster than the literal transcription, on Scenario 1 at Delta T = 0.4 s.
WANTED = {"ego": 60.0, "qptr": 100.0, "casadi sqpmethod": 12.0, "casadi ipopt": 4.0}


def whole_search(context: Context, number: int, delta_t: float) -> Report:
    """Every backend's search on one scenario, in turns with the literal one."""
    report, group = Report(), f"search: {context.title(number)}, Delta T {delta_t:g} s"
    path, override = context.path(number), f"search.delta_t={delta_t:g}"
    made: dict[str, Any] = {}
    for name in BACKENDS | GUIDED:
        try:
            made[name] = case(path, number, name, override)
            made[name].search()
        except RepairError as error:  # a backend that is not installed
            report.remarks.append(f"{group}: {name} left out: {error}")
            made.pop(name, None)
    base = made["ego"]
    label, run, note = base.baseline()
    times = together(
        {label: run, **{name: c.search for name, c in made.items()}},
        rounds_within(run, context.rounds(8, 2), 3, context.rounds(21, 5)),
        shortest=0.03,
    )
    report.rows.append(row(group, label + ", direct check", times[label], note=note))
    for name, c in made.items():
        report.rows.append(row(group, name, times[name], times[label], label, verdict(c.search())))
        wanted = WANTED.get(name.removesuffix(", guided"))
        if number == 1 and delta_t == 0.4 and wanted is not None:
            got = ratio(times[label], times[name]).median
            rule = "" if name in GUIDED else ", bisect"
            report.targets.append(_faster(f"search on Scenario 1, {name}{rule}", wanted, got))
    if number == 1 and delta_t == 0.4 and not context.quick:
        official = together({"": lambda: base.literal("official")}, 2, warm_up=0)[""]
        report.rows.append(
            row(group, "literal search, drivability checker", official, note="the paper's kinematic check")
        )
        slow = Spread.of(official.cpu).median / Spread.of(times["ego"].cpu).median
        report.remarks.append(
            f"{group}: with the drivability checker on every transition, as in the paper, the literal search "
            f"takes {slow:.0f} times as long as ego"
        )
    return report


def _faster(name: str, wanted: float, got: float) -> Target:
    return Target(name, f">= {wanted:g} x faster than literal", f"{got:.1f} x", got >= wanted)


def one_repair(context: Context, number: int, n_points: int) -> Report:
    """One ego repair at ``n_points`` control points: with and without finding the way past."""
    group = f"one ego repair: {context.title(number)}"
    first = case(context.path(number), number, "ego")
    duration = first.prepared.t_end
    made = case(context.path(number), number, "ego", f"repair.spacing={duration / (n_points - 3) + 1e-6:.7f}")
    problem, source, checker = chosen_problem(made), made.prepared.source, made.prepared.checker

    def repair() -> Any:
        curve = made.backend.solve(problem).curve
        return checker.check(problem, curve)

    def everything() -> Any:
        for each in source.at(0.0):
            if each.passing is None or each.passing.maneuver is problem.passing.maneuver:
                curve = made.backend.solve(each).curve
                return checker.check(each, curve)

    calls = {
        "literal": lambda: literal.probe(problem, checker, made.config, "direct"),
        "repair": repair,
        "everything": everything,
        "solve": lambda: made.backend.solve(problem),
    }
    rounds = rounds_within(calls["literal"], context.rounds(5, 2), 5, context.rounds(25, 7))
    times = together(calls, rounds, shortest=0.01)
    points = len(made.backend.solve(problem).curve.points)
    against = "literal repair"
    report = Report()
    for name, label in (
        ("solve", "pairs, deformation, refinement"),
        ("repair", "the same and all checks"),
        ("everything", "the same and the ways past the obstacles"),
    ):
        report.rows.append(row(group, f"{points} points: {label}", times[name], times["literal"], against))
    got = report.rows[1].cpu.median
    name = f"one ego repair with checks, {points} control points, Scenario {number}"
    report.targets.append(Target(name, "< 1 ms of CPU", f"{got:.2f} ms", got < 1.0))
    return report
