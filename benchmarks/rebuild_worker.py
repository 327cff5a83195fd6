"""A cycle as it is without ``repair.Repairer``: everything is built anew, and ``repair.repair()`` asked.

It runs under this version and under those that took files and CommonRoad objects only: the plan goes in as
the recording of an obstacle, which is taken for the ego. Reads pickled requests, writes pickled answers.
"""

from __future__ import annotations

import contextlib
import pickle
import sys
import time
import warnings
from typing import Any

import numpy as np

PLAN = 999_983  # id under which the plan is among the traffic


def _obstacle(name: int, kind: str, length: float, width: float, rows: Any, first: int, dt: float) -> Any:
    """A prediction (T, 3), or a plan (T, 4) with its speeds, as a CommonRoad obstacle."""
    from commonroad.geometry.shape import Rectangle
    from commonroad.prediction.prediction import TrajectoryPrediction
    from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
    from commonroad.scenario.state import CustomState, InitialState
    from commonroad.scenario.trajectory import Trajectory

    there = np.flatnonzero(np.isfinite(rows[:, 0]))
    rows, first = rows[there[0] : there[-1] + 1], first + int(there[0])
    yaw = np.arctan2(np.sin(rows[:, 2]), np.cos(rows[:, 2]))
    speed = rows[:, 3] if rows.shape[1] > 3 else None
    if speed is None:
        moved = np.gradient(rows[:, :2], dt, axis=0)
        speed = moved[:, 0] * np.cos(yaw) + moved[:, 1] * np.sin(yaw)
    shape = Rectangle(length, width)
    start = InitialState(
        time_step=first, position=rows[0, :2], orientation=float(yaw[0]), velocity=float(speed[0]),
        acceleration=0.0, yaw_rate=0.0, slip_angle=0.0,
    )  # fmt: skip
    states = [
        CustomState(
            time_step=first + k, position=rows[k, :2], orientation=float(yaw[k]), velocity=float(speed[k])
        )
        for k in range(1, len(rows))
    ]
    known = TrajectoryPrediction(Trajectory(first + 1, states), shape)
    return DynamicObstacle(name, ObstacleType(kind), shape, start, known)


class Rebuilding:
    """The road's file is read once; objects, scene and repair are made for each cycle."""

    def __init__(self, file: str, backend: str, overrides: list[str]) -> None:
        import repair
        from repair.config import load_config

        first = repair.load_scene(file)
        self._old, self._problem = first.scenario, first.planning_problem
        self._size = 2.0 * first.vehicle.half_length, 2.0 * first.vehicle.half_width
        own = ["reference.source=recorded", f"reference.obstacle_id={PLAN}"]
        self._config = load_config(backend=backend, overrides=[*overrides, *own])

    def cycle(self, plan: Any, traffic: list[Any]) -> tuple[str, float, Any]:
        """Status, TTC and F-TTR."""
        from commonroad.planning.planning_problem import PlanningProblem
        from commonroad.scenario.scenario import Scenario
        from commonroad.scenario.state import InitialState

        import repair

        old, first = self._old, self._problem.initial_state.time_step
        made = Scenario(old.dt, old.scenario_id)
        made.replace_lanelet_network(old.lanelet_network)
        for name, kind, length, width, poses in traffic:
            made.add_objects(_obstacle(name, kind, length, width, poses, first, old.dt))
        made.add_objects(_obstacle(PLAN, "car", *self._size, plan[:, 1:], first, old.dt))
        x, y, yaw, v = plan[0, 1:]
        start = InitialState(
            time_step=first, position=np.array([x, y]), orientation=float(yaw), velocity=float(v),
            acceleration=0.0, yaw_rate=0.0, slip_angle=0.0,
        )  # fmt: skip
        problem = PlanningProblem(self._problem.planning_problem_id, start, self._problem.goal)
        found = repair.repair(repair.scene_from_scenario(made, problem, self._config), self._config)
        return found.status.value, found.ttc, found.f_ttr


def main() -> int:
    """Answer requests until there are none."""
    warnings.simplefilter("ignore")
    requests, answers = sys.stdin.buffer, sys.stdout.buffer
    made = Rebuilding(*pickle.load(requests))
    with contextlib.redirect_stdout(sys.stderr):
        while True:
            try:
                plan, traffic = pickle.load(requests)
            except EOFError:
                return 0
            wall, own = time.perf_counter(), time.process_time()
            found = made.cycle(plan, traffic)
            spent = time.process_time() - own, time.perf_counter() - wall
            pickle.dump((found, spent), answers)
            answers.flush()


if __name__ == "__main__":
    sys.exit(main())
