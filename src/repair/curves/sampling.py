"""Curves at many times: one matrix for position and three derivatives, the ends held."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen
from repair.timegrid import INSTANT

__all__ = ["DENSE", "KEPT", "evaluated", "finer", "hold_ends"]


KEPT = 2000  #: times up to which the matrix that samples a curve at them is kept: less than 1 MB each
DENSE = 3000  #: times * points up to which a dense sampling matrix is faster than a sparse one


def hold_ends(times: bytes, t_start: float, t_end: float, values: Callable[[bytes], Array]) -> Array:
    """Matrix (n, 4 K) from control points to position and three derivatives at ``times``.

    Beyond the span the end speed is held, which is linear in the control points as well.

    Parameters
    ----------
    times : bytes
        Of a (K,) array [s].
    t_start, t_end : float
        The curve's span [s].
    values : callable
        The matrix for times (bytes) within the span, counted from its start.
    """
    since = np.frombuffer(times) - t_start
    tau = np.minimum(np.maximum(since, 0.0), t_end - t_start)
    # The same offsets come back for other start times, up to rounding.
    matrix = values(np.round(tau, 12).tobytes())
    beyond = since - tau
    out = np.flatnonzero(np.abs(beyond) > INSTANT)
    if not len(out):
        return matrix
    held = matrix.reshape(len(matrix), 4, len(tau)).copy()
    held[:, 0, out] += beyond[out] * held[:, 1, out]
    held[:, 2:, out] = 0.0
    return frozen(held.reshape(matrix.shape))


def evaluated(matrix: Any, points: Array) -> Array:
    """Position and three derivatives (4, K, d) of control points (n, d).

    Parameters
    ----------
    matrix : (n, 4 K) array or (4 K, n) sparse array
    """
    if isinstance(matrix, np.ndarray):  # by columns: two long products, and s and l lie in one piece each
        return np.asarray((points.T @ matrix).reshape(points.shape[1], 4, -1).transpose(1, 2, 0))
    return np.asarray((matrix @ points).reshape(4, -1, points.shape[1]))


def finer(times: Array, chosen: npt.NDArray[np.bool_], step: float) -> Array:
    """Times every so often in chosen ones of equal intervals, their ends included, each once.

    Parameters
    ----------
    times : (K,) array
        The intervals' ends [s].
    chosen : (K - 1,) bool array
    step : float
        How often at least [s], but for a rounding.
    """
    whole = float(times[1] - times[0])
    parts = max(1, round(whole / step))
    wanted = np.zeros((len(times) - 1) * parts + 1, dtype=np.bool_)
    wanted[chosen.nonzero()[0][:, None] * parts + np.arange(parts + 1)] = True
    before, part = np.divmod(wanted.nonzero()[0], parts)
    return np.asarray(times.take(before) + np.linspace(0.0, whole, parts + 1).take(part))
