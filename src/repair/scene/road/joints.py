"""Where one lanelet goes on in another: gaps, overlaps and steps aside, and a line that stands them.

Maps are drawn: a successor may begin some way beyond the end of its predecessor, metres before it, or beside
it. The centre line leads over all of that without going backwards and without a kink; what was bridged is
named.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from repair.arrays import Array
from repair.scene.road.lanes import Lane, locate

__all__ = ["Bridge", "joined", "joints_of"]

_OVERLAP = 20.0  # a successor begins at most this far before its predecessor ends [m]
_GAP = 5e-4  # what is named: gaps [m],
_STEP = 0.05  # overlaps and steps aside [m]
_LANE = 3.5  # a step aside by this much is led over like a change of lanes [m]


@dataclass(frozen=True)
class Bridge:
    """A fault of the map that was bridged.

    Attributes
    ----------
    kind : str
        ``gap``, ``overlap`` (along the road), ``step`` (aside, where lanelets meet), or ``hole``.
    size : float
        Its length, of a hole its width [m].
    place : (float, float)
        Where it is [m].
    lanelets : tuple of int
        Between which it is; of a hole none.
    """

    kind: str
    size: float
    place: tuple[float, float]
    lanelets: tuple[int, ...] = ()

    def __str__(self) -> str:
        where = f"({self.place[0]:.1f}, {self.place[1]:.1f})"
        size = f"{self.size:.3f} m" if self.size < 0.1 else f"{self.size:.2f} m"
        if self.kind == "hole":
            return f"a gap or hole of the map at {where}, {size} wide, counts as road"
        side, how = {
            "gap": ("beyond", "leads over the gap"),
            "overlap": ("before", "goes on along it from there"),
            "step": ("beside", "leads over smoothly"),
        }[self.kind]
        before, after = self.lanelets
        return f"lanelet {after} begins {size} {side} the end of lanelet {before} at {where}; the path {how}"


@dataclass(frozen=True)
class _Joint:
    """How a line goes on: from where on, and how far ahead of the end and beside it that is [m]."""

    arc: float
    ahead: float
    aside: float
    normal: Array


def _lengths(line: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])


def _part(line: Array, low: float, high: float, spacing: float = np.inf) -> Array:
    """The part of a polyline between two arc lengths, with points at most ``spacing`` apart."""
    arc = _lengths(line)
    more = np.arange(low, high, spacing) if np.isfinite(spacing) else np.empty(0)
    at = np.unique(np.concatenate([[low], arc[(arc > low + 1e-6) & (arc < high - 1e-6)], more, [high]]))
    return np.stack([np.interp(at, arc, line[:, 0]), np.interp(at, arc, line[:, 1])], axis=1)


def _joint(line: Array, following: Array) -> _Joint:
    """Where a line meets the one that follows it."""
    end = line[-1]
    back = end - line[:-1]
    far = np.flatnonzero(np.hypot(back[:, 0], back[:, 1]) > 1e-3)
    direction = back[far[-1]] / np.hypot(*back[far[-1]]) if len(far) else np.array([1.0, 0.0])
    normal = np.array([-direction[1], direction[0]])
    arc = 0.0
    total = float(_lengths(following)[-1])
    if (following[0] - end) @ direction < -_GAP and total > 1.0:
        arc = locate(_part(following, 0.0, min(_OVERLAP, 0.5 * total)), end)[0]
    start = _part(following, arc, total)[0] if arc > 0.0 else following[0]
    return _Joint(arc, float((start - end) @ direction), float((start - end) @ normal), normal)


def joined(line: Array, following: Array, change: float) -> Array:
    """A polyline with another one that follows it, without going backwards and without a step aside.

    Parameters
    ----------
    line, following : (M, 2), (N, 2) array
    change : float
        Length over which a lane would be changed [m]; steps aside take less.
    """
    joint = _joint(line, following)
    total, done = float(_lengths(following)[-1]), float(_lengths(line)[-1])
    if joint.arc > 0.0:
        following = _part(following, joint.arc, total)
        total -= joint.arc
    if abs(joint.aside) > _STEP and total > 1.0 and done > 1.0:
        half = 0.5 * float(np.clip(change * np.sqrt(abs(joint.aside) / _LANE), 6.0, 60.0))
        before, after = min(half, 0.8 * done), min(half, 0.8 * total)
        line = _shifted(line, done - before, done, joint.aside, 0.0)
        following = _shifted(following, 0.0, after, joint.aside, 0.5)
    keep = np.hypot(*(following - line[-1]).T) > 1e-3
    first = int(np.argmax(keep)) if keep.any() else len(following)
    return np.concatenate([line, following[first:]])


def _shifted(line: Array, low: float, high: float, aside: float, share: float) -> Array:
    """A line moved aside between two arc lengths: half of the way from its own place to the other one's.

    ``share`` is 0 for the line that comes in, which is left at ``low``, and 0.5 for the one that goes on,
    which is reached at ``high``.
    """
    total = float(_lengths(line)[-1])
    moved = _part(line, low, high, 1.0)
    arc = _lengths(moved)
    u = share + 0.5 * arc / arc[-1]
    way = u**3 * (10.0 - 15.0 * u + 6.0 * u * u) - (1.0 if share else 0.0)
    step = np.gradient(moved, axis=0)
    normal = np.stack([-step[:, 1], step[:, 0]], axis=1) / np.hypot(*step.T)[:, None]
    moved = moved + aside * way[:, None] * normal
    rest = [_part(line, 0.0, low)[:-1]] if low > 0.0 else []
    rest += [moved]
    rest += [_part(line, high, total)[1:]] if high < total else []
    return np.concatenate(rest)


def joints_of(pairs: Iterable[tuple[int, int]], lanes: Mapping[int, Lane]) -> list[Bridge]:
    """What there is to bridge between lanelets and those that follow them.

    Parameters
    ----------
    pairs : iterable of (int, int)
        Ids of a lanelet and its successor.
    lanes : mapping
        The map's lanes by id.
    """
    found = []
    for first, second in dict.fromkeys(pairs):
        here, there = lanes[first].center, lanes[second].center
        off = there[0] - here[-1]
        if abs(off[0]) < _GAP and abs(off[1]) < _GAP:
            continue
        joint = _joint(here, there)
        place = float(here[-1][0]), float(here[-1][1])
        sizes = {"gap": joint.ahead, "overlap": joint.arc, "step": abs(joint.aside)}
        least = {"gap": _GAP, "overlap": _STEP, "step": _STEP}
        found += [Bridge(k, size, place, (first, second)) for k, size in sizes.items() if size >= least[k]]
    return found
