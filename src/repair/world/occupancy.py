"""Obstacles in (s, l, t): boxes inflated by S_offset and L_offset (paper, Sec. III-A and V-B).

"We calculate the predicted trajectories of the outermost points of obstacles, taking into account
the safety margin, inside the space-time domain of the ego-driving lane": the outline of every
obstacle is projected on the frame, and the bounding interval on either axis is inflated so that
the ego may be treated as a point.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen, names
from repair.curves.base import FrenetTrajectory
from repair.scene.road.beside import to_frenet_around
from repair.scene.road.passes import every_pass, passes
from repair.timegrid import INSTANT
from repair.world.boxes import Occupancy

if TYPE_CHECKING:
    from repair.scene.frame import FrenetFrame
    from repair.scene.traffic.obstacle import Obstacle

__all__ = ["Within", "build_occupancy", "first_entry", "near", "relevant"]

# Corners (T, 2) of a box, and where the outline is whole.
_Box = tuple[Array, Array, npt.NDArray[np.bool_]]

_STANDING = ("static", "environment")
_NO_BOX: _Box = np.empty((0, 2)), np.empty((0, 2)), np.empty(0, dtype=np.bool_)
_BEYOND = 1e12  # as far as this every place is [m]: the search tree has no answer where a square overflows
_GENTLE = 0.5  # curvature times offset, up to which the nearest place says who is behind and who ahead
_AROUND = 20.0  # so far around it the curvature is looked at [m]


class Within(NamedTuple):
    """Where the ego may be.

    Attributes
    ----------
    start : float
        Where it starts, as an arc length [m].
    low, high : float
        The part of the path, likewise.
    aside : (float, float)
        How far to the right and to the left of it [m], both positive.
    ways : (K,) array
        How far from its start by the end of each of the scenario's steps [m]; later it is nowhere.
    """

    start: float
    low: float
    high: float
    aside: tuple[float, float]
    ways: Array


def build_occupancy(
    obstacles: Sequence[Obstacle],
    frame: FrenetFrame,
    dt: float,
    s_offset: float,
    l_offset: float,
    within: Within | None = None,
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
    within : Within, optional
        Who is nowhere near it is not projected, and has a row of NaN.

    Returns
    -------
    Occupancy
        One row for each obstacle, in order; none is left out. Where the frame passes a place more than once
        (a ring of more than a lap), further rows for each further pass that has the obstacle beside it.
    notes : tuple of str
        Which obstacles leave the frame's domain of projection, and when.
    """
    steps = len(obstacles[0].vertices) if obstacles else 1
    if within is None:
        looked = [_looked_at(k, one) for k, one in enumerate(obstacles)]
    else:
        near, at = _near_by(obstacles, frame, within, s_offset, l_offset)
        looked = [_looked_at(k, one, near[k], at[k]) for k, one in enumerate(obstacles)]
    looked = [one for one in looked if len(one.steps)]
    lower, upper = np.full((2, len(obstacles), steps, 2), np.nan)
    more: list[tuple[Array, Array]] = []
    which = list(range(len(obstacles)))
    notes: list[str] = []
    inflate = np.array([s_offset, l_offset])
    seen = [np.zeros(len(one.steps), dtype=np.bool_) for one in looked]
    for turn, boxes in enumerate(_boxes(looked, frame, inflate, often=within is not None)):
        for j, (one, (low, high, whole)) in enumerate(zip(looked, boxes, strict=True)):
            seen[j] |= whole
            if turn == 0:
                lower[one.row, one.steps], upper[one.row, one.steps] = low, high
            elif np.isfinite(low).any():
                corners = np.full((2, steps, 2), np.nan)
                corners[:, one.steps] = low, high
                more.append((corners[0], corners[1]))
                which.append(one.row)
    for one, whole in zip(looked, seen, strict=True):
        if not whole.all():
            first = float(one.steps[np.argmin(whole)] * dt)
            notes.append(
                f"obstacle {obstacles[one.row].id} is (partly) outside of the frame's domain from "
                f"t = {first:g} s; only the check of the true shapes sees it there"
            )
    if more:
        lower = np.concatenate([lower, [low for low, _ in more]])
        upper = np.concatenate([upper, [high for _, high in more]])
    ids = names(obstacles[k].id for k in which)
    static = np.array([obstacles[k].role in _STANDING for k in which], dtype=np.bool_)
    t = frozen(np.arange(steps) * dt)
    return Occupancy(t, ids, frozen(lower), frozen(upper), static), tuple(notes)


class _Looked(NamedTuple):
    """An obstacle, the steps at which it is there and matters, and its outline at these (T, V, 2).

    ``at`` (T,) is which of the frame's places is nearest to its middle; negative where nobody has looked.
    """

    row: int
    steps: npt.NDArray[np.intp]
    outline: Array
    at: npt.NDArray[np.intp]


def _looked_at(
    row: int,
    obstacle: Obstacle,
    near: npt.NDArray[np.bool_] | None = None,
    at: npt.NDArray[np.intp] | None = None,
) -> _Looked:
    steps = np.arange(len(obstacle.vertices)) if near is None else np.flatnonzero(near)
    outline = obstacle.vertices[steps]
    there = np.isfinite(outline).all(axis=(1, 2))
    if not there.all():
        steps, outline = steps[there], outline[there]
    return _Looked(row, steps, outline, np.full(len(steps), -1) if at is None else at[steps])


def _near_by(
    obstacles: Sequence[Obstacle], frame: FrenetFrame, within: Within, s_offset: float, l_offset: float
) -> tuple[list[npt.NDArray[np.bool_]], list[npt.NDArray[np.intp]]]:
    """At which steps each obstacle may be near the ego; other shapes than rectangles always are.

    A step too early and one too late, since boxes are interpolated between the steps. And where it is
    nearest to the frame, as ``_Looked.at`` says.
    """
    steps = len(obstacles[0].vertices) if obstacles else 0
    found = [np.full(steps, obstacle.rectangles is None) for obstacle in obstacles]
    at = list(np.full((len(obstacles), steps), -1))
    rows = [k for k, one in enumerate(obstacles) if one.rectangles is not None]
    if not rows:
        return found, at
    tables = np.array([obstacles[k].rectangles for k in rows])  # (N, T, 5)
    centre = tables[..., 0] + 1j * tables[..., 1]
    moved = np.nan_to_num(np.abs(np.diff(centre, axis=1))).max(axis=1, initial=0.0)
    size = np.sqrt(tables[..., 3] ** 2 + tables[..., 4] ** 2) + moved[:, None]  # hypot takes far longer
    reach = max(within.aside) + s_offset + l_offset
    # How far the ego may be settles most; then, how far aside of the frame it is, and where along it.
    ways = np.full(steps, -np.inf)
    ways[: len(within.ways)] = within.ways[:steps]
    i, j = np.nonzero(np.abs(centre - complex(*frame.position(within.start))) <= ways + (reach + size))
    middle = np.clip(centre[i, j].view(np.float64).reshape(-1, 2), -_BEYOND, _BEYOND)
    place = frame.nearest(middle)
    s, half = frame.s[place], size[i, j] + frame.s[1]
    x, y = np.ascontiguousarray((middle - frame.points[place]).T)
    apart = np.sqrt(x * x + y * y)
    close = (apart <= reach + half) | (place == 0) | (place == len(frame.s) - 1)  # or beyond an end
    if len(passes(frame)) == 1:
        # Along the frame an outline is longer than it is, the more so inside of a bend.
        long = half / (1.0 - _GENTLE)
        told = (long <= _AROUND) & (_bends_around(frame)[place] * (apart + half) <= _GENTLE)
        along = (s + long + s_offset >= within.low) & (s - long - s_offset <= within.start + ways[j])
        heading, room = frame.heading_table[place], half + l_offset
        l = np.cos(heading) * y - np.sin(heading) * x  # noqa: E741
        right, left = within.aside
        close &= ~told | along & (l >= -right - room) & (l <= left + room)
    near = np.zeros((len(rows), steps + 2), dtype=np.bool_)
    for shift in (0, 1, 2):
        near[i[close], j[close] + shift] = True
    near[:, 1:-1] &= np.isfinite(centre)
    nearest = np.full((len(rows), steps), -1)
    nearest[i, j] = place
    for k, one, its in zip(rows, near[:, 1:-1], nearest, strict=True):
        found[k], at[k] = one, its
        if obstacles[k].role in _STANDING:
            found[k], at[k] = np.full(steps, one.any()), np.full(steps, its.max(initial=-1))
    return found, at


@lru_cache(maxsize=8)
def _bends_around(frame: FrenetFrame) -> Array:
    """The sharpest bend (M,) around each of the frame's places [1/m]."""
    from scipy.ndimage import maximum_filter1d

    cells = 2 * int(np.ceil(_AROUND / frame.s[1])) + 1
    return frozen(maximum_filter1d(np.abs(frame.curvature_table), cells))


def _box(points: Array, inflate: Array) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    """Inflated corners (T, 2) around what is known of an outline (T, V, 2), and where it is whole.

    NaN where nothing is known.
    """
    known = np.isfinite(points[..., 0]) & np.isfinite(points[..., 1])
    whole = np.asarray(known.all(axis=1))
    by_point = np.ascontiguousarray(points.transpose(1, 0, 2))  # extremes over long rows
    lower, upper = by_point.min(axis=0) - inflate, by_point.max(axis=0) + inflate
    part = known.any(axis=1) & ~whole
    if part.any():
        masked = np.where(known[part][..., None], points[part], np.nan)
        lower[part] = np.nanmin(masked, axis=1) - inflate
        upper[part] = np.nanmax(masked, axis=1) + inflate
    lower[~(whole | part)] = upper[~(whole | part)] = np.nan
    return lower, upper, whole


def _boxes(
    looked: Sequence[_Looked], frame: FrenetFrame, inflate: Array, often: bool
) -> Iterator[list[_Box]]:
    """:func:`_box` of each, for each pass of the frame; outlines of as many points all at once.

    Where it is done ``often`` in one frame, outlines are projected from their middles on.
    """
    alike: dict[int, list[int]] = {}
    for j, one in enumerate(looked):
        alike.setdefault(one.outline.shape[1], []).append(j)
    if not alike:
        return
    outlines = [np.concatenate([looked[j].outline for j in rows]) for rows in alike.values()]
    stacked = np.concatenate([some.reshape(-1, 2) for some in outlines])
    if often and len(passes(frame)) == 1:
        middles = np.concatenate([some.mean(axis=1) for some in outlines])
        points = np.repeat([some.shape[1] for some in outlines], [len(some) for some in outlines])
        at = np.concatenate([looked[j].at for rows in alike.values() for j in rows])
        projected = [to_frenet_around(frame, stacked, middles, points, at)]
    else:
        projected = every_pass(frame, stacked)
    for found in projected:
        made, begin = [_NO_BOX] * len(looked), 0
        for width, rows in alike.items():
            steps = [len(looked[j].steps) for j in rows]
            end = begin + width * sum(steps)
            lower, upper, whole = _box(found[begin:end].reshape(-1, width, 2), inflate)
            begin, row = end, 0
            for j, count in zip(rows, steps, strict=True):
                part = slice(row, row + count)
                made[j] = lower[part], upper[part], whole[part]
                row += count
        yield made


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
