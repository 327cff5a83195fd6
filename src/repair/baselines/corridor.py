"""A convex driving corridor around a guide: a trapezoid in (s, t) and an interval in l per piece.

After the trapezoidal prisms of Deolasee et al. (*Spatio-temporal motion planning for autonomous
vehicles with trapezoidal prism corridors and Bézier curves*, ACC 2023). Over a piece the free space
beside an obstacle is cut off by one straight line (s) or one constant (l): an under-approximation
whose conservatism the paper blames for the failure of QPTR.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from repair.types import Array, RepairProblem, Side

__all__ = ["Corridor", "NoCorridor", "build_corridor"]

_TOLERANCE = 1e-6
_ALONG = 2.0  # the lateral room counts this far before and behind the guide [m]


class NoCorridor(Exception):
    """There is no convex corridor; the message says where it closes."""


@dataclass(frozen=True)
class Corridor:
    """Room of M pieces.

    Attributes
    ----------
    edges : (M + 1,) array
        Times at which the pieces meet [s].
    s_lower, s_upper : (M, 2) array
        Bounds of s at the start and the end of each piece [m], linear in between.
    l_lower, l_upper : (M,) array
        Bounds of l [m].
    """

    edges: Array
    s_lower: Array
    s_upper: Array
    l_lower: Array
    l_upper: Array

    def control_bounds(self, degree: int) -> tuple[Array, Array]:
        """Lower and upper bounds (M, degree + 1, 2) of the control points."""
        u = np.linspace(0.0, 1.0, degree + 1)
        bounds = []
        for s, lateral in ((self.s_lower, self.l_lower), (self.s_upper, self.l_upper)):
            along = s[:, :1] + u * (s[:, 1:] - s[:, :1])
            bounds.append(np.stack([along, np.broadcast_to(lateral[:, None], along.shape)], axis=2))
        return bounds[0], bounds[1]


def build_corridor(problem: RepairProblem, edges: Array) -> Corridor:
    """The corridor around ``problem.passing`` (around the reference where there is none).

    Parameters
    ----------
    problem : RepairProblem
    edges : (M + 1,) array
        Times at which the pieces meet [s]; the first is t_rep.

    Raises
    ------
    NoCorridor
        If it is empty somewhere, or does not contain the start.
    """
    steps = problem.occupancy.t
    times = np.union1d(edges, steps[(steps > edges[0] + 1e-9) & (steps < edges[-1] - 1e-9)])
    times = times[np.concatenate([[True], np.diff(times) > 1e-9])]
    guide = _guide(problem, times)
    above, below, left, right = _walls(problem, times, edges, guide)

    pieces = len(edges) - 1
    s_lower, s_upper = np.empty((pieces, 2)), np.empty((pieces, 2))
    l_lower, l_upper = np.full(pieces, -np.inf), np.full(pieces, np.inf)
    for i in range(pieces):
        inside = (times >= edges[i] - 1e-9) & (times <= edges[i + 1] + 1e-9)
        t, s = times[inside], guide[inside, 0]
        s_upper[i] = _line_below(t, above[i][inside], s)
        s_lower[i] = -_line_below(t, -below[i][inside], -s)
        l_lower[i], l_upper[i] = left[i][inside].max(), right[i][inside].min()
    if problem.lateral:
        _cut_to_road(problem, edges, times, guide, l_lower, l_upper)
    corridor = Corridor(edges, s_lower, s_upper, l_lower, l_upper)
    _require_open(problem, corridor)
    return corridor


def _guide(problem: RepairProblem, times: Array) -> Array:
    """Where the guide is (K, 2); without lateral freedom its l is that of the reference."""
    reference = problem.reference.sample(times).position
    if problem.passing is None:
        return reference
    path = problem.passing.guide
    guide = np.column_stack([np.interp(times, path.t, path.position[:, k]) for k in (0, 1)])
    if not problem.lateral:
        guide[:, 1] = reference[:, 1]
    return guide


def _walls(
    problem: RepairProblem, times: Array, edges: Array, guide: Array
) -> tuple[Array, Array, Array, Array]:
    """What the obstacles leave to each piece: largest and smallest s, smallest and largest l, (M, K) each.

    Over a piece an obstacle is kept on that side which the guide keeps all the time; where the guide
    changes sides within the piece, each time has its own.
    """
    pieces, count = len(edges) - 1, len(times)
    duration = problem.t_end - problem.t_rep
    farthest = problem.start[0, 0] + problem.limits.v_max * duration + 1.0
    above = np.full((pieces, count), farthest)
    below = np.full((pieces, count), problem.start[0, 0] - 1.0)
    left, right = np.full((pieces, count), -np.inf), np.full((pieces, count), np.inf)
    if not len(problem.occupancy):
        return above, below, left, right
    lower, upper = problem.occupancy.at(times)
    lower, upper = lower - problem.margin, upper + problem.margin
    s, l = guide.T  # noqa: E741
    # in the order of Side
    room = np.stack([lower[..., 0] - s, s - upper[..., 0], l - upper[..., 1], lower[..., 1] - l])
    present = np.isfinite(room).all(axis=0)
    if not problem.lateral:
        # l is given: a box beside it is no matter, and one across it can only be passed along s.
        present &= (room[Side.LEFT] < 0.0) & (room[Side.RIGHT] < 0.0)
        room[[Side.LEFT, Side.RIGHT]] = -np.inf
    for i in range(pieces):
        inside = (times >= edges[i] - 1e-9) & (times <= edges[i + 1] + 1e-9)
        seen = present & inside
        least = np.where(seen, room, np.inf).min(axis=2)
        kept = np.argmax(least, axis=0)
        steady = np.take_along_axis(least, kept[None], axis=0)[0] >= -_TOLERANCE
        momentary = np.argmax(np.where(present, room, -np.inf), axis=0)
        side = np.where(steady[:, None], kept[:, None], momentary)
        for bounds, corner, axis, chosen, pick in (
            (above, lower, 0, Side.BEHIND, np.minimum),
            (below, upper, 0, Side.AHEAD, np.maximum),
            (left, upper, 1, Side.LEFT, np.maximum),
            (right, lower, 1, Side.RIGHT, np.minimum),
        ):
            for k in np.flatnonzero((seen & (side == chosen)).any(axis=1)):
                at = seen[k] & (side[k] == chosen)
                bounds[i, at] = pick(bounds[i, at], corner[k, at, axis])
    return above, below, left, right


def _line_below(t: Array, values: Array, guide: Array) -> Array:
    """End values (2,) of the line below ``values`` that leaves the guide the most room.

    Candidates are the lines through two of the points, and the lines through one of them with the
    guide's mean slope; the best is that of largest smallest distance to the guide.
    """
    if np.ptp(values) < 1e-9:
        return np.array([values[0], values[-1]])
    i, j = np.triu_indices(len(t), k=1)
    slope = np.concatenate(
        [(values[j] - values[i]) / (t[j] - t[i]), np.full(len(t), (guide[-1] - guide[0]) / (t[-1] - t[0]))]
    )
    base = np.concatenate([i, np.arange(len(t))])
    lines = values[base][:, None] + slope[:, None] * (t[None, :] - t[base][:, None])
    below = (lines <= values + _TOLERANCE).all(axis=1)
    lines = lines[below]
    best = int(np.argmax((lines - guide).min(axis=1)))
    return np.asarray(lines[best][[0, -1]])


def _cut_to_road(
    problem: RepairProblem, edges: Array, times: Array, guide: Array, l_lower: Array, l_upper: Array
) -> None:
    """Cut the l intervals to the lateral room around the guide; the start always counts as inside."""
    start = float(problem.start[0, 1])
    reach = guide[:, 0][:, None] + np.array([-_ALONG, 0.0, _ALONG])
    right, left = problem.bounds.at(reach)
    for i in range(len(edges) - 1):
        inside = (times >= edges[i] - 1e-9) & (times <= edges[i + 1] + 1e-9)
        narrow, wide = right[inside].max(), left[inside].min()
        if i == 0:
            narrow, wide = min(narrow, start), max(wide, start)
        l_lower[i], l_upper[i] = max(l_lower[i], narrow), min(l_upper[i], wide)


def _require_open(problem: RepairProblem, corridor: Corridor) -> None:
    """Raise where the corridor is empty, breaks at a joint, or excludes the start or even full braking."""
    edges, start = corridor.edges, problem.start[0]
    if (corridor.l_lower > corridor.l_upper + _TOLERANCE).any():
        i = int(np.argmax(corridor.l_lower - corridor.l_upper))
        raise NoCorridor(f"no room sideways between t = {edges[i]:.2f} s and {edges[i + 1]:.2f} s")
    # Two neighbours share their joint's control point, so both must have room for it.
    l_low = _at_edges(corridor.l_lower, corridor.l_lower, np.maximum)
    l_high = _at_edges(corridor.l_upper, corridor.l_upper, np.minimum)
    s_low = _at_edges(corridor.s_lower[:, 0], corridor.s_lower[:, 1], np.maximum)
    s_high = _at_edges(corridor.s_upper[:, 0], corridor.s_upper[:, 1], np.minimum)
    if not s_low[0] - _TOLERANCE <= start[0] <= s_high[0] + _TOLERANCE:
        raise NoCorridor(f"the start lies {start[0] - s_high[0]:.2f} m beyond the first trapezoid")
    if problem.lateral and not l_low[0] - _TOLERANCE <= start[1] <= l_high[0] + _TOLERANCE:
        raise NoCorridor("the start lies beside the first piece of the corridor")
    for low, high, where in ((s_low, s_high, "along the path"), (l_low, l_high, "sideways")):
        if (low > high + _TOLERANCE).any():
            i = int(np.argmax(low - high))
            raise NoCorridor(f"no room {where} at t = {edges[i]:.2f} s")
    excess = _least_progress(problem, edges) - s_high
    if (excess > 1e-3).any():
        i = int(np.argmax(excess > 1e-3))
        raise NoCorridor(
            f"at t = {edges[i]:.2f} s even full braking leaves the corridor, by {excess[i]:.2f} m"
        )


def _at_edges(first: Array, last: Array, tighter: np.ufunc) -> Array:
    """Bounds at the M + 1 edges from those at the start and the end of every piece."""
    return np.concatenate([first[:1], tighter(last[:-1], first[1:]), last[-1:]])


def _least_progress(problem: RepairProblem, edges: Array) -> Array:
    """Where full braking within the limits leads (M + 1,) [m]; no curve can stay farther back."""
    s, speed, braking = problem.start[0, 0], max(float(problem.start[1, 0]), 0.0), -problem.limits.a_min
    tau = np.minimum(edges - edges[0], speed / braking)
    return np.asarray(s + speed * tau - 0.5 * braking * tau**2)
