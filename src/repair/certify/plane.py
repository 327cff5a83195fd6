"""What happens in the plane, and what CommonRoad's own checker says of the solution file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.certify.certificate import SAMPLE, STATE_TOLERANCE, CertificateRow, at_least, at_most
from repair.curves.base import Curve
from repair.curves.codec import read_curve
from repair.errors import RepairError
from repair.timegrid import INSTANT, steps_until

if TYPE_CHECKING:
    from repair.preparation import Prepared

__all__ = ["official_rows", "plane_rows"]


def plane_rows(prepared: Prepared, curve: Curve, t_rep: float, t_end: float) -> list[CertificateRow]:
    """What happens in the plane, on the vehicle's true outline, every millisecond from ``t_rep`` on.

    The vehicle is driven from the start, because its slip angle has a history.
    """
    from repair.check.peaks import peaks
    from repair.curves.base import SplicedCurve
    from repair.world.collision import CollisionWorld

    scene, limits = prepared.scene, prepared.limits
    substeps = max(1, round(scene.dt / SAMPLE))
    times = np.arange(steps_until(t_end, scene.dt) * substeps + 1) * (scene.dt / substeps)
    path = scene.frame.cartesian(SplicedCurve(prepared.reference, curve, t_rep).sample(times))
    since = int(times.searchsorted(t_rep - INSTANT))
    reached = peaks(path, slice(since, None))
    states = scene.model.drive(path)
    world = CollisionWorld(scene.obstacles, scene.vehicle, scene.dt, scene.n_steps, substeps)
    poses = states.x[since:], states.y[since:], states.orientation[since:]
    contact = world.contact(*poses, start=since)
    rows = [
        at_most("friction circle", reached.max_total_acceleration, limits.a_total, "sampled", "m/s²"),
        at_most("lateral acceleration", reached.max_lateral_acceleration, limits.a_lat, "sampled", "m/s²"),
        at_least(
            "first contact of the rectangles", contact.time if contact else t_end, t_end, "sampled", "s"
        ),
    ]
    if prepared.checker.road is not None:
        index = prepared.checker.road.first_off_road(*poses)
        left_at = t_end if index is None else float(states.t[since + index])
        rows.append(at_least("leaves the road", left_at, t_end, "sampled", "s"))
    return rows


def official_rows(folder: Path, content: Mapping[str, Any], prepared: Prepared) -> list[CertificateRow]:
    """The solution file against the written trajectory, and before the drivability checker."""
    from commonroad.planning.planning_problem import PlanningProblemSet

    from repair.io.official import check_solution_file

    file = folder / str(content["solution_file"])
    if not file.is_file():
        raise RepairError(f"the solution file {file} is not there any more")
    scene = prepared.scene
    verdict = check_solution_file(file, scene.official(), PlanningProblemSet([scene.planning_problem]))
    rows = [
        at_most(
            "solution file against the curve",
            _difference(file, content, prepared),
            STATE_TOLERANCE,
            "sampled",
            "m",
        )
    ]
    answers = (
        ("solution_feasible", verdict.feasible),
        ("obstacle_collision", verdict.collision_free),
        (f"boundary_collision ({verdict.road_method})", verdict.on_road),
    )
    rows += [
        CertificateRow(name, float(ok), 1.0, float(ok) - 1.0, ok, "official", "") for name, ok in answers
    ]
    return rows


def _difference(file: Path, content: Mapping[str, Any], prepared: Prepared) -> float:
    """Largest distance [m] between the positions in the solution file and those on the curves."""
    from repair.curves.base import SplicedCurve
    from repair.scene.reading import read_solution

    solution = read_solution(file)
    states = solution.planning_problem_solutions[0].trajectory.state_list
    written = np.array([s.position for s in states])
    first = prepared.scene.initial_time_step
    times = (np.array([s.time_step for s in states]) - first) * prepared.scene.dt
    repaired = read_curve(content.get("curve"))
    reference = content.get("reference") or {}
    before: Curve | None = prepared.reference if reference.get("type") == "samples" else read_curve(reference)
    assert before is not None
    driven = before if repaired is None else SplicedCurve(before, repaired, float(content["f_ttr_s"]))
    on_curve = prepared.scene.frame.cartesian(driven.sample(times)).xy
    return float(np.max(np.abs(on_curve - written)))
