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
from repair.deadline import in_time
from repair.timegrid import INSTANT
from repair.world.advance import first_touch
from repair.world.contact import Contact, told
from repair.world.table import TrackTable
from repair.world.tracks import POLYGON, Index, as_complex, ego_room

if TYPE_CHECKING:
    from repair.scene.traffic.obstacle import Obstacle
    from repair.vehicle.parameters import Vehicle

__all__ = ["CollisionWorld"]

_FEW = 4  # pairs, of which the exact answer costs no more than the look that mostly settles them


class _Hit(NamedTuple):
    """First contact: time [s], sample at or before it (counted from the first one), and obstacle index."""

    time: float
    sample: int
    obstacle: int


class _Asked(NamedTuple):
    """What is asked about: margin (along and across), obstacles beside the ego, from when on, and how."""

    margin: complex
    beside: frozenset[int]
    since: int
    all_pairs: bool


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
        self._table = TrackTable(self._obstacles, self.n_samples, substeps, self._radius)

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
        margin: float = 0.0,
        beside: frozenset[int] = frozenset(),
        since: int = 0,
        all_pairs: bool = False,
    ) -> Contact | None:
        """As :meth:`contact`, of centres that are complex numbers already, and with a safety margin.

        Parameters
        ----------
        here : (K,) complex array
            Centres x + iy [m].
        orientation, start
            As in :meth:`contact`.
        step : float, optional
            The longest way from one sample to the next [m], if it is known.
        margin : float
            By how much the ego's rectangle is enlarged on every side [m].
        beside : frozenset of int
            Obstacles, by index, that do not count until the enlarged ego has been clear of them.
        since : int
            Sample, counted from the first one, from which on contacts count.
        all_pairs : bool
            Hold everything against everything, without the looks that mostly settle it. This is slow, and the
            definition of what those looks must find.
        """
        asked = _Asked(margin * (1 + 1j), beside, since, all_pairs)
        found = self._first(here, orientation, start, step, asked)
        return None if found is None else self._told(found, here, orientation)

    def met_along(
        self,
        here: Points,
        orientation: Array,
        start: int,
        step: float,
        *,
        margin: float,
        beside: frozenset[int] = frozenset(),
        since: int = 0,
        fully: bool = True,
    ) -> tuple[Contact | None, Contact | None]:
        """First contact of the ego enlarged by a margin, and that of the ego itself.

        Parameters
        ----------
        here, orientation, start, step, margin, beside, since
            As in :meth:`contact_along`. ``beside`` and ``since`` are for the enlarged ego alone.
        fully : bool
            Also look for a contact that comes after that of the enlarged ego.

        Returns
        -------
        near, contact : Contact or None
            What :meth:`contact_along` says of either; who is far from the one is so from the other.
        """
        self._require(here, orientation, start)
        asked = _Asked(margin * (1 + 1j), beside, since, False)
        ego, row = self._table.near(here, start, step, asked.margin)
        if not len(ego):
            return None, None
        spare, reach = ego_room(here, orientation, self._radius)
        ego, row = self._open(here, orientation, reach, ego, row, asked.margin)
        counting = self._counting(here, orientation, start, asked)
        begin = counting[row % len(self._table.kind)]
        counted = ego >= begin
        near = self._closely(
            here, orientation, start, spare, ego[counted], row[counted], asked.margin, counting
        )
        # Who does not enter the margin where it counts, or not yet, touches nothing there.
        early, until = ego <= begin, math.inf
        if near is not None and not fully:
            early |= (ego >= near.sample) & (ego <= near.sample + 1)
            until = near.time + INSTANT
        elif near is not None:
            early |= ego >= near.sample
        ego, row = ego[early], row[early]
        contact = None
        if len(ego):
            if len(ego) > _FEW:
                ego, row = self._open(here, orientation, reach, ego, row, 0j)
            from_first = np.zeros_like(counting)
            contact = self._closely(here, orientation, start, spare, ego, row, 0j, from_first, until)
        return (
            None if near is None else self._told(near, here, orientation),
            None if contact is None else self._told(contact, here, orientation),
        )

    def _told(self, found: _Hit, here: Points, orientation: Array) -> Contact:
        """A contact with what is to be said of it."""
        k, one = found.sample, self._obstacles[found.obstacle]
        i = max(k - 1, 0)
        ego = (here.item(i + 1) - here.item(i)) * self.substeps / self.dt if len(here) > 1 else 0j
        pose = here.item(k), orientation.item(k)
        return told(found.time, one, self.dt, pose, ego, self._half.real)

    def _first(
        self, here: Points, orientation: Array, start: int, step: float | None, asked: _Asked
    ) -> _Hit | None:
        self._require(here, orientation, start)
        if step is None:
            step = float(np.abs(here[1:] - here[:-1]).max(initial=0.0))
        if asked.all_pairs:
            ego, row = self._table.everything(len(here), start)
        else:
            ego, row = self._table.near(here, start, step, asked.margin)
        counting = self._counting(here, orientation, start, asked)
        if asked.since or asked.beside:
            counted = ego >= counting[row % len(self._table.kind)]
            ego, row = ego[counted], row[counted]
        if not len(ego):
            return None
        spare, reach = ego_room(here, orientation, self._radius)
        if not asked.all_pairs:
            ego, row = self._open(here, orientation, reach, ego, row, asked.margin)
        return self._closely(here, orientation, start, spare, ego, row, asked.margin, counting)

    def _require(self, here: Points, orientation: Array, start: int) -> None:
        """Poses within the scenario, and finite ones."""
        stop = start + len(here)
        if start < 0 or stop > self.n_samples:
            raise ValueError(f"samples {start} to {stop} of a world of {self.n_samples}")
        # A sum of squares is cheaper than a look at each, and finite only if they are.
        parts = here.view(np.float64)
        if not math.isfinite(parts.dot(parts) + orientation.dot(orientation)) and not (
            np.isfinite(here).all() and np.isfinite(orientation).all()
        ):
            raise ValueError("the ego's poses are not finite")

    def _open(
        self, here: Points, orientation: Array, reach: Array, ego: Index, row: Index, margin: complex
    ) -> tuple[Index, Index]:
        """The pairs that :meth:`_unsettled` leaves open."""
        chosen = self._unsettled(here, orientation, reach, ego, row, margin)
        return ego[chosen], row[chosen]

    def _counting(self, here: Points, orientation: Array, start: int, asked: _Asked) -> Index:
        """Sample from which on each track counts: when the ego has been clear of those that it is beside."""
        since = np.full(len(self._table.kind), asked.since, dtype=np.intp)
        if not asked.beside:
            return since
        for m in (m for m, owner in enumerate(self._table.owner) if owner in asked.beside):
            ego = np.arange(len(here))
            row = (ego + start) * len(self._table.kind) + m
            still = np.zeros(len(here), dtype=np.bool_)
            still[:] = self._unsettled(here, orientation, None, ego, row, asked.margin)
            left = np.flatnonzero(~still)
            since[m] = max(asked.since, int(left[0]) if len(left) else len(here))
        return since

    def met_at(self, sample: int, centre: complex, orientation: float, margin: float) -> frozenset[int]:
        """Obstacles, by index, that the ego enlarged by a margin [m] meets at a sample."""
        here, turn = np.array([centre]), np.array([orientation])
        tracks = np.arange(len(self._table.kind))
        row = sample * len(self._table.kind) + tracks
        none, ego = np.zeros(1), np.zeros(len(tracks), dtype=np.intp)
        wide = margin * (1 + 1j)
        near = self._unsettled(here, turn, None, ego, row, wide)
        since = np.zeros_like(tracks)
        return frozenset(
            self._table.owner[m]
            for m in np.flatnonzero(near).tolist()
            if self._table.kind[m] != POLYGON
            or self._closely(here, turn, sample, none, ego[:1], row[m : m + 1], wide, since) is not None
        )

    def meets(
        self, sample: Index, here: Points, orientation: Array, margin: complex
    ) -> npt.NDArray[np.bool_]:
        """Which of the shapes (M,) each pose (P,) meets at a sample of its own; polygons are left out.

        Parameters
        ----------
        sample : (P,) int array
            Counted from the start of the scenario.
        here, orientation : (P,) array
            Centres x + iy [m], and angles [rad].
        margin : complex
            By how much the ego's rectangle is enlarged along and across [m]; negative makes it smaller.
        """
        table, count = self._table, len(self._table.kind)
        row = sample[:, None] * count + np.arange(count)
        apart = np.abs(table.shapes[0].take(row) - here[:, None])
        ego, track = (apart <= self._radius + np.abs(table.size.take(row))).nonzero()
        met = np.zeros(apart.shape, dtype=np.bool_)
        row = row[ego, track]
        met[ego, track] = self._unsettled(here, orientation, None, ego, row, margin)
        met[:, self._table.kind == POLYGON] = False  # of which this knows the circles around them alone
        return met

    def owner(self, shape: int) -> Obstacle:
        """Whose shape it is."""
        return self._obstacles[self._table.owner[shape]]

    def _unsettled(
        self, here: Points, orientation: Array, reach: Array | None, ego: Index, row: Index, margin: complex
    ) -> npt.NDArray[np.bool_]:
        """As :meth:`repair.world.table.TrackTable.unsettled`."""
        return self._table.unsettled(self._diagonal + margin, here, orientation, reach, ego, row)

    def _closely(
        self, here: Points, orientation: Array, start: int, spare: Array, ego: Index, row: Index,
        margin: complex, since: Index, until: float = math.inf,
    ) -> _Hit | None:  # fmt: skip
        """First contact before a time of pairs of samples and shapes, until the samples around."""
        half, unit, table = self._half + margin, self.dt / self.substeps, self._table
        best: _Hit | None = None
        if not len(ego):
            return None
        for first, after, track in table.intervals(ego, row, since, len(here) - 1):
            if (first + start) * unit >= until:  # the others begin later
                break
            in_time()
            pair = table.motion(first, after, track, start, unit, here, orientation, spare)
            time = None if pair is None else first_touch(pair[0], half, pair[1], until)
            if time is not None:
                until, best = time, _Hit(time, first, table.owner[track])
        return best
