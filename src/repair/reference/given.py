"""References from memory: arrays, mappings, CommonRoad trajectories, driven states, curves.

A planner hands its trajectory over as it has it; it is taken as it is or not at all. Times count from the
planning problem's start. What stands between the scenario's steps is looked at as well, and not used.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.arrays import Array, column, wrap
from repair.curves.base import Curve, is_curve
from repair.curves.codec import curve_to_dict, read_curve
from repair.errors import ReferenceTrajectoryError, foreign
from repair.reference.base import Track
from repair.reference.columns import COLUMNS, KEYS, WHAT, at_steps, require_times, table_of
from repair.reference.consistency import (
    START_OFF,
    START_SPEED_OFF,
    Recording,
    are_of_the_body,
    require_consistent,
    require_start,
    require_turns,
)
from repair.reference.fit import fit_recording
from repair.reference.recorded import states_of
from repair.scene.scene import InitialState
from repair.timegrid import steps_until
from repair.vehicle.states import DrivenStates

if TYPE_CHECKING:
    from repair.reference.settings import ReferenceConfig
    from repair.scene.frame import FrenetFrame
    from repair.scene.scene import Scene
    from repair.vehicle.parameters import Vehicle
    from repair.world.boxes import Occupancy

__all__ = ["GivenReference", "given_reference", "given_start", "no_given_reference", "what_drives"]

_SAME_HEADING = 0.01  # a body that begins with the ego's orientation is off by no more than this [rad]


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
    places : (frame, (K, 2) array) or None
        The positions in a frame, where somebody has projected them already.
    heading : float or None
        Orientation of the body at the start [rad], where the reference says it.
    """

    recording: Recording | None
    path: Curve | None
    plain: dict[str, Any]
    places: tuple[FrenetFrame, Array] | None = None
    heading: float | None = None

    def within(self, frame: FrenetFrame) -> Array | None:
        """The positions in a frame (K, 2) [m], if that is the one in which somebody has projected them."""
        return self.places[1] if self.places is not None and self.places[0] is frame else None

    @property
    def positions(self) -> Array | None:
        """Positions (K, 2) along which the frame has to run [m]; None where it stays as it is."""
        return None if self.recording is None else self.recording.positions

    @property
    def track(self) -> Track | None:
        """The same as a track."""
        return None if self.positions is None else Track(self.positions, self.heading)

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
        return fit_recording(scene, self.recording, coordinates=self.within(scene.frame))


def what_drives(thing: Any) -> Any:
    """What an earlier result drives (None where it had no time to say so); anything else as it is."""
    states = getattr(thing, "states", thing)
    if states is None or isinstance(states, DrivenStates):
        return states
    return thing.driven() if callable(getattr(thing, "driven", None)) else thing


def given_reference(thing: Any, scene: Scene) -> GivenReference:
    """A reference that a program hands over.

    Parameters
    ----------
    thing : array, mapping, trajectory, states or curve
        One of

        - an array (N, 3), (N, 4) or (N, 5) with the columns ``t, x, y[, yaw[, v]]``;
        - a mapping (or table) with these names, each (N,);
        - a ``commonroad.scenario.trajectory.Trajectory`` of any state type, which begins at the planning
          problem's initial time step; states need say no more than their position;
        - driven states, or an earlier result, of which those are meant;
        - a :class:`repair.curves.base.Curve` in the scene's own frame.

        ``t`` is in seconds from the planning problem's start and begins with 0; ``x, y`` are of the
        vehicle's centre [m], ``yaw`` is the orientation of its body or the direction of its path [rad], ``v``
        its speed [m/s]. Samples need not be evenly spaced nor lie at the scenario's steps, but are nowhere
        more than 1.5 times as far apart as mostly, nor more than 0.5 s or a step of the scenario.
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
    thing = what_drives(thing)
    if isinstance(thing, Mapping) and set(thing) == {"curve"}:
        thing = read_curve(thing["curve"])
    if is_curve(thing):
        return _of_curve(thing, scene)
    if hasattr(thing, "state_list"):
        made = _states_of(thing, scene.initial_time_step, scene)
        if np.isfinite(made.speeds).all() and np.isfinite(made.directions).any():
            return _of_trajectory(made, scene)
        columns = zip(COLUMNS, _table_of_states(made, scene.dt).T, strict=True)
        thing = {name: values for name, values in columns if not np.isnan(values).all()}
    table = _rounded(table_of(thing))  # as result.json has it: who runs that again follows the same
    require_times(table[:, 0], scene.dt)
    fine = _recording(table, scene, "by its own samples, ")
    _require_one_drive(fine, table[:, 0], scene.vehicle)
    made = _recording(at_steps(table, scene.dt), scene)
    _require_start(made, scene)
    plain = {k: v.tolist() for k, v in zip(KEYS, table.T, strict=True) if np.isfinite(v).all()}
    return GivenReference(made, None, plain, heading=_body_at_start(made, scene))


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


def given_start(thing: Any, scene: Scene) -> InitialState:
    """Where a reference from memory starts, and how: the ego's state for who knows no other.

    Raises
    ------
    ReferenceTrajectoryError
        If it cannot be read.
    """
    if hasattr(thing, "state_list"):
        table = _table_of_states(_states_of(thing, None, scene), scene.dt)
    else:
        table = np.array(table_of(thing))  # as result.json has it: who runs that again follows the same
        table[:, 0], table[:3] = _rounded(table[:, 0]), _rounded(table[:3])
    require_times(table[:, 0], scene.dt)
    (_, x, y, yaw, v), after = table[0], table[1]
    moved = np.array([after[1] - x, after[2] - y])
    if not np.isfinite(yaw):
        still = np.hypot(*moved) < 1e-3
        yaw = scene.initial_state.orientation if still else float(np.arctan2(moved[1], moved[0]))
    if not np.isfinite(v):
        # Of a motion that accelerates evenly: a step alone says the speed of its middle.
        first, second = (float(np.hypot(*(table[k + 1, 1:3] - table[k, 1:3]))) for k in (0, 1))
        steps = np.diff(table[:3, 0])
        v = first / steps[0] - 0.5 * steps[0] * (second / steps[1] - first / steps[0]) / steps.mean()
    return InitialState(float(x), float(y), float(yaw), max(float(v), 0.0), 0.0, 0.0)


def _recording(table: Array, scene: Scene, own: str = "") -> Recording:
    yaw = table[:, 3]
    what = WHAT if not own else f"{WHAT}, {own.rstrip(', ')}"
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
            require_turns(made, dt, vehicle)
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


def _body_at_start(made: Recording, scene: Scene) -> float | None:
    """Orientation of the body at the start [rad]; None where headings are of the path, or not the ego's."""
    yaw = float(made.headings[0])
    # As result.json has it, where no model of a trajectory is known any more.
    made = replace(made, rear=scene.vehicle.rear, directions=made.headings)
    same = abs(float(wrap(yaw - scene.initial_state.orientation))) <= _SAME_HEADING
    return yaw if same and are_of_the_body(made) else None


def _states_of(trajectory: Any, first: int | None, scene: Scene) -> Recording:
    """The states of a CommonRoad trajectory, which begins at step ``first``, or at any."""
    with foreign("reading the given trajectory", ReferenceTrajectoryError):
        states = list(trajectory.state_list)
        first = int(states[0].time_step) if first is None else first
        return states_of(states, WHAT, first, scene.vehicle)


def _table_of_states(made: Recording, dt: float) -> Array:
    """States as columns t, x, y, yaw, v (N, 5)."""
    t = np.arange(len(made.positions)) * dt
    return np.column_stack([t, made.positions, made.headings, made.speeds])


def _of_trajectory(made: Recording, scene: Scene) -> GivenReference:
    """A CommonRoad trajectory: its states are looked at as those of a solution file are."""
    made = replace(  # result.json, which is read again, has columns t to v, of so many digits
        made, velocities=None, positions=_rounded(made.positions),
        headings=_rounded(made.headings), speeds=_rounded(made.speeds),
    )  # fmt: skip
    _require_start(made, scene)
    require_consistent(made, scene.dt, scene.vehicle)
    table = _table_of_states(made, scene.dt)
    plain = {k: column(v, 12) for k, v in zip(KEYS, table.T, strict=True) if np.isfinite(v).all()}
    return GivenReference(made, None, plain, heading=_body_at_start(made, scene))


def _rounded(values: Array) -> Array:
    """Values with the digits that ``result.json`` has of them."""
    return np.array(column(np.ravel(values), 12), dtype=np.float64).reshape(np.shape(values))


def _of_curve(curve: Curve, scene: Scene) -> GivenReference:
    """A curve in the scene's frame: finite, from t = 0 on, and from the ego's place."""
    with foreign(f"{WHAT}, a {type(curve).__name__},", ReferenceTrajectoryError):
        start, end = float(curve.t_start), float(curve.t_end)
        if not (abs(start) <= 1e-6 and end > start):
            raise ReferenceTrajectoryError(f"{WHAT} goes from {start:g} to {end:g} s; it has to begin at 0")
        times = np.arange(steps_until(min(end, scene.horizon), scene.dt) + 1) * scene.dt
        samples = curve.sample(times)
        known = np.isfinite(samples.position).all(axis=1) & np.isfinite(samples.velocity).all(axis=1)
    if not known.all():
        raise ReferenceTrajectoryError(f"{WHAT} is not finite at t = {times[int(np.argmin(known))]:g} s")
    apart, faster = samples.position[0] - scene.start[0], samples.velocity[0, 0] - scene.start[1, 0]
    if np.abs(apart).max() > START_OFF:
        raise ReferenceTrajectoryError(
            f"{WHAT} starts {np.hypot(*apart):.4g} m from the ego's initial position in the scene's frame "
            f"(at most {START_OFF:g} m along either axis)"
        )
    if abs(faster) > START_SPEED_OFF:
        raise ReferenceTrajectoryError(
            f"{WHAT} starts {abs(faster):.3g} m/s {'faster' if faster > 0 else 'slower'} than the ego "
            f"(at most {START_SPEED_OFF:g} m/s)"
        )
    return GivenReference(None, curve, {"curve": curve_to_dict(curve)})
