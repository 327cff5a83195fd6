"""Where every shape of the traffic is at every sample, ready to be compared with the ego's poses.

Each sample stands for the time half way to its neighbours. Columns are tracks: a shape of an obstacle each.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, Points, wrap
from repair.world.advance import Left, Motion, circle_left, polygons_left, rectangle_left
from repair.world.touching import CLOCKWISE, TOUCH, rectangles_touch
from repair.world.tracks import (
    AFTER,
    BEFORE,
    CIRCLE,
    INSTANT,
    MOVING,
    POLYGON,
    RECTANGLE,
    Index,
    Track,
    all_tracks,
    as_complex,
    block_samples,
)

if TYPE_CHECKING:
    from repair.scene.traffic.obstacle import Obstacle

__all__ = ["TrackTable"]

# Coarse tests before the exact ones reach this much farther [m]: more than any rounding.
_SPARE = 1e-3
_BLOCK = 8  # samples that are looked at together, at least


class TrackTable:
    """Every shape's pose, its size, and how far it moves half way to the next sample.

    Circles and polygons have the size of their circumcircle.

    Parameters
    ----------
    obstacles : sequence of Obstacle
        Arrays of a row for each scenario step.
    n_samples, substeps : int
        Samples in all, and to a scenario step.
    radius : float
        Of the ego's circumcircle [m].

    Attributes
    ----------
    tracks : list of Track
    owner : list of int
        Index of each track's obstacle.
    kind, mode : (M,) int array
        Of the tracks, as :mod:`repair.world.tracks` names them.
    shapes : (3, n_samples * M) complex array
        Centre, and from there to two corners [m].
    axis, size, heading : (n_samples * M,) array
        Direction (complex), half length and half width (complex) [m], and angle [rad].
    slack : (n_samples * M,) array
        How far any point of the shape moves half way to the next sample, or the one before [m].
    share : (M,) array
        How much of the ego's way to its neighbours a sample answers for.
    any_round : bool
        Not every shape is a rectangle.
    """

    def __init__(self, obstacles: Sequence[Obstacle], n_samples: int, substeps: int, radius: float) -> None:
        self.n_samples, self._block = n_samples, max(2 * substeps, _BLOCK)
        self.tracks: list[Track] = []
        self.owner: list[int] = []
        self._lefts: dict[tuple[int, int], tuple[Left, float]] = {}
        for index, track in all_tracks(obstacles, n_samples, substeps):
            self.tracks.append(track)
            self.owner.append(index)
        self._build(radius)

    def _build(self, own_radius: float) -> None:
        tracks = self.tracks
        stacked = np.stack([t.rows for t in tracks], axis=1) if tracks else np.empty((self.n_samples, 0, 5))
        self.kind = np.array([t.kind for t in tracks], dtype=np.intp)
        self.mode = np.array([t.mode for t in tracks], dtype=np.intp)
        self._instant = [t.mode == INSTANT for t in tracks]
        x, y, heading, *size = np.moveaxis(stacked, 2, 0)
        # Points and directions of the plane as complex numbers: one call where coordinates take two.
        centre = as_complex(x, y)
        axis = as_complex(np.cos(heading), np.sin(heading))
        diagonal = as_complex(*size)
        self.shapes = np.stack((centre, axis * diagonal, axis * diagonal.conj())).reshape(3, -1)
        self.axis, self.size, self.heading = axis.ravel(), diagonal.ravel(), heading.ravel()
        rectangle = self.kind == RECTANGLE
        self.any_round = bool((~rectangle).any())
        across = np.abs(diagonal)
        radius = np.where(rectangle, across, size[0]) if self.any_round else across
        turn = np.abs(np.diff(heading, axis=0))
        if (turn > np.pi).any():
            turn = np.abs(wrap(turn))
        turned = turn * (np.where(rectangle, across, 0.0) if self.any_round else across)[1:]
        grown = np.maximum(np.abs(np.diff(size[0], axis=0)), np.abs(np.diff(size[1], axis=0)))
        moved = np.nan_to_num(0.5 * (np.abs(np.diff(centre, axis=0)) + turned + grown))
        moved[:, self.mode != MOVING] = 0.0
        none = np.zeros((1, len(tracks)))
        slack = np.maximum(np.concatenate((none, moved)), np.concatenate((moved, none)))
        self.slack = slack.ravel()
        # How much of the ego's way to its neighbours a sample answers for; held shapes change at a step.
        self.share = np.array([1.0, 1.0, 1.0, 0.0])[self.mode] * np.where(self.mode == MOVING, 0.5, 1.0)
        self._held = self._holding()
        self._build_blocks(centre, radius + slack + own_radius)

    def _build_blocks(self, centre: Points, reach: Array) -> None:
        """A circle around each track over each block of samples, what the ego needs included."""
        size = self._block
        count = -(-self.n_samples // size)
        padded = np.full((3, count * size, len(self.kind)), np.nan)
        padded[:, : self.n_samples] = centre.real, centre.imag, reach
        x, y, padded_reach = padded.reshape(3, count, size, -1)
        # fmin and fmax pass over the samples at which an obstacle is not there
        middle = [0.5 * (np.fmin.reduce(v, axis=1) + np.fmax.reduce(v, axis=1)) for v in (x, y)]
        self._block_centre = as_complex(*middle)
        x, y = x - middle[0][:, None], y - middle[1][:, None]
        away = np.sqrt(x * x + y * y)  # hypot takes far longer
        self._block_reach = np.fmax.reduce(away + padded_reach, axis=1) + _SPARE

    def near(self, here: Points, start: int, step: float, margin: complex) -> tuple[Index, Index]:
        """The ego's samples, and the shapes' rows there (n,), outside of which nothing touches; in no order.

        One look per block: within it no sample, and nothing half way to the next one, is farther than half a
        block and a sample from the one in its middle.
        """
        size, stop = self._block, start + len(here)
        blocks = slice(start // size, -(-stop // size))
        middle, samples, rows = block_samples(start, stop, size, len(self.kind))
        away = np.abs(self._block_centre[blocks] - here.take(middle))
        away -= (size // 2 + 1) * step + abs(margin)
        block, track = (away <= self._block_reach[blocks]).nonzero()
        return samples.take(block, axis=0).ravel(), rows.take(block, axis=0).ravel() + track.repeat(size)

    def everything(self, count: int, start: int) -> tuple[Index, Index]:
        """As :meth:`near`, nothing left out."""
        ego, track = np.indices((count, len(self.kind))).reshape(2, -1)
        return ego, (ego + start) * len(self.kind) + track

    def unsettled(
        self, wide: Points, here: Points, orientation: Array, reach: Array | None, ego: Index, row: Index
    ) -> npt.NDArray[np.bool_]:
        """Which pairs of a sample and a shape may meet until half way to the samples around.

        Parameters
        ----------
        wide : () complex array
            Half the ego's length and width, with the margin [m].
        here, orientation : (K,) array
            Centres x + iy [m] and orientations [rad] of the ego.
        reach : (K,) array or None
            How far any point of the ego moves until the samples around [m]. None asks for those that meet at
            the sample itself; of polygons, their circumcircles.
        ego, row : (n,) int array
            The ego's samples, and the shapes' rows.
        """
        slack = np.zeros(len(row))
        if reach is not None:
            slack = reach.take(ego) * self.share.take(row % len(self.kind)) + self.slack.take(row)
        axis = np.exp(orientation.take(ego) * CLOCKWISE)
        shapes = self.shapes.take(row, axis=1)
        shapes[0] -= here.take(ego)
        shapes *= axis
        size, around = self.size.take(row), shapes[0].copy() if self.any_round else None
        hit = rectangles_touch(shapes, self.axis.take(row) * axis, wide, size, slack * (1 + 1j))
        if around is not None:
            beyond = np.abs(around.view(np.float64).reshape(-1, 2)) - (wide.real.item(), wide.imag.item())
            away = np.hypot(*np.maximum(beyond, 0.0).T)
            round_hit = away <= size.real + TOUCH + slack
            hit = np.where(self.kind[row % len(self.kind)] == RECTANGLE, hit, round_hit)
        return hit

    def intervals(self, ego: Index, row: Index, since: Index, last: int) -> list[tuple[int, int, int]]:
        """Pairs of a sample and a shape as the two intervals beside it, or as the instant that it is.

        An instant is there where no interval that ends there, or begins, holds the shape at it.

        Parameters
        ----------
        ego, row : (n,) array
        since : (M,) array
            For each track the first of the ego's samples that counts: nothing is looked at before it.
        last : int
            The last of them.

        Returns
        -------
        list of (first, after, track)
            The interval's samples, the same one twice for an instant; each once, in the order of time and,
            of those that begin together, of the tracks.
        """
        track = row % len(self.kind)
        begin = since.take(track)
        ends, begins = ego > begin, ego < last
        held = self._held.take(row, axis=1)
        alone = ~(ends & held[0] | begins & held[1])
        begins &= ego >= begin
        columns = (ego, track, ends, begins, alone)
        found: set[tuple[int, int, int]] = set()
        for k, m, ended, begun, only in zip(*(column.tolist() for column in columns), strict=True):
            if only:
                found.add((k, m, k))
            if self._instant[m]:
                continue
            if ended:
                found.add((k - 1, m, k))
            if begun:
                found.add((k, m, k + 1))
        return [(first, after, m) for first, m, after in sorted(found)]

    def _holding(self) -> npt.NDArray[np.bool_]:
        """Whether an interval that ends at a sample, or begins there, holds the shape there (2, rows)."""
        there = ~np.isnan(self.heading.reshape(self.n_samples, len(self.kind)))
        ends, begins = np.zeros((2, *there.shape), dtype=np.bool_)
        ends[1:], begins[:-1] = there[:-1], there[1:]
        moving = self.mode == MOVING
        ends, begins = ends & moving | (self.mode == AFTER), begins & moving | (self.mode == BEFORE)
        return np.array((ends, begins)).reshape(2, -1)

    def motion(
        self, first: int, after: int, track: int, start: int, unit: float, here: Points, orientation: Array,
        spare: Array,
    ) -> tuple[Motion, Left] | None:  # fmt: skip
        """How the ego and a shape move in one of :meth:`intervals`; None where the shape is not there."""
        mode, kind, count = self.tracks[track].mode, self.tracks[track].kind, len(self.tracks)
        row = ((after if mode == AFTER else first) + start) * count + track
        row_end = ((first if mode == BEFORE else after) + start) * count + track
        heading, heading_end = self.heading.item(row), self.heading.item(row_end)
        if math.isnan(heading + heading_end):
            return None
        left: Left = rectangle_left
        size = self.size.item(row)
        reach = max(abs(size), abs(self.size.item(row_end)))
        if kind == CIRCLE:
            left, reach = circle_left, 0.0
        elif kind == POLYGON:
            left, reach = self._polygons(track, self.tracks[track].steps.item(row // count))
        place = self.shapes.item(0, row) - here.item(first)
        begin, angle = (first + start) * unit, orientation.item(first)
        return Motion(
            begin, (after + start) * unit - begin,
            place, self.shapes.item(0, row_end) - here.item(after) - place,
            size, self.size.item(row_end) - size,
            angle, _wrapped(orientation.item(after) - angle),
            heading, _wrapped(heading_end - heading),
            reach, spare.item(first) if after > first else 0.0,
        ), left  # fmt: skip

    def _polygons(self, track: int, step: int) -> tuple[Left, float]:
        """What is left of the gap to polygons at a step, laid out once."""
        if (track, step) not in self._lefts:
            self._lefts[track, step] = polygons_left(self.tracks[track].polygons[step])
        return self._lefts[track, step]


def _wrapped(angle: float) -> float:
    """As :func:`repair.arrays.wrap`, of one number."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
