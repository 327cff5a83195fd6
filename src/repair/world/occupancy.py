"""Obstacles in (s, l, t): boxes inflated by S_offset and L_offset (paper, Sec. III-A and V-B).

"We calculate the predicted trajectories of the outermost points of obstacles, taking into account
the safety margin, inside the space-time domain of the ego-driving lane": the outline of every
obstacle is projected on the frame, and the bounding interval on either axis is inflated so that
the ego may be treated as a point.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen
from repair.curves.base import FrenetTrajectory
from repair.timegrid import INSTANT
from repair.world.boxes import Occupancy

if TYPE_CHECKING:
    from repair.scene.frame import FrenetFrame
    from repair.scene.traffic.obstacle import Obstacle

__all__ = ["build_occupancy", "first_entry", "near", "relevant", "shrink_to_start"]


def build_occupancy(
    obstacles: Sequence[Obstacle], frame: FrenetFrame, dt: float, s_offset: float, l_offset: float
) -> tuple[Occupancy, tuple[str, ...]]:
    """Project all obstacles and inflate them.

    Parameters
    ----------
    obstacles : sequence of Obstacle
        Each with ``vertices`` (T, V, 2), NaN where absent.
    frame : FrenetFrame
    dt : float
        Scenario step [s].
    s_offset, l_offset : float
        Inflation on either side along s and l [m].

    Returns
    -------
    Occupancy
        One row for each obstacle, in order; none is left out.
    notes : tuple of str
        Which obstacles leave the frame's domain of projection, and when.
    """
    steps = len(obstacles[0].vertices) if obstacles else 1
    count = len(obstacles)
    lower = np.full((count, steps, 2), np.nan)
    upper = np.full((count, steps, 2), np.nan)
    notes: list[str] = []
    if count:
        projected = _project_all(obstacles, frame)
    inflate = np.array([s_offset, l_offset])
    for k, obstacle in enumerate(obstacles):
        points = projected[k]
        known = np.asarray(np.isfinite(points).all(axis=-1))
        present = np.asarray(np.isfinite(obstacle.vertices).all(axis=(1, 2)))
        seen = known.any(axis=1) & present
        if seen.any():
            masked = np.where(known[seen][..., None], points[seen], np.nan)
            lower[k, seen] = np.nanmin(masked, axis=1) - inflate
            upper[k, seen] = np.nanmax(masked, axis=1) + inflate
        hidden = present & ~known.all(axis=1)
        if hidden.any():
            first = float(np.flatnonzero(hidden)[0] * dt)
            notes.append(
                f"obstacle {obstacle.id} is (partly) outside of the frame's domain from t = {first:g} s; "
                "only the rectangle check sees it there"
            )
    ids = np.array([o.id for o in obstacles], dtype=np.int64)
    static = np.array([o.role in ("static", "environment") for o in obstacles], dtype=np.bool_)
    t = frozen(np.arange(steps) * dt)
    return Occupancy(t, ids, frozen(lower), frozen(upper), static), tuple(notes)


def _project_all(obstacles: Sequence[Obstacle], frame: FrenetFrame) -> list[Array]:
    """Frenet coordinates of all outlines, in one call (the search tree is queried once)."""
    shapes = [o.vertices.shape for o in obstacles]
    stacked = np.concatenate([o.vertices.reshape(-1, 2) for o in obstacles])
    result = np.full(stacked.shape, np.nan)
    finite = np.isfinite(stacked).all(axis=1)
    if finite.any():
        result[finite] = frame.to_frenet(stacked[finite])
    sizes = np.cumsum([s[0] * s[1] for s in shapes])[:-1]
    return [part.reshape(shape) for part, shape in zip(np.split(result, sizes), shapes, strict=True)]


def shrink_to_start(
    occupancy: Occupancy, start: Array, touching: set[int]
) -> tuple[Occupancy, tuple[str, ...]]:
    """Take back so much of the margin of an obstacle that the ego does not start inside of it.

    A start within the margin but without contact is not a collision yet; without this, nothing
    could ever be repaired from there.

    Parameters
    ----------
    start : (2,) array
        Where the ego starts, ``[s, l]`` [m].
    touching : set of int
        Obstacles in true contact with it, which keep their margin.

    Returns
    -------
    Occupancy
    notes : tuple of str
        What was taken back.
    """
    lower, upper = occupancy.lower[:, 0], occupancy.upper[:, 0]
    inside = (lower < start) & (start < upper)
    violated = np.flatnonzero(inside.all(axis=1))
    if not len(violated):
        return occupancy, ()
    new_lower, new_upper = occupancy.lower.copy(), occupancy.upper.copy()
    notes = []
    for k in violated:
        if int(occupancy.ids[k]) in touching:
            continue
        depth = np.array([upper[k] - start, start - lower[k]])  # (side, axis)
        side, axis = np.unravel_index(np.argmin(depth), depth.shape)
        take = float(depth[side, axis]) + 1e-6
        if side == 0:
            new_upper[k, :, axis] -= take
        else:
            new_lower[k, :, axis] += take
        notes.append(
            f"the ego starts {take:.2f} m inside the margin of obstacle {occupancy.ids[k]}; "
            f"that margin is reduced along {'sl'[int(axis)]}"
        )
    return (
        Occupancy(occupancy.t, occupancy.ids, frozen(new_lower), frozen(new_upper), occupancy.static),
        tuple(notes),
    )


def first_entry(occupancy: Occupancy, trajectory: FrenetTrajectory) -> tuple[int, int] | None:
    """The paper's detectCollision: first sample inside a box, as (sample, row of the obstacle).

    Parameters
    ----------
    trajectory : FrenetTrajectory
        Sampled at times covered by the occupancy; other samples are free.
    """
    if not len(occupancy):
        return None
    lower, upper = occupancy.at(trajectory.t)
    inside = np.asarray(((lower < trajectory.position) & (trajectory.position < upper)).all(axis=2))
    hit = inside.any(axis=0)
    if not hit.any():
        return None
    sample = int(np.argmax(hit))
    return sample, int(np.argmax(inside[:, sample]))


def relevant(occupancy: Occupancy, t_start: float, t_end: float, reach: Array, l_room: Array) -> Occupancy:
    """The obstacles that the ego could touch between two times.

    Parameters
    ----------
    reach : (2,) array
        Smallest and largest s the ego can be at until ``t_end`` [m].
    l_room : (2,) array
        Smallest and largest l it can be at [m].
    """
    if not len(occupancy):
        return occupancy
    last_step = len(occupancy.t) - 1
    first = max(int(occupancy.t.searchsorted(t_start + INSTANT, side="right")) - 1, 0)
    last = min(int(occupancy.t.searchsorted(t_end - INSTANT, side="left")), last_step)
    if last > first:
        kept = near(occupancy.swept[:, :, first:last], reach, l_room)
    else:  # a single step, at which the boxes are what they are
        lower, upper = occupancy.lower[:, first], occupancy.upper[:, first]
        smallest, largest = np.array([reach, l_room]).T
        kept = ((upper > smallest) & (lower < largest)).all(axis=1)
    return occupancy if kept.all() else occupancy.select(kept)


def near(
    swept: Array, reach: Sequence[float] | Array, l_room: Sequence[float] | Array
) -> npt.NDArray[np.bool_]:
    """Which obstacles (N,) are within reach and room in one of the steps (between two steps of the scenario).

    Parameters
    ----------
    swept : (4, N, K) array
        What the boxes span in each of them, as ``Occupancy.swept`` has it.
    """
    bound = np.array([reach[0], -reach[1], l_room[0], -l_room[1]])[:, None, None]
    within = np.logical_and.reduce(swept > bound, axis=0)
    return np.asarray(np.logical_or.reduce(within, axis=1))
