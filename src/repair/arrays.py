"""Arrays of numbers: their types, read-only copies, extremes, and plain numbers for files."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    pass

__all__ = [
    "HUGE",
    "Array",
    "Points",
    "column",
    "frozen",
    "in_seconds",
    "largest",
    "names",
    "number",
    "smallest",
    "wrap",
]

#: Floating point; made as float64 throughout (NumPy types many results as some floating dtype only).
Array = npt.NDArray[np.floating[Any]]
#: Points, or directions, of the plane as complex numbers x + iy: one call where coordinates take two.
Points = npt.NDArray[np.complexfloating[Any, Any]]


def frozen(values: npt.ArrayLike) -> Array:
    """Copy ``values`` into a read-only float64 array."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def names(values: Iterable[int]) -> npt.NDArray[Any]:
    """Ids (N,) as an array: 64-bit integers, or Python's own where one does not fit (they have no end)."""
    listed = [int(value) for value in values]
    fit = all(-(2**63) <= value < 2**63 for value in listed)
    return np.array(listed, dtype=np.int64 if fit else object)


def largest(values: Array) -> float:
    """Largest of at least one number; NaN if one of them is."""
    return float(values.item(values.argmax()))


def smallest(values: Array) -> float:
    """Smallest of at least one number; NaN if one of them is."""
    return float(values.item(values.argmin()))


def wrap(angle: Any) -> Any:
    """Angle(s) in [-pi, pi)."""
    return (np.asarray(angle) + np.pi) % (2.0 * np.pi) - np.pi


#: No figure of a result is as large.
HUGE = 1e15


def number(value: float | None, digits: int = 9) -> float | None:
    """A plain float, or None where it is not finite or, of a solver that diverged, means nothing.

    Nine digits: 2.9, not 2.9000000000000004.
    """
    if value is None or not abs(value) < HUGE:
        return None
    return round(float(value), digits) + 0.0


def in_seconds(value: float | None) -> str:
    """A time for one line of words: ``2.4 s``, ``unlimited``, ``none``."""
    return "none" if value is None else f"{value:.4g} s" if math.isfinite(value) else "unlimited"


def column(values: Any, digits: int = 9) -> list[float | None]:
    """Finite plain floats, None for each that is not."""
    array = np.asarray(values, dtype=np.float64)
    # Whole numbers so small are exact, and divided they are what is nearest to the decimal.
    if array.size and np.abs(array).max() < 2.0**50 / 10.0**digits:
        plain: list[float | None] = (np.round(array, digits) + 0.0).tolist()
        return plain
    return [round(v, digits) + 0.0 if math.isfinite(v) else None for v in array.tolist()]
