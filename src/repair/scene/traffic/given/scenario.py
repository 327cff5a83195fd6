"""Traffic from memory: CommonRoad obstacles, or predictions as arrays, several for one obstacle if need be.

Predictions become CommonRoad obstacles, so that they are read, judged and written like those of a file.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from numbers import Integral, Real
from typing import Any

import numpy as np

from repair.arrays import Array
from repair.errors import ScenarioError, foreign, in_words, kind_of
from repair.scene.traffic.given.shapes import body_of, sets_of
from repair.scene.traffic.prediction import WHAT as _WHAT
from repair.scene.traffic.prediction import Mode, Prediction, name_of
from repair.scene.traffic.shapes import outlines

__all__ = ["given_scenario", "known_rows", "speeds_along", "standing_as"]

_FAR = 1_000_000  # ids of further modes begin here


def given_scenario(
    old: Any, first_step: int, traffic: Iterable[Any], threshold: float
) -> tuple[Any, tuple[Mode, ...], list[str]]:
    """A CommonRoad scenario with the road of a scene and this traffic.

    Parameters
    ----------
    old : commonroad.scenario.scenario.Scenario
        Its road and time step are kept.
    first_step : int
        The planning problem's.
    traffic : iterable
        CommonRoad obstacles and :class:`Prediction`; all there is.
    threshold : float
        Modes less probable than this are left out.

    Returns
    -------
    scenario : commonroad.scenario.scenario.Scenario
        Its road is that of the scene itself, not a copy.
    modes : tuple of Mode
        Of the obstacles that have several.
    notes : list of str
        Which modes were left out, and under which id the others stand.

    Raises
    ------
    ScenarioError
        If an obstacle cannot be had; the sentence names it.
    """
    from commonroad.scenario.scenario import Scenario

    if isinstance(traffic, str | bytes) or not hasattr(traffic, "__iter__"):
        raise ScenarioError(f"{_WHAT} has to be a list of obstacles or predictions, not {kind_of(traffic)}")
    require_threshold(threshold)
    made = Scenario(
        old.dt, old.scenario_id, author=old.author or "", tags=old.tags or set(),
        affiliation=old.affiliation or "", source="", location=old.location,
    )  # fmt: skip
    made.replace_lanelet_network(old.lanelet_network)
    things = list(traffic)
    roads = _ids_of(old.lanelet_network)
    chosen, modes, notes = standing_as([p for p in things if isinstance(p, Prediction)], threshold, roads)
    for name, prediction in chosen:
        _add(made, _obstacle(prediction, name, first_step, float(old.dt)), name)
    for thing in (t for t in things if not isinstance(t, Prediction)):
        if not hasattr(thing, "obstacle_id"):
            raise ScenarioError(f"{_WHAT} holds {kind_of(thing)}; obstacles or predictions are expected")
        _add(made, thing, int(thing.obstacle_id))
    return made, modes, notes


def _ids_of(network: Any) -> set[int]:
    """Ids that the road has taken: they are unique in CommonRoad."""
    found = {lanelet.lanelet_id for lanelet in network.lanelets}
    found |= {sign.traffic_sign_id for sign in network.traffic_signs}
    found |= {light.traffic_light_id for light in network.traffic_lights}
    for intersection in network.intersections:
        found |= {intersection.intersection_id, *(part.incoming_id for part in intersection.incomings)}
    return found


def standing_as(
    predictions: list[Prediction], threshold: float, roads: set[int]
) -> tuple[list[tuple[int, Prediction]], tuple[Mode, ...], list[str]]:
    """Who is looked at, and under which id."""
    notes: list[str] = []
    for p in predictions:
        if not isinstance(p.id, Integral) or isinstance(p.id, bool) or p.id < 1:
            raise ScenarioError(f"{_WHAT}: an obstacle's id is a positive whole number, not {in_words(p.id)}")
        require_probability(p, name_of(p))
    following = max([_FAR, *roads, *(int(p.id) for p in predictions)]) + 1
    chosen: list[tuple[int, Prediction]] = []
    modes: list[Mode] = []
    by_name: dict[int, list[Prediction]] = {}
    for p in predictions:
        by_name.setdefault(p.id, []).append(p)
    for name, own in by_name.items():
        kept = [p for p in own if p.probability >= threshold]
        if len(kept) < len(own):
            gone = ", ".join(f"{p.mode or 'unnamed'} ({p.probability:g})" for p in own if p not in kept)
            notes.append(f"obstacle {name}: modes below the threshold of {threshold:g} are left out: {gone}")
        for k, prediction in enumerate(kept):
            free = k == 0 and name not in roads
            stands_as = int(name) if free else following
            following += not free
            chosen.append((stands_as, prediction))
            word = prediction.mode or f"mode {k + 1}"
            if len(own) > 1:
                modes.append(Mode(int(name), word, prediction.probability, stands_as))
            if not free:
                which = f", {word}," if len(own) > 1 else ": the road has that id; it"
                notes.append(f"obstacle {name}{which} stands as obstacle {stands_as}")
    return chosen, tuple(modes), notes


def _add(scenario: Any, obstacle: Any, name: int) -> None:
    with foreign(f"obstacle {name} of {_WHAT}", ScenarioError):
        scenario.add_objects(obstacle)


def _obstacle(prediction: Prediction, name: int, first: int, dt: float) -> Any:
    """A prediction as a CommonRoad obstacle."""
    what = name_of(prediction)
    if (prediction.poses is None) == (prediction.occupancies is None):
        raise ScenarioError(f"{what}: either poses or occupancies are given")
    with foreign(what, ScenarioError):
        if prediction.poses is None:
            return _set_based(prediction, name, first, what)
        return _moving(prediction, name, first, dt, what)


def _type(kind: str, what: str) -> Any:
    from commonroad.scenario.obstacle import ObstacleType

    require_kind(kind, what)
    return ObstacleType(kind)


@cache
def _kinds() -> frozenset[str]:
    from commonroad.scenario.obstacle import ObstacleType

    return frozenset(member.value for member in ObstacleType)


def require_kind(kind: str, what: str) -> None:
    """Refuse a kind of obstacle that CommonRoad does not know.

    Raises
    ------
    ScenarioError
        With those that there are.
    """
    if not isinstance(kind, str) or kind not in _kinds():
        known = ", ".join(sorted(_kinds()))
        raise ScenarioError(f"{what}: there is no kind {in_words(kind)}; there are {known}")


def require_probability(prediction: Prediction, what: str) -> None:
    """Refuse a probability that is none.

    Raises
    ------
    ScenarioError
        With what it is.
    """
    known: Any = prediction.probability
    if not (isinstance(known, Real) and 0.0 <= float(known) <= 1.0):
        raise ScenarioError(f"{what}: its probability is {in_words(known)}, and no number from 0 to 1")


def require_threshold(threshold: Any) -> None:
    """Refuse a threshold of modes that is none.

    Raises
    ------
    ScenarioError
        With what it is.
    """
    if not (isinstance(threshold, Real) and 0.0 <= float(threshold) < 1.0):
        raise ScenarioError(
            f"the threshold of modes is {in_words(threshold)}; it has to be from 0 to below 1"
        )


def known_rows(poses: Any, what: str) -> tuple[int, Array]:
    """The first row that is there, and all from there on to the last (K, 3)."""
    table = np.asarray(poses, dtype=np.float64)
    if table.ndim != 2 or table.shape[1] != 3 or not len(table):
        raise ScenarioError(
            f"{what}: its poses are of shape {table.shape}; (T, 3) with x, y, yaw is expected"
        )
    there = np.asarray(np.isfinite(table).all(axis=1))
    if not there.any():
        raise ScenarioError(f"{what}: no pose of it is finite")
    begin, end = int(np.argmax(there)), len(table) - int(np.argmax(there[::-1]))
    if not there[begin:end].all():
        hole = begin + int(np.argmin(there[begin:end]))
        raise ScenarioError(
            f"{what} has a hole: at step {hole} its pose is not finite, and later it is again"
        )
    return begin, table[begin:end]


def _moving(prediction: Prediction, name: int, first: int, dt: float, what: str) -> Any:
    from commonroad.prediction.prediction import TrajectoryPrediction
    from commonroad.scenario.obstacle import DynamicObstacle
    from commonroad.scenario.state import CustomState, InitialState
    from commonroad.scenario.trajectory import Trajectory

    shape, middle = body_of(prediction, what)
    begin, rows = known_rows(prediction.poses, what)
    rows = rows.copy()  # they are the caller's
    rows[:, 2] = np.arctan2(np.sin(rows[:, 2]), np.cos(rows[:, 2]))
    speed = speeds_along(rows, dt)
    cos, sin = np.cos(rows[:, 2]), np.sin(rows[:, 2])
    rows[:, 0] += middle[0] * cos - middle[1] * sin
    rows[:, 1] += middle[0] * sin + middle[1] * cos
    start = InitialState(
        time_step=first + begin, position=rows[0, :2], orientation=float(rows[0, 2]),
        velocity=float(speed[0]), acceleration=0.0, yaw_rate=0.0, slip_angle=0.0,
    )  # fmt: skip
    states = [
        CustomState(
            time_step=first + begin + k,
            position=rows[k, :2],
            orientation=float(rows[k, 2]),
            velocity=float(speed[k]),
        )
        for k in range(1, len(rows))
    ]
    trajectory = Trajectory(first + begin + 1, states) if states else None
    known = TrajectoryPrediction(trajectory, shape) if trajectory is not None else None
    return DynamicObstacle(name, _type(prediction.kind, what), shape, start, known)


def speeds_along(rows: Array, dt: float) -> Array:
    """Speeds along the headings (K,) [m/s], by central differences."""
    if len(rows) < 2:
        return np.zeros(len(rows))
    moved = np.gradient(rows[:, :2], dt, axis=0)
    return np.asarray(moved[:, 0] * np.cos(rows[:, 2]) + moved[:, 1] * np.sin(rows[:, 2]))


def _set_based(prediction: Prediction, name: int, first: int, what: str) -> Any:
    from commonroad.prediction.prediction import Occupancy, SetBasedPrediction
    from commonroad.scenario.obstacle import DynamicObstacle
    from commonroad.scenario.state import InitialState

    if not (prediction.shape is prediction.length is prediction.width is None):
        raise ScenarioError(f"{what}: occupancies have their own shapes; leave shape, length and width out")
    begin, sets = sets_of(prediction, what)
    first += begin
    middle = np.mean(np.concatenate(outlines(sets[0], np.zeros(2), 0.0)), axis=0)
    start = InitialState(
        time_step=first, position=middle, orientation=0.0, velocity=0.0, acceleration=0.0, yaw_rate=0.0,
        slip_angle=0.0,
    )  # fmt: skip
    later = [Occupancy(first + k, area) for k, area in enumerate(sets) if k]
    shape = sets[0].translate_rotate(-middle, 0.0)
    known = SetBasedPrediction(first + 1, later)
    return DynamicObstacle(name, _type(prediction.kind, what), shape, start, known)
