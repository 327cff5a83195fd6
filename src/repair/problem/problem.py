"""One repair: follow until t_rep, evade until t_end, and the way past the obstacles to take."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.curves.base import Curve, FrenetTrajectory
from repair.problem.limits import Limits
from repair.problem.shapes import Shapes
from repair.scene.road.bounds import LateralBounds
from repair.world.boxes import Occupancy

__all__ = ["SIDE_AXIS", "SIDE_SIGN", "Afterwards", "Maneuver", "Passing", "RepairProblem", "Side"]


class Maneuver(str, Enum):
    """What a repaired trajectory does about the conflict, named as people would.

    Attributes
    ----------
    YIELD
        It stays behind who is in the way.
    GO_AHEAD
        It passes first.
    LEFT, RIGHT
        It goes around, on that side.
    """

    # That of Enum hashes the member's name, in Python, and differs from that of the equal string.
    __hash__ = str.__hash__

    YIELD = "yield"
    GO_AHEAD = "go_ahead"
    LEFT = "left"
    RIGHT = "right"


class Side(int, Enum):
    """On which side of an obstacle's box the ego stays."""

    BEHIND = 0
    AHEAD = 1
    LEFT = 2
    RIGHT = 3


#: The coordinate that each side is about, in the order of :class:`Side`: 0 for s, 1 for l.
SIDE_AXIS: npt.NDArray[np.intp] = np.array([0, 0, 1, 1])
#: The sign with which that coordinate grows away from the box: ahead and left lie beyond its upper corner,
#: behind and right before its lower one.
SIDE_SIGN: Array = np.array([-1.0, 1.0, 1.0, -1.0])
SIDE_AXIS.setflags(write=False)
SIDE_SIGN.setflags(write=False)


@dataclass(frozen=True)
class Passing:
    """One way past the obstacles: a coarse guide, and the side it takes of each.

    Attributes
    ----------
    maneuver : Maneuver
    guide : FrenetTrajectory
        The coarse trajectory that shows the way; an initial guess, not a result.
    sides : (N, K) int array, or callable
        What ``side`` is; or makes it, if it is asked for: many backends take the guide alone.
    cost : float
        The guide's cost; smaller is gentler.
    open : bool
        Whether the guide keeps clear of every box and within the limits; if not, it comes closest to that.
    misses : float
        By how much it is not: ten times how deep it gets into a box [m], and by what it is beyond the limits
        in bends [m/s²].
    """

    maneuver: Maneuver
    guide: FrenetTrajectory
    sides: npt.NDArray[np.int8] | Callable[[], npt.NDArray[np.int8]]
    cost: float
    open: bool = True
    misses: float = 0.0

    @cached_property
    def side(self) -> npt.NDArray[np.int8]:
        """:class:`Side` of every obstacle at each guide time (N, K); constant between guide times."""
        return self.sides() if callable(self.sides) else self.sides

    def side_at(self, times: npt.ArrayLike) -> npt.NDArray[np.int8]:
        """Side of every obstacle (N, K') at ``times``: that of the nearest guide time."""
        query = np.asarray(times, dtype=np.float64)
        grid = self.guide.t
        step = grid[1] - grid[0] if len(grid) > 1 else 1.0
        index = np.rint((query - grid[0]) / step).astype(np.intp)
        return np.asarray(self.side.take(index, axis=1, mode="clip"))


class Afterwards(Protocol):
    """What is about after a repair, for backends that can see to its end (``repair.terminal.room``)."""

    def within(self, problem: RepairProblem, curve: Curve) -> Array:
        """What bounds the state at the end so that it can be braked to a standstill from there."""
        ...


@dataclass(frozen=True)
class RepairProblem:
    """Everything a backend may know about one repair: follow until ``t_rep``, evade until ``t_end``.

    Attributes
    ----------
    reference : Curve
        The reference trajectory over [0, t_end].
    t_rep, t_end : float
        Time-to-repair and end of the repair [s].
    start : (3, 2) array
        Position, velocity and acceleration ``[s, l]`` of the reference at ``t_rep``.
    occupancy : Occupancy
        Obstacles (inflated), as far as they matter; the order is that of ``passing.side``.
    bounds : LateralBounds
        Lateral room of the reference point.
    limits : Limits
    clearance : float
        The paper's s_f [m], wanted beyond the inflated box by soft backends; hard backends use
        ``margin``.
    margin : float
        Extra distance [m] a hard backend keeps from the inflated box.
    passing : Passing or None
        The way past the obstacles to take; None where nothing is in the way.
    curvature_s, curvature : (M,) array
        Curvature of the frame's axis [1/m] over s, linear in between.
    dt : float
        The scenario's time step [s].
    half_length : float
        Half the length of the ego's body [m]; its position is that of the middle.
    lateral : bool
        Whether the backend may move sideways; if not, it stays on the path of the reference.
    strict : bool
        No part of the margin may be given up, whatever the checker says of the true rectangles.
    shapes : Shapes or None
        What the boxes stand for, in the plane; None where only the boxes are known.
    afterwards : Afterwards or None
        What is about after the repair; None where nobody asks how it ends.
    """

    reference: Curve
    t_rep: float
    t_end: float
    start: Array
    occupancy: Occupancy
    bounds: LateralBounds
    limits: Limits
    clearance: float
    margin: float
    passing: Passing | None
    curvature_s: Array
    curvature: Array
    dt: float
    half_length: float
    lateral: bool = True
    strict: bool = False
    shapes: Shapes | None = None
    afterwards: Afterwards | None = None

    def tightened(self, room: float, edge: float, unused: float) -> RepairProblem:
        """The same way past the obstacles, to be kept with more to spare.

        Parameters
        ----------
        room : float
            Added to margin and clearance [m].
        edge : float
            By which the road is narrowed on both sides [m].
        unused : float
            Share of every acceleration limit that is left unused.

        Returns
        -------
        RepairProblem
        """
        return replace(
            self,
            margin=self.margin + room,
            clearance=self.clearance + room,
            bounds=self.bounds.narrowed(edge) if edge and self.lateral else self.bounds,
            limits=self.limits.reserving(unused) if unused else self.limits,
        )

    def curvature_at(self, s: npt.ArrayLike) -> Array:
        """Curvature of the frame's axis [1/m] at ``s``."""
        return np.asarray(np.interp(np.asarray(s, dtype=np.float64), self.curvature_s, self.curvature))
