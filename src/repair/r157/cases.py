"""The cases of UN Regulation No. 157 and the grids on which published results exist.

Source: UN Regulation No. 157 (automated lane keeping systems), Annex 4, Appendix 3; Annex 3 of the 01
series. The regulation names the parameters of each case and gives no ranges; the grids here are those of
published comparisons of driver models.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.errors import ConfigError

__all__ = ["CASES", "GRAVITY", "KMH", "LANE", "LENGTH", "WIDTH", "Flags", "Points", "grid"]

Flags = npt.NDArray[np.bool_]

CASES: Mapping[str, str] = MappingProxyType(
    {
        "cut_in_low": "cut-in, up to 60 km/h",
        "cut_in_high": "cut-in, 70 to 130 km/h",
        "cut_out": "cut-out",
        "deceleration": "deceleration",
    }
)
"""Name to words."""
KMH = 1.0 / 3.6
GRAVITY = 9.81  # [m/s²]
LANE = 3.5  # width of a lane [m]
LENGTH, WIDTH = 4.3, 1.9  # of every vehicle [m]


@dataclass(frozen=True)
class Points:
    """Points of a case: parameters as the regulation has them, one row each.

    Attributes
    ----------
    case : str
        One of :data:`CASES`.
    ego, other : (N,) array
        Speeds at the start [km/h]: Ve0, and Vo0 of who cuts in, cuts out or brakes.
    distance : (N,) array
        Cut-in: dx0, from the ego's front to the other's rear [m]. Cut-out: from the lead's front to the rear
        of who stands ahead of it [m]. Zero in the deceleration case, where the gap follows from the speed.
    lateral : (N,) array
        Lateral speed Vy [m/s]; zero in the deceleration case.
    deceleration : (N,) array
        Of the lead [g]; zero in the others.
    """

    case: str
    ego: Array
    other: Array
    distance: Array
    lateral: Array
    deceleration: Array

    def __len__(self) -> int:
        return len(self.ego)

    @property
    def columns(self) -> tuple[Array, ...]:
        """Speeds, distance, lateral speed and deceleration."""
        return self.ego, self.other, self.distance, self.lateral, self.deceleration

    @property
    def cut_in(self) -> bool:
        """Whether somebody comes from the lane beside."""
        return self.case.startswith("cut_in")

    def at(self, rows: npt.NDArray[Any]) -> Points:
        """Some of the rows, by index or mask."""
        return Points(self.case, *(np.atleast_1d(column[rows]) for column in self.columns))

    def words(self, row: int) -> str:
        """One point for people."""
        said = f"{self.case} {self.ego[row]:g}/{self.other[row]:g} km/h"
        if self.case == "deceleration":
            return f"{said}, {self.deceleration[row]:g} g"
        return f"{said}, {self.distance[row]:g} m, {self.lateral[row]:.1f} m/s"


def grid(case: str, stride: int = 1) -> Points:
    """The points of a case.

    Parameters
    ----------
    case : str
        One of :data:`CASES`.
    stride : int
        Every how many of the distances (of the decelerations in the deceleration case) is taken, from the
        first on; speeds and lateral speeds are all there.

    Raises
    ------
    ConfigError
        If there is no such case, or the stride is below 1.
    """
    if case not in CASES:
        raise ConfigError(f"there is no case {case!r}; there is {', '.join(CASES)}")
    if stride < 1:
        raise ConfigError(f"a stride is 1 or more, and not {stride}")
    if case == "deceleration":
        speeds = [(v, v) for v in range(12, 129, 2)]
        return _points(case, speeds, [0.0], [0.0], 0.05 * np.arange(1, 20, stride))
    if case == "cut_out":
        aside = 0.1 + 0.2 * np.arange(15)
        return _points(case, [(v, v) for v in range(10, 131, 10)], np.arange(2.0, 148.0, 5 * stride), aside)
    if case == "cut_in_low":
        pairs = [(v, u) for v in range(10, 61, 10) for u in range(10, v, 10)]
        ahead = np.arange(1.0, 60.0, stride)
    else:
        pairs = [(v, u) for v in (70, 90, 110, 130) for u in range(10, v, 30)]
        ahead = np.arange(1.0, 120.0, 2 * stride)
    return _points(case, pairs, ahead, 0.1 * np.arange(18))


def _points(
    case: str,
    pairs: list[tuple[int, int]],
    distance: Array | Sequence[float],
    lateral: Array | Sequence[float],
    deceleration: Array | Sequence[float] = (0.0,),
) -> Points:
    speeds = np.array(pairs, dtype=np.float64)
    which, far, aside, brake = (
        axis.ravel()
        for axis in np.meshgrid(np.arange(len(speeds)), distance, lateral, deceleration, indexing="ij")
    )
    return Points(case, speeds[which, 0], speeds[which, 1], far, aside, brake)
