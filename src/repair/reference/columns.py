"""The columns of a reference from memory: read, looked at, and laid on the scenario's steps."""

from __future__ import annotations

from typing import Any

import numpy as np

from repair.arrays import Array
from repair.errors import ReferenceTrajectoryError, in_words, kind_of
from repair.timegrid import steps_until
from repair.vehicle.states import DrivenStates

__all__ = ["COLUMNS", "KEYS", "WHAT", "at_steps", "require_times", "table_of"]

COLUMNS = ("t", "x", "y", "yaw", "v")
KEYS = ("t_s", "x_m", "y_m", "yaw_rad", "v_mps")  # as result.json has them
_COARSEST = 0.5  # samples further apart than this, and than the scenario's step, say too little [s]
_GAP = 1.5  # so many times the usual distance in time are a gap
_SAME = 1e-6  # times that differ by less are the same [s]
_LEAST = 4  # samples
WHAT = "the given reference"


def table_of(thing: Any) -> Array:
    """Columns t, x, y, yaw, v (N, 5), NaN where yaw or v are not said."""
    if isinstance(thing, DrivenStates):
        thing = {"t": thing.t, "x": thing.x, "y": thing.y, "yaw": thing.orientation, "v": thing.speed}
    fields = getattr(getattr(thing, "dtype", None), "names", None)
    if fields:  # a structured array
        thing = {name: thing[name] for name in fields}
    if hasattr(thing, "keys") and hasattr(thing, "__getitem__"):
        names = [str(name) for name in thing.keys()]  # noqa: SIM118 - a table need not be a mapping
        if set(KEYS[:3]) <= set(names) <= set(KEYS):
            columns = {name: thing[key] for name, key in zip(COLUMNS, KEYS, strict=True) if key in names}
        else:
            if strange := [name for name in names if name not in COLUMNS]:
                raise ReferenceTrajectoryError(
                    f"{WHAT} has {in_words(strange[0])}; its columns are t, x, y and, if known, yaw and v"
                )
            columns = {name: thing[name] for name in names}
    else:
        values = _numbers(thing, "")
        if values.ndim != 2 or not 3 <= values.shape[1] <= len(COLUMNS):
            raise ReferenceTrajectoryError(
                f"{WHAT} is {_shape(thing, values)}; an array has a row for each sample and the columns "
                "t, x, y[, yaw[, v]]"
            )
        columns = dict(zip(COLUMNS, values.T, strict=False))
    if missing := [name for name in COLUMNS[:3] if name not in columns]:
        raise ReferenceTrajectoryError(f"{WHAT} has no column {missing[0]}; it needs t, x and y")
    read = {name: _numbers(values, f"column {name} of ") for name, values in columns.items()}
    count = len(np.atleast_1d(read["t"]))
    for name, values in read.items():
        if values.shape != (count,):
            raise ReferenceTrajectoryError(
                f"column {name} of {WHAT} has the shape {values.shape}, its times {read['t'].shape}"
            )
        if wrong := np.flatnonzero(~np.isfinite(values)).tolist():
            raise ReferenceTrajectoryError(f"{WHAT}: {name} of sample {wrong[0]} is not finite")
    table = np.full((count, len(COLUMNS)), np.nan)
    for name, values in read.items():
        table[:, COLUMNS.index(name)] = values
    return table


def _numbers(thing: Any, what: str) -> Array:
    """Floats, NaN where an array is masked."""
    try:
        made = np.asarray(thing)
        if made.dtype.kind in "cmM":  # NumPy would drop the imaginary part, or count a date's ticks
            raise TypeError(f"{made.dtype} is no real number")
        made = made.astype(np.float64)
        if np.ma.isMaskedArray(thing):
            made[np.ma.getmaskarray(thing)] = np.nan
        return made
    except (TypeError, ValueError) as error:
        raise ReferenceTrajectoryError(
            f"{what}{WHAT} cannot be read as numbers: {kind_of(thing)} ({in_words(error)}); a reference is "
            "an array t, x, y[, yaw[, v]], a mapping with these names, a CommonRoad trajectory, driven "
            "states, or a curve"
        ) from error


def _shape(thing: Any, values: Array) -> str:
    return f"of shape {values.shape}" if values.ndim else kind_of(thing)


def require_times(t: Array, dt: float) -> None:
    """Refuse times that do not begin with the planning problem, run back, or have a gap."""
    if len(t) < _LEAST:
        raise ReferenceTrajectoryError(f"{WHAT} has {len(t)} samples; a reference takes at least {_LEAST}")
    if abs(t[0]) > _SAME:
        raise ReferenceTrajectoryError(
            f"{WHAT} begins at t = {t[0]:g} s; its times count from the planning problem's start, which is 0"
        )
    steps = np.diff(t)
    if (steps <= 0.0).any():
        k = int(np.argmax(steps <= 0.0))
        raise ReferenceTrajectoryError(
            f"{WHAT}: after t = {t[k]:g} s its times do not go on (sample {k + 1} is at {t[k + 1]:g} s)"
        )
    usual, most = float(np.median(steps)), max(_COARSEST, dt)
    if usual > most + _SAME:
        raise ReferenceTrajectoryError(
            f"{WHAT} has mostly one sample every {usual:.3g} s; they may be at most {most:g} s apart"
        )
    wide = steps > min(_GAP * usual, most) + _SAME
    if wide.any():
        k = int(np.argmax(wide))
        raise ReferenceTrajectoryError(
            f"{WHAT} has a gap: from t = {t[k]:g} to {t[k + 1]:g} s there is no sample "
            f"(mostly one every {usual:.3g} s)"
        )


def at_steps(table: Array, dt: float) -> Array:
    """The samples at the scenario's steps, as they are or by a cubic spline through them."""
    t = table[:, 0]
    steps = np.arange(steps_until(float(t[-1]), dt) + 1) * dt
    if len(steps) < _LEAST:
        raise ReferenceTrajectoryError(
            f"{WHAT} ends at {t[-1]:g} s; it takes at least {_LEAST - 1} of the scenario's steps of {dt:g} s"
        )
    nearest = np.clip(np.searchsorted(t, steps - _SAME), 0, len(t) - 1)
    if (np.abs(t[nearest] - steps) <= _SAME).all():
        found = table[nearest].copy()
        found[:, 0] = steps
        return found
    from scipy.interpolate import CubicSpline

    at = np.minimum(steps, t[-1])
    found = np.full((len(steps), table.shape[1]), np.nan)
    found[:, 0], found[:, 1:3] = steps, CubicSpline(t, table[:, 1:3])(at)
    for k, values in ((3, np.unwrap(table[:, 3])), (4, table[:, 4])):
        found[:, k] = np.interp(at, t, values)
    return found
