"""Collision with obstacles, for the ego's oriented rectangle; the edge of the road is in ``road.py``.

The verdicts are at least as strict as those of the drivability checker
(``commonroad_dc.feasibility.solution_checker``), which looks at scenario steps only. The tests are
the project's own (separating axes in numpy): they need no build and name obstacle and time at once.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from repair.types import Array, Points

if TYPE_CHECKING:
    from repair.scene.obstacles import Obstacle
    from repair.scene.vehicle import Vehicle

__all__ = ["CollisionWorld", "Contact", "official_shifts"]

Index = npt.NDArray[np.intp]

# Shapes closer than this [m] count as touching: rounding must not make us laxer than pycrcc.
_TOUCH = 1e-6
# Coarse tests before the exact ones reach this much farther [m]: more than any rounding.
_SPARE = 1e-3
# As arrays, because NumPy takes long to convert a plain number.
_CLOCKWISE, _TOUCHING = np.array(-1j), np.array(complex(_TOUCH, _TOUCH))


class Contact(NamedTuple):
    """First contact: time [s], the obstacle, and whether that obstacle strikes from behind."""

    time: float
    obstacle_id: int
    from_behind: bool


def official_shifts(scenario: Any) -> dict[int, int]:
    """By how many steps the drivability checker is late, for the obstacles where it is not on time.

    ``commonroad_dc.create_collision_object`` takes the initial state as the first occupancy and
    appends those of the prediction, whatever the prediction's own first time step.
    """
    shifts = {}
    for obstacle in scenario.dynamic_obstacles:
        prediction = obstacle.prediction
        if prediction is None:
            continue
        # A trajectory's occupancy set is computed when asked for, which takes far longer than its states.
        trajectory = getattr(prediction, "trajectory", None)
        parts = prediction.occupancy_set if trajectory is None else trajectory.state_list
        if not parts:
            continue
        first = parts[0].time_step  # of a set this may be an interval
        placed = obstacle.initial_state.time_step + 1
        if not getattr(first, "start", first) <= placed <= getattr(first, "end", first):
            shifts[obstacle.obstacle_id] = int(placed - getattr(first, "start", first))
    return shifts


class CollisionWorld:
    """The obstacles over time, built once, asked many times.

    Rectangles and circles are interpolated between the scenario steps (centre, heading and size linear
    in time). Sets and polygons hold over the intervals on both sides of their step.

    Parameters
    ----------
    obstacles : sequence of Obstacle
        Arrays of ``n_steps + 1`` rows.
    vehicle : Vehicle
        The ego.
    dt : float
        Scenario time step [s].
    n_steps : int
        Index of the last scenario step.
    substeps : int
        Samples per scenario step.
    shifts : mapping, optional
        Obstacle id -> steps by which the drivability checker is late (:func:`official_shifts`). Such
        obstacles are tested both where they are and, at scenario steps, where the checker puts them.
    """

    def __init__(
        self,
        obstacles: Sequence[Obstacle],
        vehicle: Vehicle,
        dt: float,
        n_steps: int,
        substeps: int = 4,
        shifts: Mapping[int, int] | None = None,
    ) -> None:
        self.dt = dt
        self.substeps = substeps
        self.n_samples = n_steps * substeps + 1
        self._obstacles = tuple(obstacles)
        self._half = np.array((0.5 * vehicle.length, 0.5 * vehicle.width))
        self._diagonal = np.array(complex(*self._half))  # an array for the reason that _CLOCKWISE is one
        sample = np.arange(self.n_samples)
        self._before = sample // substeps
        self._after = -(-sample // substeps)
        self._build(shifts or {}, float(np.hypot(*self._half)))

    def _build(self, shifts: Mapping[int, int], ego_radius: float) -> None:
        """Tabulate every shape's pose and reach over the samples.

        Columns are tracks: an obstacle gives one, or two where it is held over intervals or where the
        drivability checker is late. Circles and polygons have the size of their circumcircle.
        """
        tracks: list[Array] = []  # (S, 5)
        owner: list[int] = []
        kind: list[int] = []
        steps: list[npt.NDArray[np.intp]] = []  # which scenario step's polygons hold, (S,)

        def add(index: int, track: Array, what: int, step: npt.NDArray[np.intp]) -> None:
            tracks.append(track)
            owner.append(index)
            kind.append(what)
            steps.append(step)

        for index, obstacle in enumerate(self._obstacles):
            what, rows = _rows(obstacle)
            if what == _POLYGON or obstacle.role == "set_based":
                add(index, rows[self._before], what, self._before)
                add(index, rows[self._after], what, self._after)
            else:
                add(index, self._interpolate(rows), what, self._before)
            shift = shifts.get(obstacle.id, 0) if obstacle.role != "static" else 0
            if shift:
                late = self._before - shift
                track = rows[np.clip(late, 0, len(rows) - 1)]
                track[(late < 0) | (late >= len(rows)) | (self._before != self._after)] = np.nan
                add(index, track, what, np.clip(late, 0, len(rows) - 1))

        stacked = np.stack(tracks, axis=1) if tracks else np.empty((self.n_samples, 0, 5))
        self._owner = np.array(owner, dtype=np.intp)
        self._kind = np.array(kind, dtype=np.intp)
        self._step = steps
        x, y, heading, *size = np.moveaxis(stacked, 2, 0)
        # Points and directions of the plane as complex numbers: one call where coordinates take two.
        centre = _complex(x, y)
        axis = _complex(np.cos(heading), np.sin(heading))
        # (3, samples * tracks): centre, and from there to two corners
        diagonal = _complex(*size)
        self._shapes = np.stack((centre, axis * diagonal, axis * diagonal.conj())).reshape(3, -1)
        self._axis, self._size = axis.ravel(), diagonal.ravel()
        radius = np.where(self._kind == _RECTANGLE, np.hypot(*size), size[0])
        self._round = bool((self._kind != _RECTANGLE).any())
        self._build_blocks(centre, radius + ego_radius)

    def _build_blocks(self, centre: Points, reach: Array) -> None:
        """A circle around each track over each block of samples, what the ego needs included."""
        size = self._block = 2 * self.substeps
        count = -(-self.n_samples // size)
        padded = np.full((3, count * size, len(self._kind)), np.nan)
        padded[:, : self.n_samples] = centre.real, centre.imag, reach
        x, y, padded_reach = padded.reshape(3, count, size, -1)
        # fmin and fmax pass over the samples at which an obstacle is not there
        middle = [0.5 * (np.fmin.reduce(v, axis=1) + np.fmax.reduce(v, axis=1)) for v in (x, y)]
        self._block_centre = _complex(*middle)
        away = np.hypot(x - middle[0][:, None], y - middle[1][:, None])
        self._block_reach = np.fmax.reduce(away + padded_reach, axis=1) + _SPARE

    def _interpolate(self, rows: Array) -> Array:
        """Rows (T, 5) at the samples (S, 5); NaN between a step and one where the obstacle is absent."""
        weight = (np.arange(self.n_samples) % self.substeps / self.substeps)[:, None]
        left, right = rows[self._before], rows[self._after]
        change = right - left
        change[:, 2] = (change[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
        return np.where(weight > 0.0, left + weight * change, left)

    def contact(self, x: Array, y: Array, orientation: Array, start: int = 0) -> Contact | None:
        """First contact of the ego's rectangle with an obstacle.

        Parameters
        ----------
        x, y, orientation : (K,) array
            Centre [m] and orientation [rad] of the ego, ``substeps`` samples per scenario step.
        start : int
            Sample number of the first of them, counted from the start of the scenario.

        Returns
        -------
        Contact or None
            ``from_behind``: the obstacle's centre lies behind the middle of the ego's rear half, and
            along the ego's axis it is the obstacle that closes in.

        Raises
        ------
        ValueError
            If the samples reach beyond the scenario or are not finite.
        """
        return self.contact_along(_complex(x, y), orientation, start)

    def contact_along(
        self, here: Points, orientation: Array, start: int = 0, step: float | None = None
    ) -> Contact | None:
        """As :meth:`contact`, of centres x + iy (K,); ``step`` [m] is the longest between two, if known."""
        found = self._first(here, orientation, start, step)
        if found is None:
            return None
        k, index = found
        axis = np.array([np.cos(orientation[k]), np.sin(orientation[k])])
        centre, velocity = self._motion(index, start + k)
        ego = np.zeros(2)
        if len(here) > 1:
            i = max(k - 1, 0)
            moved = here[i + 1] - here[i]
            ego = np.array([moved.real, moved.imag]) * self.substeps / self.dt
        offset = centre - (here[k].real, here[k].imag)
        behind = offset @ axis < -0.5 * self._half[0] and (velocity - ego) @ axis > 0.0
        return Contact((start + k) * self.dt / self.substeps, self._obstacles[index].id, bool(behind))

    def _motion(self, index: int, sample: int) -> tuple[Array, Array]:
        """Centre and velocity of an obstacle at a sample."""
        states = self._obstacles[index].states
        low, high = int(self._before[sample]), int(self._after[sample])
        weight = sample % self.substeps / self.substeps
        centre = (
            states[low, :2] if low == high else (1 - weight) * states[low, :2] + weight * states[high, :2]
        )
        first = min(low, len(states) - 2) if len(states) > 1 else 0
        velocity = np.zeros(2) if len(states) < 2 else (states[first + 1, :2] - states[first, :2]) / self.dt
        if not np.isfinite(velocity).all():
            heading, speed = states[low, 2:4]
            velocity = speed * np.array([np.cos(heading), np.sin(heading)])
        return centre, velocity

    def _first(
        self, here: Points, orientation: Array, start: int, step: float | None = None
    ) -> tuple[int, int] | None:
        """Sample (counted from ``start``) and obstacle index of the first collision."""
        stop = start + len(here)
        if start < 0 or stop > self.n_samples:
            raise ValueError(f"samples {start} to {stop} of a world of {self.n_samples}")
        # A sum of squares is cheaper than a look at each, and finite only if they are.
        parts = here.view(np.float64)
        if not math.isfinite(parts.dot(parts) + orientation.dot(orientation)) and not (
            np.isfinite(here).all() and np.isfinite(orientation).all()
        ):
            raise ValueError("the ego's poses are not finite")
        if step is None:
            step = float(np.abs(here[1:] - here[:-1]).max(initial=0.0))
        ego, row = self._near(here, start, step)
        if not len(ego):
            return None
        axis = np.exp(orientation.take(ego) * _CLOCKWISE)
        shapes = self._shapes.take(row, axis=1)
        shapes[0] -= here.take(ego)
        shapes *= axis
        size, around = self._size.take(row), shapes[0].copy() if self._round else None
        hit = _rectangles_touch(shapes, self._axis.take(row) * axis, self._diagonal, size)
        if around is not None:
            beyond = np.maximum(np.abs(around.view(np.float64).reshape(-1, 2)) - self._half, 0.0)
            round_hit = np.hypot(beyond[:, 0], beyond[:, 1]) <= size.real + _TOUCH
            hit = np.where(self._kind[row % len(self._kind)] == _RECTANGLE, hit, round_hit)
        if not np.count_nonzero(hit):
            return None
        hits = np.flatnonzero(hit)
        for i in hits[row[hits].argsort()].tolist():
            (k, m), at = divmod(int(row[i]), len(self._kind)), here[ego[i]]
            pose = (at.real, at.imag, axis[i].real, -axis[i].imag)
            if self._kind[m] != _POLYGON or self._polygons_touch(k, m, pose):
                return k - start, int(self._owner[m])
        return None

    def _near(self, here: Points, start: int, step: float) -> tuple[Index, Index]:
        """The ego's samples, and the shapes' rows there (n,), outside of which nothing touches; in no order.

        One look per block: within it no sample is farther than half a block from the one in its middle.
        """
        size, stop = self._block, start + len(here)
        blocks = slice(start // size, -(-stop // size))
        middle, samples, rows = _block_samples(start, stop, size, len(self._kind))
        away = np.abs(self._block_centre[blocks] - here.take(middle))
        away -= size // 2 * step
        block, track = (away <= self._block_reach[blocks]).nonzero()
        return samples.take(block, axis=0).ravel(), rows.take(block, axis=0).ravel() + track.repeat(size)

    def _polygons_touch(self, k: int, m: int, pose: tuple[float, float, float, float]) -> bool:
        """Whether the ego at ``x, y, cos, sin`` meets a polygon of a track at a sample."""
        polygons = self._obstacles[self._owner[m]].polygons[self._step[m][k]]
        return any(_polygon_touches(polygon, pose, self._half) for polygon in polygons)


_RECTANGLE, _CIRCLE, _POLYGON = range(3)


def _rows(obstacle: Obstacle) -> tuple[int, Array]:
    """What an obstacle is made of, and (T, 5) ``x, y, heading, half length, half width``.

    Circles, and the circumcircles of polygons, have their radius as half length.
    """
    if obstacle.rectangles is not None:
        return _RECTANGLE, np.asarray(obstacle.rectangles)
    rows = np.full((obstacle.n_steps + 1, 5), np.nan)
    if obstacle.circles is not None:
        rows[:, :2] = obstacle.circles[:, :2]
        rows[:, 3] = rows[:, 4] = obstacle.circles[:, 2]
        rows[:, 2] = 0.0
        return _CIRCLE, rows
    for step, polygons in enumerate(obstacle.polygons[: len(rows)]):
        if polygons:
            points = np.concatenate(polygons)
            centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
            radius = np.hypot(*(points - centre).T).max()
            rows[step] = (*centre, 0.0, radius, radius)
    return _POLYGON, rows


@lru_cache(maxsize=256)
def _block_samples(start: int, stop: int, size: int, tracks: int) -> tuple[Index, Index, Index]:
    """Of each block of ``size`` samples that meets [start, stop): its middle (n, 1), its samples (n, size).

    Counted from ``start`` on; the first and the last of [start, stop) stand for those outside. Also where
    the samples' rows of ``tracks`` shapes each begin.
    """
    samples = np.arange(start // size * size, -(-stop // size) * size).reshape(-1, size) - start
    samples = np.minimum(np.maximum(samples, 0), max(stop - start - 1, 0))
    made = samples[:, size // 2, None].copy(), samples, (samples + start) * tracks
    for indices in made:
        indices.setflags(write=False)
    return made


def _complex(x: Array, y: Array) -> Points:
    """Points (or directions) of the plane as x + iy."""
    made = np.empty(x.shape, dtype=np.complex128)
    made.real = x
    made.imag = y
    return made


def _rectangles_touch(shapes: Points, turn: Points, ego: Points, size: Points) -> npt.NDArray[np.bool_]:
    """Whether the ego and rectangles meet: separating axes.

    Parameters
    ----------
    shapes : (3, n) complex array
        Centres of the rectangles, and half diagonals of either direction, seen from the ego; overwritten.
    turn : (n,) complex array
        Their directions, seen from the ego.
    ego : () complex array
        Half length and, as imaginary part, half width of the ego.
    size : (n,) complex array
        The same of the rectangles.
    """
    hit = _reached(shapes, ego)
    if np.count_nonzero(hit):  # mostly one of the ego's own axes tells the two apart
        shapes[1], shapes[2] = ego, ego.conj()
        shapes *= turn.conj()
        hit &= _reached(shapes, size)
    return hit


def _reached(shapes: Points, half: Points) -> npt.NDArray[np.bool_]:
    """Whether rectangles (3, n), as in :func:`_rectangles_touch`, meet one that lies along the axes.

    Asked are these axes only; ``half`` (n,) or () holds that one's half length and half width.
    """
    offset, one, other = np.abs(shapes.view(np.float64))  # the real and the imaginary parts in turn
    reach = np.maximum(one, other)
    both = reach.view(np.complex128)
    both += half + _TOUCHING
    meets = offset <= reach
    reached: npt.NDArray[np.bool_] = meets[::2] & meets[1::2]
    return reached


def _polygon_touches(polygon: Array, pose: tuple[float, float, float, float], half: Array) -> bool:
    """Whether the ego at ``x, y, cos, sin`` meets a convex polygon (V, 2): separating axes."""
    x, y, cos, sin = pose
    points = (polygon - (x, y)) @ np.array([[cos, -sin], [sin, cos]])  # seen from the ego
    if (points.min(axis=0) > np.add(half, _TOUCH)).any() or (
        points.max(axis=0) < -np.add(half, _TOUCH)
    ).any():
        return False
    edges = np.roll(points, -1, axis=0) - points
    size = np.hypot(edges[:, 0], edges[:, 1])
    normals = np.column_stack((-edges[:, 1], edges[:, 0]))[size > 0] / size[size > 0, None]
    projected = points @ normals.T
    reach = np.abs(normals) @ np.asarray(half) + _TOUCH
    return bool(((projected.min(axis=0) <= reach) & (projected.max(axis=0) >= -reach)).all())
