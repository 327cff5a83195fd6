"""References from memory: arrays, mappings, CommonRoad trajectories, driven states, curves.

A planner hands its trajectory over as it has it; it is taken as it is or not at all. Times count from the
planning problem's start. What stands between the scenario's steps is looked at as well, and not used.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.arrays import Array, column
from repair.curves.base import Curve
from repair.curves.codec import curve_to_dict, read_curve
from repair.errors import ReferenceTrajectoryError, foreign, in_words, kind_of
from repair.reference.consistency import (
    START_OFF,
    START_SPEED_OFF,
    Recording,
    require_consistent,
    require_start,
)
from repair.reference.fit import fit_positions
from repair.reference.recorded import states_of
from repair.timegrid import steps_until
from repair.vehicle.states import DrivenStates

if TYPE_CHECKING:
    from repair.reference.settings import ReferenceConfig
    from repair.scene.scene import Scene
    from repair.vehicle.parameters import Vehicle
    from repair.world.boxes import Occupancy

__all__ = ["GivenReference", "given_reference", "no_given_reference"]

_COLUMNS = ("t", "x", "y", "yaw", "v")
_KEYS = ("t_s", "x_m", "y_m", "yaw_rad", "v_mps")  # as result.json has them
_COARSEST = 0.5  # samples further apart than this, and than the scenario's step, say too little [s]
_GAP = 1.5  # so many times the usual distance in time are a gap
_SAME = 1e-6  # times that differ by less are the same [s]
_LEAST = 4  # samples
_WHAT = "the given reference"


@dataclass(frozen=True)
class GivenReference:
    """A reference from memory, looked at and ready to be laid into the frame.

    Attributes
    ----------
    recording : Recording or None
        At the scenario's steps; None for a curve.
    path : Curve or None
        In the scene's own frame.
    plain : dict
        As ``result.json`` holds it; :func:`given_reference` reads it again.
    """

    recording: Recording | None
    path: Curve | None
    plain: dict[str, Any]

    @property
    def positions(self) -> Array | None:
        """Positions (K, 2) along which the frame has to run [m]; None where it stays as it is."""
        return None if self.recording is None else self.recording.positions

    def curve(self, scene: Scene) -> Curve:
        """The reference in the scene's frame.

        Raises
        ------
        ReferenceTrajectoryError
            If it leaves the neighbourhood of the frame.
        """
        if self.recording is None:
            assert self.path is not None
            return self.path
        made = self.recording
        return fit_positions(scene, made.positions, made.speeds, made.what)


def given_reference(thing: Any, scene: Scene) -> GivenReference:
    """A reference that a program hands over.

    Parameters
    ----------
    thing : array, mapping, trajectory, states or curve
        One of

        - an array (N, 3), (N, 4) or (N, 5) with the columns ``t, x, y[, yaw[, v]]``;
        - a mapping (or table) with these names, each (N,);
        - a ``commonroad.scenario.trajectory.Trajectory`` of any state type, which begins at the planning
          problem's initial time step;
        - driven states, such as those of an earlier result;
        - a :class:`repair.curves.base.Curve` in the scene's own frame.

        ``t`` is in seconds from the planning problem's start and begins with 0; ``x, y`` are of the
        vehicle's centre [m], ``yaw`` is the orientation of its body or the direction of its path [rad], ``v``
        its speed [m/s]. Samples need not be evenly spaced nor lie at the scenario's steps.
    scene : Scene

    Returns
    -------
    GivenReference

    Raises
    ------
    ReferenceTrajectoryError
        The sentence names the first place: a gap in time, a number that is none, positions that contradict
        speeds or headings by more than CommonRoad's own checks allow
        (:mod:`repair.reference.consistency`), or a start elsewhere than the ego's.
    """
    if isinstance(thing, Mapping) and set(thing) == {"curve"}:
        thing = read_curve(thing["curve"])
    if isinstance(thing, Curve):
        return _of_curve(thing, scene)
    if hasattr(thing, "state_list"):
        return _of_trajectory(thing, scene)
    table = _table(thing)
    _require_times(table[:, 0], scene.dt)
    fine = _recording(table, scene, "by its own samples, ")
    _require_one_drive(fine, table[:, 0], scene.vehicle)
    made = _recording(_at_steps(table, scene.dt), scene)
    _require_start(made, scene)
    plain = {
        key: column(values, 12)
        for key, values in zip(_KEYS, table.T, strict=True)
        if np.isfinite(values).all()
    }
    return GivenReference(made, None, plain)


def no_given_reference(scene: Scene, config: ReferenceConfig, occupancy: Occupancy) -> Curve:
    """What ``reference.source: given`` makes where nothing was given.

    Raises
    ------
    ReferenceTrajectoryError
        Always.
    """
    raise ReferenceTrajectoryError(
        "reference.source is given, and no reference was: it is the argument reference= of repair.repair"
    )


# -- what it is made of ------------------------------------------------------------------------------


def _table(thing: Any) -> Array:
    """Columns t, x, y, yaw, v (N, 5), NaN where yaw or v are not said."""
    if isinstance(thing, DrivenStates):
        thing = {"t": thing.t, "x": thing.x, "y": thing.y, "yaw": thing.orientation, "v": thing.speed}
    if hasattr(thing, "keys") and hasattr(thing, "__getitem__"):
        names = [str(name) for name in thing.keys()]  # noqa: SIM118 - a table need not be a mapping
        if set(_KEYS[:3]) <= set(names) <= set(_KEYS):
            columns = {name: thing[key] for name, key in zip(_COLUMNS, _KEYS, strict=True) if key in names}
        else:
            if strange := [name for name in names if name not in _COLUMNS]:
                raise ReferenceTrajectoryError(
                    f"{_WHAT} has {in_words(strange[0])}; its columns are t, x, y and, if known, yaw and v"
                )
            columns = {name: thing[name] for name in names}
    else:
        values = _numbers(thing, "")
        if values.ndim != 2 or not 3 <= values.shape[1] <= len(_COLUMNS):
            raise ReferenceTrajectoryError(
                f"{_WHAT} is {_shape(thing, values)}; an array has a row for each sample and the columns "
                "t, x, y[, yaw[, v]]"
            )
        columns = dict(zip(_COLUMNS, values.T, strict=False))
    if missing := [name for name in _COLUMNS[:3] if name not in columns]:
        raise ReferenceTrajectoryError(f"{_WHAT} has no column {missing[0]}; it needs t, x and y")
    read = {name: _numbers(values, f"column {name} of ") for name, values in columns.items()}
    count = len(np.atleast_1d(read["t"]))
    for name, values in read.items():
        if values.shape != (count,):
            raise ReferenceTrajectoryError(
                f"column {name} of {_WHAT} has the shape {values.shape}, its times {read['t'].shape}"
            )
        if wrong := np.flatnonzero(~np.isfinite(values)).tolist():
            raise ReferenceTrajectoryError(f"{_WHAT}: {name} of sample {wrong[0]} is not finite")
    table = np.full((count, len(_COLUMNS)), np.nan)
    for name, values in read.items():
        table[:, _COLUMNS.index(name)] = values
    return table


def _numbers(thing: Any, what: str) -> Array:
    try:
        return np.asarray(thing, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ReferenceTrajectoryError(
            f"{what}{_WHAT} cannot be read as numbers: {kind_of(thing)} ({in_words(error)}); a reference is "
            "an array t, x, y[, yaw[, v]], a mapping with these names, a CommonRoad trajectory, driven "
            "states, or a curve"
        ) from error


def _shape(thing: Any, values: Array) -> str:
    return f"of shape {values.shape}" if values.ndim else kind_of(thing)


def _require_times(t: Array, dt: float) -> None:
    """Refuse times that do not begin with the planning problem, run back, or have a gap."""
    if len(t) < _LEAST:
        raise ReferenceTrajectoryError(f"{_WHAT} has {len(t)} samples; a reference takes at least {_LEAST}")
    if abs(t[0]) > _SAME:
        raise ReferenceTrajectoryError(
            f"{_WHAT} begins at t = {t[0]:g} s; its times count from the planning problem's start, which is 0"
        )
    steps = np.diff(t)
    if (steps <= 0.0).any():
        k = int(np.argmax(steps <= 0.0))
        raise ReferenceTrajectoryError(
            f"{_WHAT}: after t = {t[k]:g} s its times do not go on (sample {k + 1} is at {t[k + 1]:g} s)"
        )
    usual = float(np.median(steps))
    wide = steps > min(_GAP * usual, max(_COARSEST, dt)) + _SAME
    if wide.any():
        k = int(np.argmax(wide))
        raise ReferenceTrajectoryError(
            f"{_WHAT} has a gap: from t = {t[k]:g} to {t[k + 1]:g} s there is no sample "
            f"(mostly one every {usual:.3g} s)"
        )


def _at_steps(table: Array, dt: float) -> Array:
    """The samples at the scenario's steps, as they are or by a cubic spline through them."""
    t = table[:, 0]
    steps = np.arange(steps_until(float(t[-1]), dt) + 1) * dt
    if len(steps) < _LEAST:
        raise ReferenceTrajectoryError(
            f"{_WHAT} ends at {t[-1]:g} s; it takes at least {_LEAST - 1} of the scenario's steps of {dt:g} s"
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


def _recording(table: Array, scene: Scene, own: str = "") -> Recording:
    yaw = table[:, 3]
    what = _WHAT if not own else f"{_WHAT}, {own.rstrip(', ')}"
    first = scene.initial_time_step if not own else 0
    return Recording(what, first, table[:, 1:3], yaw, table[:, 4], yaw, scene.vehicle.rear)


# -- whether it can be ------------------------------------------------------------------------------------


def _require_one_drive(made: Recording, t: Array, vehicle: Vehicle) -> None:
    """Refuse what contradicts itself from sample to sample.

    A planner's yaw is that of the body, or the direction of its path: what either allows is allowed.
    """
    steps = np.diff(t)
    if np.isnan(made.headings).all():
        _require_speeds(made, t, vehicle)
        return
    if np.ptp(steps) > 0.01 * float(steps.mean()):  # unevenly: by the steps of the scenario alone
        return
    dt = float(steps.mean())
    try:
        require_consistent(made, dt, vehicle)
    except ReferenceTrajectoryError as error:
        try:
            require_consistent(replace(made, rear=0.0), dt, vehicle)
        except ReferenceTrajectoryError:
            raise error from None


def _require_speeds(made: Recording, t: Array, vehicle: Vehicle) -> None:
    """Without headings: how far each step goes, against the speeds at its ends."""
    require_consistent(made, float(np.diff(t).max()))
    if np.isnan(made.speeds).all():
        return
    steps = np.diff(t)
    moved = np.hypot(*np.diff(made.positions, axis=0).T)
    mean = 0.5 * (np.abs(made.speeds[1:]) + np.abs(made.speeds[:-1]))
    # A chord is shorter than its arc by a share of turn² / 24, and a speed may change within a step and back.
    allowed = (
        0.03
        + 0.25 * vehicle.a_max * steps**2
        + mean * steps * (vehicle.largest_curvature() * moved) ** 2 / 20.0
    )
    wrong = np.abs(moved - mean * steps) > allowed
    if wrong.any():
        k = int(np.argmax(wrong))
        raise ReferenceTrajectoryError(
            f"{made.what}: from t = {t[k]:g} to {t[k + 1]:g} s the positions move by {moved[k]:.3g} m, and "
            f"the speeds say {mean[k] * steps[k]:.3g} m (at most {allowed[k]:.2g} m apart)"
        )


def _require_start(made: Recording, scene: Scene) -> None:
    start = scene.initial_state
    require_start(made, start.x, start.y, start.orientation, start.velocity)


def _of_trajectory(trajectory: Any, scene: Scene) -> GivenReference:
    """A CommonRoad trajectory: its states are looked at as those of a solution file are."""
    with foreign("reading the given trajectory", ReferenceTrajectoryError):
        made = states_of(list(trajectory.state_list), _WHAT, scene.initial_time_step, scene.vehicle)
    _require_start(made, scene)
    require_consistent(made, scene.dt, scene.vehicle)
    table = [np.arange(len(made.positions)) * scene.dt, *made.positions.T, made.headings, made.speeds]
    plain = {k: column(v, 12) for k, v in zip(_KEYS, table, strict=True) if np.isfinite(v).all()}
    return GivenReference(made, None, plain)


def _of_curve(curve: Curve, scene: Scene) -> GivenReference:
    """A curve in the scene's frame: finite, from t = 0 on, and from the ego's place."""
    with foreign(f"{_WHAT}, a {type(curve).__name__},", ReferenceTrajectoryError):
        start, end = float(curve.t_start), float(curve.t_end)
        if not (abs(start) <= _SAME and end > start):
            raise ReferenceTrajectoryError(f"{_WHAT} goes from {start:g} to {end:g} s; it has to begin at 0")
        times = np.arange(steps_until(min(end, scene.horizon), scene.dt) + 1) * scene.dt
        samples = curve.sample(times)
        known = np.isfinite(samples.position).all(axis=1) & np.isfinite(samples.velocity).all(axis=1)
    if not known.all():
        raise ReferenceTrajectoryError(f"{_WHAT} is not finite at t = {times[int(np.argmin(known))]:g} s")
    apart, faster = samples.position[0] - scene.start[0], samples.velocity[0, 0] - scene.start[1, 0]
    if np.abs(apart).max() > START_OFF:
        raise ReferenceTrajectoryError(
            f"{_WHAT} starts {np.hypot(*apart):.4g} m from the ego's initial position in the scene's frame "
            f"(at most {START_OFF:g} m along either axis)"
        )
    if abs(faster) > START_SPEED_OFF:
        raise ReferenceTrajectoryError(
            f"{_WHAT} starts {abs(faster):.3g} m/s {'faster' if faster > 0 else 'slower'} than the ego "
            f"(at most {START_SPEED_OFF:g} m/s)"
        )
    return GivenReference(None, curve, {"curve": curve_to_dict(curve)})
