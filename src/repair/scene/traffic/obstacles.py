"""Obstacles of a CommonRoad scenario as plain arrays, one row per time step.

What CommonRoad leaves open is settled here, towards the larger occupancy:

- a shape turns about its own centre, which is then moved by the state (commonroad-io's reading), and where
  that centre is not the position also as a whole;
- an uncertain position or orientation takes the rectangle that encloses every placement;
- a missing orientation is the direction of motion;
- a dynamic obstacle without a prediction stands where it is (noted), or moves on where that is asked for;
- a set-based occupancy over [k, k + 1] counts at k and at k + 1;
- a trailer follows its tractor (:mod:`repair.scene.traffic.trailers`);
- after its prediction an obstacle is gone (CommonRoad's own reading), or held, or moves on;
- where occupancies start late or pause, the obstacle is absent, as for commonroad-io (noted).

A trajectory with a hole, or with steps out of order, is refused: commonroad-io and the drivability
checker count its states instead of reading their time steps, and would put the obstacle elsewhere. Where
CommonRoad's own collision check reads something else, the scene has a note.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from repair.errors import ConfigError, ScenarioError
from repair.scene.settings import AFTER_PREDICTION
from repair.scene.traffic.late import steps_late
from repair.scene.traffic.obstacle import Obstacle
from repair.scene.traffic.rows import obstacle_of_rows, require_sane
from repair.scene.traffic.shapes import Placed, occupied, off_centre
from repair.scene.traffic.stepwise import holds_over_intervals, pauses
from repair.scene.traffic.timeline import continued, headings_of, state_occupancy, steps_of, timeline
from repair.scene.traffic.trailers import is_train

__all__ = ["last_predicted_step", "obstacles_of"]

_NAMED = 5  # so many obstacles are named in a note
_TURNED = 1e-3  # half of a heading [rad] from which on a body counts as turned


def _all(scenario: Any) -> list[Any]:
    return [
        *scenario.static_obstacles, *scenario.dynamic_obstacles,
        *getattr(scenario, "phantom_obstacle", ()), *getattr(scenario, "environment_obstacle", ()),
    ]  # fmt: skip


def last_predicted_step(scenario: Any) -> int | None:
    """Last time step at which any moving obstacle is predicted; None where nothing moves.

    Parameters
    ----------
    scenario : commonroad.scenario.scenario.Scenario
    """
    last = []
    for obstacle in _all(scenario):
        prediction = getattr(obstacle, "prediction", None)
        trajectory = getattr(prediction, "trajectory", None)
        if trajectory is not None:
            last.append(max(steps_of(s.time_step)[1] for s in trajectory.state_list))
        elif prediction is not None:
            last.extend(steps_of(o.time_step)[1] for o in prediction.occupancy_set)
    return max(last, default=None)


def obstacles_of(
    scenario: Any,
    *,
    first_step: int,
    n_steps: int,
    after_prediction: str = "remove",
    is_ego: Callable[[Any], bool] = lambda obstacle: False,
    ego_id: int | None = None,
    ego_speed: float = np.nan,
) -> tuple[tuple[Obstacle, ...], Obstacle | None, list[str]]:
    """Read every obstacle of a scenario.

    Parameters
    ----------
    scenario : commonroad.scenario.scenario.Scenario
    first_step : int
        The planning problem's initial time step, k = 0 here; earlier steps are cut.
    n_steps : int
        Rows are k = 0 .. n_steps.
    after_prediction : str
        What becomes of an obstacle after its prediction: ``remove``, ``hold`` or ``constant_velocity``.
    is_ego : callable
        Recognises the ego's own recording among the dynamic obstacles by its start.
    ego_id, ego_speed
        The planning problem's id and initial speed [m/s]: a trajectory obstacle with that id (ids
        are unique in CommonRoad) and speed is the ego's recording from a later start, and left out.

    Returns
    -------
    obstacles : tuple of Obstacle
        All but the ego's own recording and those that are never there.
    recorded ego : Obstacle or None
    notes : list of str
        What was taken for granted or left out.

    Raises
    ------
    ConfigError
        If ``after_prediction`` is none of the three.
    ScenarioError
        If an obstacle has a number that is not finite; the sentence names it.
    """
    if after_prediction not in AFTER_PREDICTION:
        raise ConfigError(
            f"after_prediction is {after_prediction!r}; it can be {', '.join(AFTER_PREDICTION)}"
        )
    found: list[Obstacle] = []
    ego: Obstacle | None = None
    notes: list[str] = []
    moves_on = after_prediction == "constant_velocity"
    for obstacle in _all(scenario):
        name = int(obstacle.obstacle_id)
        try:
            placed, role = _placed(obstacle, first_step, first_step + n_steps, moves_on)
        except ScenarioError as error:
            raise ScenarioError(f"obstacle {name}: {error}") from error
        kind = str(getattr(getattr(obstacle, "obstacle_type", None), "value", "unknown"))
        if isinstance(placed, Placed):
            if role == "dynamic":
                notes.append(f"obstacle {name} has no prediction and is taken to stand still")
            still = obstacle_of_rows(name, kind, role, [placed], n_steps + 1)
            found.append(replace(still, source=obstacle))
            continue
        rows = [placed.get(first_step + k) for k in range(n_steps + 1)]
        rows = continued(rows, placed, first_step, after_prediction, float(scenario.dt))
        if not any(row is not None for row in rows):
            notes.append(f"obstacle {name} is never there within the horizon")
            continue
        made = replace(obstacle_of_rows(name, kind, role, rows), late=steps_late(obstacle), source=obstacle)
        if role == "dynamic" and ego is None and is_ego(obstacle):
            ego = made
            notes.append(f"obstacle {name} is the ego's own recording and is left out")
        elif (
            role == "dynamic"
            and name == ego_id
            and abs(np.nan_to_num(made.states[0, 3], nan=1e9) - ego_speed) < 1.0
        ):
            notes.append(
                f"obstacle {name} has the planning problem's id and the ego's speed: a copy, left out"
            )
        else:
            found.append(made)
    return tuple(found), ego, [*notes, *_read_otherwise(found)]


def _read_otherwise(found: list[Obstacle]) -> list[str]:
    """What commonroad-io or CommonRoad's own collision check reads otherwise, a line for each kind."""
    of = [(o.id, o.source, o.states) for o in found if o.role in ("dynamic", "set_based", "static")]
    of = [item for item in of if getattr(item[1], "obstacle_shape", None) is not None]
    over = [name for name, source, _ in of if holds_over_intervals(source)]
    trains = [name for name, source, _ in of if is_train(source)]
    turned = [
        name
        for name, source, states in of
        if name not in trains
        and off_centre(source.obstacle_shape)
        and np.abs(np.sin(0.5 * np.nan_to_num(states[:, 2]))).max() > _TURNED
    ]
    notes = [
        f"obstacle {name} is absent from time step {low} to {high}, for which its occupancies say nothing"
        for name, source, _ in of
        for low, high in pauses(source)
    ]
    if over:
        notes.append(
            f"{_named(over)}: occupancies over intervals count at every step of theirs; CommonRoad's own "
            "collision check counts them at one step each, and is asked about them step by step"
        )
    if trains:
        notes.append(
            f"{_named(trains)}: the trailer follows its tractor; CommonRoad's own check lays it on top"
        )
    if turned:
        notes.append(
            f"{_named(turned)}: a body that is not centred on its position counts twice: turned about its "
            "own centre, as in CommonRoad's own collision check, and turned as a whole"
        )
    return notes


def _named(names: list[int]) -> str:
    """Obstacles by their ids, the first few of them."""
    shown = ", ".join(str(name) for name in names[:_NAMED])
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return f"obstacle{'s' if len(names) > 1 else ''} {shown}{more}"


def _placed(
    obstacle: Any, first: int, last: int, moves_on: bool = False
) -> tuple[Placed | dict[int, Placed], str]:
    """Where an obstacle is, for good or by time step, and its role.

    Raises
    ------
    ScenarioError
        Without the obstacle's name.
    """
    still = _standing(obstacle)
    if still is not None:
        require_sane([still[1]])
        if moves_on and still[0] == "dynamic" and abs(np.nan_to_num(still[1].state[3])) > 0.0:
            return {steps_of(obstacle.initial_state.time_step)[0]: still[1]}, "dynamic"
        return still[1], still[0]
    steps, role = timeline(obstacle, first, last)
    require_sane(steps.values())
    return steps, role


def _standing(obstacle: Any) -> tuple[str, Placed] | None:
    """Role and place of an obstacle that never moves; None for the others."""
    role = str(getattr(obstacle.obstacle_role, "value", obstacle.obstacle_role))
    if getattr(obstacle, "initial_state", None) is None:
        shape = getattr(obstacle, "obstacle_shape", None)
        return None if shape is None else ("environment", occupied(shape))
    if role != "static" and getattr(obstacle, "prediction", None) is not None:
        return None
    state = obstacle.initial_state
    placed = state_occupancy(obstacle.obstacle_shape, state, headings_of([state])[0])
    if role == "static":
        placed = placed._replace(state=(*placed.state[:3], 0.0))
    return ("static" if role == "static" else "dynamic"), placed
