"""Gaps of the map: what counts as road here and is in no section of it."""

from __future__ import annotations

from threading import Lock
from typing import Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array

__all__ = ["PREPARED", "SLIVER", "Gaps", "beyond"]

#: A prepared geometry must not be asked by two threads at once, and shapely lets other threads run.
PREPARED = Lock()
#: What is closed and smaller than this [m²] is rounding.
SLIVER = 1e-5


class Gaps:
    """The gaps of a map.

    Parameters
    ----------
    region : shapely geometry
        All of them; it is prepared.

    Attributes
    ----------
    bounds : (4, G) array
        ``x_min, y_min, x_max, y_max`` of each [m].
    """

    def __init__(self, region: Any) -> None:
        import shapely

        shapely.prepare(region)
        self.region = region
        self.bounds = np.ascontiguousarray(shapely.bounds(shapely.get_parts(region)).T)

    def near(self, x: Array, y: Array, reach: float) -> npt.NDArray[np.intp]:
        """Which places (K,) [m], by index, are within reach [m] of a gap's bounds; NaN is nowhere near."""
        left, low, right, high = self.bounds
        about = (left <= np.fmax.reduce(x) + reach) & (right >= np.fmin.reduce(x) - reach)
        about &= (low <= np.fmax.reduce(y) + reach) & (high >= np.fmin.reduce(y) - reach)
        if not np.count_nonzero(about):
            return np.asarray(about.nonzero()[0])
        left, low, right, high = self.bounds[:, about, None]
        met = (left - reach <= x) & (x <= right + reach) & (low - reach <= y) & (y <= high + reach)
        return np.asarray(np.logical_or.reduce(met, axis=0).nonzero()[0])

    def met(self, polygons: npt.NDArray[np.object_]) -> npt.NDArray[np.bool_]:
        """Which polygons meet one: safe among threads."""
        import shapely

        with PREPARED:
            return np.asarray(shapely.intersects(self.region, polygons))


def beyond(region: Any, sections: Any) -> Gaps | None:
    """What of a region is in no section; None where that is rounding."""
    import shapely

    parts = shapely.get_parts(shapely.difference(region, sections))
    parts = parts[shapely.area(parts) > SLIVER]
    return Gaps(shapely.union_all(parts)) if len(parts) else None
