"""What a film of a drive shows: road, traffic, the plan and the ego."""

from __future__ import annotations

import numpy as np

from repair.arrays import Array
from repair.outcome.data import Body, Drawing, Line
from repair.outcome.draw import body_of, road_between, rounded
from repair.simulate.data import Driven
from repair.simulate.many.case import Case

__all__ = ["drawing_of_drive"]

_AROUND = 30.0  # road and traffic are kept so far beyond what is driven [m]
_OUTLINES = 8  # who moves is outlined so often; in between he turns with his motion


def drawing_of_drive(case: Case, driven: Driven) -> Drawing:
    """Road, traffic, plan and ego of a drive.

    Parameters
    ----------
    case : Case
    driven : Driven
        Of this case.
    """
    states = {name: np.asarray(column) for name, column in driven.states.items()}
    ego, plan = (
        np.column_stack([states[f"{prefix}{name}"] for name in ("x", "y", "orientation")])
        for prefix in ("", "plan_")
    )
    last = len(ego) - 1
    seen = np.concatenate([ego[:, :2], plan[:, :2]])
    low, high = seen.min(axis=0) - _AROUND, seen.max(axis=0) + _AROUND
    scene = case.plan.scene
    areas, edges = road_between(scene.scenario.lanelet_network, low, high)
    return Drawing(
        start_s=0.0, s_offset=0.0, until=round(last * driven.dt, 6), steps=(last, 0),
        body=rounded(scene.vehicle.corners), ego=rounded(ego), unrepaired=None,
        lines=(_line(case, states, plan),), boxes=(), bodies=_bodies(case, last, (low, high)),
        areas=areas, edges=edges,
    )  # fmt: skip


def _line(case: Case, states: dict[str, Array], plan: Array) -> Line:
    """The plan, at the steps of the drive."""
    t, speed = states["t"], states["plan_speed"]
    along = case.curve.sample(t).position
    acceleration = np.gradient(speed, t) if len(t) > 1 else np.zeros(len(t))
    columns = (t, *along.T, *plan[:, :2].T, speed, acceleration)
    return Line("reference", case.plan.name, None, *(rounded(column) for column in columns))


def _bodies(case: Case, last: int, window: tuple[Array, Array]) -> tuple[Body, ...]:
    made = []
    for one in case.world.since(0, last):
        there = np.flatnonzero(np.isfinite(one.vertices).any(axis=(1, 2)))
        chosen = there[np.unique(np.linspace(0, len(there) - 1, _OUTLINES).round().astype(int))]
        made.append(body_of(one, tuple(chosen.tolist()), last, window))
    return tuple(body for body in made if body is not None)
