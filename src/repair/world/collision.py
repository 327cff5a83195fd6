"""Collision of the ego's oriented rectangle with obstacles.

The edge of the road is for :mod:`repair.world.road`.

The verdicts are at least as strict as those of the drivability checker
(``commonroad_dc.feasibility.solution_checker``), which looks at scenario steps only. The tests are
the project's own (separating axes in numpy): they need no build and name obstacle and time at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, Points
from repair.world.touching import CLOCKWISE, TOUCH, polygon_touches, rectangles_touch
from repair.world.tracks import POLYGON, RECTANGLE, Index, as_complex, block_samples, shape_rows

if TYPE_CHECKING:
    from repair.scene.traffic.obstacle import Obstacle
    from repair.vehicle.parameters import Vehicle

__all__ = ["CollisionWorld", "Contact"]

# Coarse tests before the exact ones reach this much farther [m]: more than any rounding.
_SPARE = 1e-3


class Contact(NamedTuple):
    """First contact: time [s], the obstacle, and whether that obstacle strikes from behind."""

    time: float
    obstacle_id: int
    from_behind: bool


class CollisionWorld:
    """The obstacles over time, built once, asked many times.

    Rectangles and circles are interpolated between the scenario steps (centre, heading and size linear
    in time). Sets and polygons hold over the intervals on both sides of their step. Obstacles for which the
    drivability checker is late are tested both where they are and, at scenario steps, where it puts them.

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
    """

    def __init__(
        self,
        obstacles: Sequence[Obstacle],
        vehicle: Vehicle,
        dt: float,
        n_steps: int,
        substeps: int = 4,
    ) -> None:
        self.dt = dt
        self.substeps = substeps
        self.n_samples = n_steps * substeps + 1
        self._obstacles = tuple(obstacles)
        self._half = np.array((vehicle.half_length, vehicle.half_width))
        self._diagonal = np.array(complex(*self._half))  # an array for the reason that CLOCKWISE is one
        sample = np.arange(self.n_samples)
        self._before = sample // substeps
        self._after = -(-sample // substeps)
        self._build(vehicle.radius)

    def _build(self, ego_radius: float) -> None:
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
            what, rows = shape_rows(obstacle)
            if what == POLYGON or obstacle.role == "set_based":
                add(index, rows[self._before], what, self._before)
                add(index, rows[self._after], what, self._after)
            else:
                add(index, self._interpolate(rows), what, self._before)
            shift = obstacle.late
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
        centre = as_complex(x, y)
        axis = as_complex(np.cos(heading), np.sin(heading))
        # (3, samples * tracks): centre, and from there to two corners
        diagonal = as_complex(*size)
        self._shapes = np.stack((centre, axis * diagonal, axis * diagonal.conj())).reshape(3, -1)
        self._axis, self._size = axis.ravel(), diagonal.ravel()
        radius = np.where(self._kind == RECTANGLE, np.hypot(*size), size[0])
        self._round = bool((self._kind != RECTANGLE).any())
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
        self._block_centre = as_complex(*middle)
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
        return self.contact_along(as_complex(x, y), orientation, start)

    def contact_along(
        self, here: Points, orientation: Array, start: int = 0, step: float | None = None
    ) -> Contact | None:
        """As :meth:`contact`, of centres that are complex numbers already.

        Parameters
        ----------
        here : (K,) complex array
            Centres x + iy [m].
        orientation, start
            As in :meth:`contact`.
        step : float, optional
            The longest way from one sample to the next [m], if it is known.
        """
        found = self.first_contact(here, orientation, start, step)
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

    def first_contact(
        self,
        here: Points,
        orientation: Array,
        start: int = 0,
        step: float | None = None,
        *,
        all_pairs: bool = False,
    ) -> tuple[int, int] | None:
        """Which sample, counted from ``start``, is the first to touch an obstacle, and which obstacle it is.

        Parameters
        ----------
        here, orientation, start, step
            As in :meth:`contact_along`.
        all_pairs : bool
            Hold every sample against every shape, without the look at blocks of samples that mostly
            settles it. This is slow, and the definition of what the look at blocks must find.
        """
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
        ego, row = self._everything(len(here), start) if all_pairs else self._near(here, start, step)
        if not len(ego):
            return None
        axis = np.exp(orientation.take(ego) * CLOCKWISE)
        shapes = self._shapes.take(row, axis=1)
        shapes[0] -= here.take(ego)
        shapes *= axis
        size, around = self._size.take(row), shapes[0].copy() if self._round else None
        hit = rectangles_touch(shapes, self._axis.take(row) * axis, self._diagonal, size)
        if around is not None:
            beyond = np.maximum(np.abs(around.view(np.float64).reshape(-1, 2)) - self._half, 0.0)
            round_hit = np.hypot(beyond[:, 0], beyond[:, 1]) <= size.real + TOUCH
            hit = np.where(self._kind[row % len(self._kind)] == RECTANGLE, hit, round_hit)
        if not np.count_nonzero(hit):
            return None
        hits = np.flatnonzero(hit)
        for i in hits[row[hits].argsort()].tolist():
            (k, m), at = divmod(int(row[i]), len(self._kind)), here[ego[i]]
            pose = (at.real, at.imag, axis[i].real, -axis[i].imag)
            if self._kind[m] != POLYGON or self._polygons_touch(k, m, pose):
                return k - start, int(self._owner[m])
        return None

    def _near(self, here: Points, start: int, step: float) -> tuple[Index, Index]:
        """The ego's samples, and the shapes' rows there (n,), outside of which nothing touches; in no order.

        One look per block: within it no sample is farther than half a block from the one in its middle.
        """
        size, stop = self._block, start + len(here)
        blocks = slice(start // size, -(-stop // size))
        middle, samples, rows = block_samples(start, stop, size, len(self._kind))
        away = np.abs(self._block_centre[blocks] - here.take(middle))
        away -= size // 2 * step
        block, track = (away <= self._block_reach[blocks]).nonzero()
        return samples.take(block, axis=0).ravel(), rows.take(block, axis=0).ravel() + track.repeat(size)

    def _everything(self, count: int, start: int) -> tuple[Index, Index]:
        """As :meth:`_near`, nothing left out."""
        ego, track = np.indices((count, len(self._kind))).reshape(2, -1)
        return ego, (ego + start) * len(self._kind) + track

    def _polygons_touch(self, k: int, m: int, pose: tuple[float, float, float, float]) -> bool:
        """Whether the ego at ``x, y, cos, sin`` meets a polygon of a track at a sample."""
        polygons = self._obstacles[self._owner[m]].polygons[self._step[m][k]]
        return any(polygon_touches(polygon, pose, self._half) for polygon in polygons)
