"""Contact of the ego's oriented rectangle with obstacles, in continuous time.

The edge of the road is for :mod:`repair.world.road`.

Everything is tabulated at samples, and each sample stands for the time half way to its neighbours: who is
farther from the ego there than both can move until then has no contact. Nearly all pairs are settled by that
look; the others go to :mod:`repair.world.advance`, which misses nothing between the samples, whatever their
distance. The tests are the project's own: they need no build and name obstacle and time at once.

The drivability checker (``commonroad_dc.feasibility.solution_checker``) looks at scenario steps only, and
counts an occupancy that is stated for an interval of steps at one of them; here it counts at all of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, Points
from repair.world.advance import Motions, first_touch
from repair.world.polygons import first_polygon_touch
from repair.world.touching import CLOCKWISE, TOUCH, rectangles_touch
from repair.world.tracks import (
    AFTER,
    BEFORE,
    INSTANT,
    MOVING,
    POLYGON,
    RECTANGLE,
    Index,
    Track,
    as_complex,
    block_samples,
    tracks_of,
)

if TYPE_CHECKING:
    from repair.scene.traffic.obstacle import Obstacle
    from repair.vehicle.parameters import Vehicle

__all__ = ["CollisionWorld", "Contact"]

# Coarse tests before the exact ones reach this much farther [m]: more than any rounding.
_SPARE = 1e-3
# A straight line between two samples a time h apart is off by an eighth of h**2 times the acceleration, and
# that is at most twice what the second differences around the interval say.
_BULGE = 2.0 / 8.0


class Contact(NamedTuple):
    """First contact: time [s], the obstacle, and whether that obstacle strikes from behind."""

    time: float
    obstacle_id: int
    from_behind: bool


class _Hit(NamedTuple):
    """First contact: time [s], sample at or before it (counted from the first one), and obstacle index."""

    time: float
    sample: int
    obstacle: int


class CollisionWorld:
    """The obstacles over time, built once, asked many times.

    Rectangles, circles and rigid polygons move and turn linearly in time between the scenario steps. Sets
    hold over the intervals on both sides of their step: their union is what is stated there. Obstacles for
    which the drivability checker is late are tested both where they are and, at scenario steps, where it
    puts them.

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
        Samples per scenario step at which the ego is given. More of them follow a curve more closely; nothing
        between them is missed.
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
        self._half, self._radius = complex(vehicle.half_length, vehicle.half_width), vehicle.radius
        self._diagonal = np.array(self._half)  # an array for the reason that CLOCKWISE is one
        self._sides = np.array((vehicle.half_length, vehicle.half_width))
        self._tracks: list[Track] = []
        self._owner: list[int] = []
        for index, obstacle in enumerate(self._obstacles):
            for track in tracks_of(obstacle, self.n_samples, substeps):
                self._tracks.append(track)
                self._owner.append(index)
        self._build()

    def _build(self) -> None:
        """Tabulate every shape's pose, its reach, and how far it moves half way to the next sample.

        Columns are tracks. Circles and polygons have the size of their circumcircle.
        """
        tracks = self._tracks
        stacked = np.stack([t.rows for t in tracks], axis=1) if tracks else np.empty((self.n_samples, 0, 5))
        self._kind = np.array([t.kind for t in tracks], dtype=np.intp)
        self._mode = np.array([t.mode for t in tracks], dtype=np.intp)
        x, y, heading, *size = np.moveaxis(stacked, 2, 0)
        # Points and directions of the plane as complex numbers: one call where coordinates take two.
        centre = as_complex(x, y)
        axis = as_complex(np.cos(heading), np.sin(heading))
        # (3, samples * tracks): centre, and from there to two corners
        diagonal = as_complex(*size)
        self._shapes = np.stack((centre, axis * diagonal, axis * diagonal.conj())).reshape(3, -1)
        self._axis, self._size, self._heading = axis.ravel(), diagonal.ravel(), heading.ravel()
        rectangle = self._kind == RECTANGLE
        radius = np.where(rectangle, np.hypot(*size), size[0])
        self._round = bool((~rectangle).any())
        turned = np.abs(_wrapped(np.diff(heading, axis=0))) * np.where(rectangle, np.hypot(*size), 0.0)[1:]
        grown = np.maximum(np.abs(np.diff(size[0], axis=0)), np.abs(np.diff(size[1], axis=0)))
        moved = np.nan_to_num(0.5 * (np.abs(np.diff(centre, axis=0)) + turned + grown))
        moved[:, self._mode != MOVING] = 0.0
        none = np.zeros((1, len(tracks)))
        slack = np.maximum(np.concatenate((none, moved)), np.concatenate((moved, none)))
        self._slack = slack.ravel()
        # How much of the ego's way to its neighbours a sample answers for; held shapes change at a step.
        self._share = np.array([1.0, 1.0, 1.0, 0.0])[self._mode] * np.where(self._mode == MOVING, 0.5, 1.0)
        self._build_blocks(centre, radius + slack + self._radius)

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
            Its time is at most a millisecond early. ``from_behind``: the obstacle's centre lies behind the
            middle of the ego's rear half, and along the ego's axis it is the obstacle that closes in.

        Raises
        ------
        ValueError
            If the samples reach beyond the scenario or are not finite.
        """
        return self.contact_along(as_complex(x, y), orientation, start)

    def contact_along(
        self,
        here: Points,
        orientation: Array,
        start: int = 0,
        step: float | None = None,
        *,
        all_pairs: bool = False,
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
        all_pairs : bool
            Hold everything against everything, without the looks that mostly settle it. This is slow, and the
            definition of what those looks must find.
        """
        found = self._first(here, orientation, start, step, all_pairs)
        if found is None:
            return None
        k = found.sample
        axis = np.array([np.cos(orientation[k]), np.sin(orientation[k])])
        centre, velocity = self._motion(found.obstacle, found.time)
        ego = np.zeros(2)
        if len(here) > 1:
            i = max(k - 1, 0)
            moved = here[i + 1] - here[i]
            ego = np.array([moved.real, moved.imag]) * self.substeps / self.dt
        offset = centre - (here[k].real, here[k].imag)
        behind = offset @ axis < -0.5 * self._sides[0] and (velocity - ego) @ axis > 0.0
        return Contact(found.time, self._obstacles[found.obstacle].id, bool(behind))

    def _motion(self, index: int, time: float) -> tuple[Array, Array]:
        """Centre and velocity of an obstacle at a time."""
        states = self._obstacles[index].states
        place = min(time / self.dt, len(states) - 1)
        low = int(place + 1e-9)
        high = min(low + 1, len(states) - 1)
        weight = place - low
        centre = (
            states[low, :2] if weight < 1e-9 else (1 - weight) * states[low, :2] + weight * states[high, :2]
        )
        first = min(low, len(states) - 2) if len(states) > 1 else 0
        velocity = np.zeros(2) if len(states) < 2 else (states[first + 1, :2] - states[first, :2]) / self.dt
        if not np.isfinite(velocity).all():
            heading, speed = states[low, 2:4]
            velocity = speed * np.array([np.cos(heading), np.sin(heading)])
        return centre, velocity

    def _first(
        self, here: Points, orientation: Array, start: int, step: float | None, all_pairs: bool
    ) -> _Hit | None:
        stop = start + len(here)
        if start < 0 or stop > self.n_samples:
            raise ValueError(f"samples {start} to {stop} of a world of {self.n_samples}")
        # A sum of squares is cheaper than a look at each, and finite only if they are.
        parts = here.view(np.float64)
        if not math.isfinite(parts.dot(parts) + orientation.dot(orientation)) and not (
            np.isfinite(here).all() and np.isfinite(orientation).all()
        ):
            raise ValueError("the ego's poses are not finite")
        ways = np.abs(here[1:] - here[:-1])
        if step is None:
            step = float(ways.max(initial=0.0))
        ego, row = self._everything(len(here), start) if all_pairs else self._near(here, start, step)
        if not len(ego):
            return None
        spare = _bulges(here, orientation, self._radius)
        if not all_pairs:
            chosen = self._unsettled(here, orientation, ways, spare, ego, row)
            if not np.count_nonzero(chosen):
                return None
            ego, row = ego[chosen], row[chosen]
        return self._closely(here, orientation, start, spare, ego, row)

    def _unsettled(
        self, here: Points, orientation: Array, ways: Array, spare: Array, ego: Index, row: Index
    ) -> npt.NDArray[np.bool_]:
        """Which pairs of a sample and a shape may meet until half way to the samples around."""
        ways = ways + self._radius * np.abs(_wrapped(np.diff(orientation))) + spare
        reach = np.zeros(len(here))
        reach[:-1] = ways
        np.maximum(reach[1:], ways, out=reach[1:])
        slack = reach.take(ego) * self._share.take(row % len(self._kind)) + self._slack.take(row)
        axis = np.exp(orientation.take(ego) * CLOCKWISE)
        shapes = self._shapes.take(row, axis=1)
        shapes[0] -= here.take(ego)
        shapes *= axis
        size, around = self._size.take(row), shapes[0].copy() if self._round else None
        hit = rectangles_touch(shapes, self._axis.take(row) * axis, self._diagonal, size, slack * (1 + 1j))
        if around is not None:
            beyond = np.maximum(np.abs(around.view(np.float64).reshape(-1, 2)) - self._sides, 0.0)
            round_hit = np.hypot(beyond[:, 0], beyond[:, 1]) <= size.real + TOUCH + slack
            hit = np.where(self._kind[row % len(self._kind)] == RECTANGLE, hit, round_hit)
        return hit

    def _closely(
        self, here: Points, orientation: Array, start: int, spare: Array, ego: Index, row: Index
    ) -> _Hit | None:
        """First contact of pairs of samples and shapes, until the samples around, by advancement."""
        count, last = len(self._kind), len(here) - 1
        m = row % count
        # Each pair as the two intervals beside it, and as the instant that it is.
        first = np.concatenate((np.maximum(ego - 1, 0), ego, ego))
        after = np.concatenate((ego, np.minimum(ego + 1, last), ego))
        track = np.concatenate((m, m, m))
        kept = (self._mode[track] != INSTANT) | (first == after)
        known = np.unique((first * (last + 1) + after)[kept] * count + track[kept])
        place, track = np.divmod(known, count)
        first, after = np.divmod(place, last + 1)
        mode = self._mode[track]
        begin = np.where(mode == AFTER, after, first)
        end = np.where(mode == BEFORE, first, after)
        rows, rows_end = (begin + start) * count + track, (end + start) * count + track
        there = np.isfinite(self._heading[rows]) & np.isfinite(self._heading[rows_end])
        if not there.any():
            return None
        first, after, track, rows, rows_end = (x[there] for x in (first, after, track, rows, rows_end))
        times = (np.arange(len(here)) + start) * (self.dt / self.substeps)
        off = np.where(after > first, np.append(spare, 0.0)[first], 0.0)
        pairs = Motions(
            times[first], times[after], here[first], here[after], orientation[first],
            orientation[first] + _wrapped(orientation[after] - orientation[first]),
            self._shapes[0, rows], self._shapes[0, rows_end], self._heading[rows],
            self._heading[rows] + _wrapped(self._heading[rows_end] - self._heading[rows]),
            self._size[rows], self._size[rows_end], self._kind[track] != RECTANGLE, off,
        )  # fmt: skip
        polygon = self._kind[track] == POLYGON
        found: list[_Hit] = []
        plain = np.flatnonzero(~polygon)
        touch = first_touch(pairs.take(plain), self._half)
        if touch is not None:
            i = plain[touch[1]]
            found.append(_Hit(touch[0], int(first[i]), self._owner[track[i]]))
        for i in np.flatnonzero(polygon).tolist():
            made = self._tracks[track[i]]
            sample = start + int(after[i] if made.mode == AFTER else first[i])
            time = first_polygon_touch(pairs, i, made.polygons[int(made.steps[sample])], self._half)
            if time is not None:
                found.append(_Hit(time, int(first[i]), self._owner[track[i]]))
        return min(found, default=None)

    def _near(self, here: Points, start: int, step: float) -> tuple[Index, Index]:
        """The ego's samples, and the shapes' rows there (n,), outside of which nothing touches; in no order.

        One look per block: within it no sample, and nothing half way to the next one, is farther than half a
        block and a sample from the one in its middle.
        """
        size, stop = self._block, start + len(here)
        blocks = slice(start // size, -(-stop // size))
        middle, samples, rows = block_samples(start, stop, size, len(self._kind))
        away = np.abs(self._block_centre[blocks] - here.take(middle))
        away -= (size // 2 + 1) * step
        block, track = (away <= self._block_reach[blocks]).nonzero()
        return samples.take(block, axis=0).ravel(), rows.take(block, axis=0).ravel() + track.repeat(size)

    def _everything(self, count: int, start: int) -> tuple[Index, Index]:
        """As :meth:`_near`, nothing left out."""
        ego, track = np.indices((count, len(self._kind))).reshape(2, -1)
        return ego, (ego + start) * len(self._kind) + track


def _wrapped(angle: Array) -> Array:
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def _bulges(here: Points, orientation: Array, radius: float) -> Array:
    """By how much the ego may be off the straight way between its samples (K - 1,) [m], turning included."""
    bend = np.zeros(len(here))
    if len(here) > 2:
        bend[1:-1] = np.abs(here[2:] - 2.0 * here[1:-1] + here[:-2])
        bend[1:-1] += radius * np.abs(np.diff(_wrapped(np.diff(orientation))))
        bend[0], bend[-1] = bend[1], bend[-2]
    return np.asarray(_BULGE * np.maximum(bend[1:], bend[:-1]))
