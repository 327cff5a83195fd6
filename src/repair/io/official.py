"""What CommonRoad's own checker says about a written solution file.

Nothing of ours takes part: the file is read back by commonroad-io and handed to
``commonroad_dc.feasibility.solution_checker``. The search does not call this (it takes 0.3 to 1 s);
sweeps and certificates do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from repair.errors import in_words
from repair.io.plotting import import_matplotlib
from repair.scene.road.sections import endless

__all__ = ["OfficialVerdict", "check_solution_file"]

# What the middle of a vehicle moves beyond what its rear axle does, turning at steering limits [m].
_APART = 0.1


@dataclass(frozen=True)
class OfficialVerdict:
    """What CommonRoad asks of a solution: the parts of ``valid_solution``, each by itself.

    Attributes
    ----------
    feasible : bool
        ``solution_feasible`` for the solution's vehicle model.
    collision_free : bool
        ``obstacle_collision`` raised nothing.
    on_road : bool
        No collision with the road boundary.
    road_method : str
        ``triangulation`` (``boundary_collision`` itself, which needs the package ``triangle``), else
        the method of ``create_road_boundary_obstacle`` that was used instead.
    solved : bool
        ``solved_all_problems``: it is for the planning problem that was asked about.
    vehicle_model : bool
        The checker knows the vehicle and the model, and the states are that model's.
    connected : bool
        Each state is one time step after the one before, and no farther than its speed takes it.
    starts : bool
        ``starts_at_correct_state``.
    goal : bool
        ``goal_reached``: some state fulfils a goal state.
    egos_apart : bool
        ``ego_collision`` raised nothing.
    words : mapping
        What the checker raised, by the name of the question above: its type and its words.
    """

    feasible: bool
    collision_free: bool
    on_road: bool
    road_method: str
    solved: bool = True
    vehicle_model: bool = True
    connected: bool = True
    starts: bool = True
    goal: bool = True
    egos_apart: bool = True
    words: Mapping[str, str] = field(default_factory=dict, compare=False)

    @property
    def ok(self) -> bool:
        """Nothing is wrong with it, but that it need not reach the goal."""
        return self.feasible and self.collision_free and self.on_road and self._whole

    @property
    def valid(self) -> bool:
        """All that ``valid_solution`` asks for, the goal included."""
        return self.ok and self.goal

    @property
    def _whole(self) -> bool:
        return self.solved and self.vehicle_model and self.connected and self.starts and self.egos_apart


def check_solution_file(file: Path, scenario: Any, planning_problems: Any) -> OfficialVerdict:
    """Read a CommonRoad solution file and have it checked.

    Parameters
    ----------
    file : Path
    scenario : commonroad.scenario.scenario.Scenario
        With the traffic that counts (:meth:`repair.scene.scene.Scene.official`).
    planning_problems : commonroad.planning.planning_problem.PlanningProblemSet

    Raises
    ------
    RepairError
        If the file is no solution file.
    """
    from repair.scene.reading import read_solution

    solution = read_solution(file)
    import_matplotlib()  # the drivability checker does, with whatever MPLBACKEND says
    from commonroad_dc.feasibility import solution_checker as official
    from commonroad_dc.feasibility.vehicle_dynamics import VehicleDynamics

    everything = scenario, planning_problems, solution
    parts = solution.planning_problem_solutions

    def feasible() -> bool:
        answers = official.solution_feasible(solution, scenario.dt, planning_problems)
        return all(bool(answer[0]) for answer in answers.values())

    def known() -> bool:
        for part in parts:
            VehicleDynamics.from_model(part.vehicle_model, part.vehicle_type)
        return all(part.trajectory_type.name == part.vehicle_model.name for part in parts)

    words: dict[str, str] = {}
    ask = partial(_said, words)
    on_road, method = _on_road(solution, scenario, planning_problems)
    return OfficialVerdict(
        feasible=ask("feasible", feasible),
        collision_free=ask("collision_free", lambda: not official.obstacle_collision(*everything)),
        on_road=on_road,
        road_method=method,
        solved=ask("solved", lambda: official.solved_all_problems(planning_problems, solution)),
        vehicle_model=ask("vehicle_model", known),
        connected=all(
            ask("connected", partial(_connected, part.trajectory.state_list, scenario.dt)) for part in parts
        ),
        starts=ask("starts", lambda: official.starts_at_correct_state(solution, planning_problems)),
        goal=ask("goal", lambda: official.goal_reached(*everything)),
        egos_apart=ask("egos_apart", lambda: not official.ego_collision(*everything)),
        words=words,
    )


def _said(words: dict[str, str], name: str, question: Callable[[], Any]) -> bool:
    """What the checker answers; where it raises, to say no or because it cannot judge, that is a no."""
    try:
        return bool(question())
    except Exception as error:
        words[name] = f"{type(error).__name__}: {in_words(error)}"
        return False


def _connected(states: Any, dt: float) -> bool:
    """Each state a time step after the one before, and no farther than the faster of both speeds takes it."""
    steps = np.array([state.time_step for state in states])
    place = np.array([np.asarray(state.position)[:2] for state in states], dtype=np.float64)
    speed = np.abs([float(state.velocity) for state in states])
    way = np.hypot(*np.diff(place, axis=0).T)
    return bool(
        (np.diff(steps) == 1).all()
        and np.isfinite(place).all()
        and (way <= 1.3 * dt * np.maximum(speed[1:], speed[:-1]) + _APART).all()
    )


def _on_road(solution: Any, scenario: Any, planning_problems: Any) -> tuple[bool, str]:
    from commonroad_dc.feasibility import solution_checker

    if endless(scenario.lanelet_network):  # no map that it can lay out
        return False, "none"
    try:
        solution_checker.boundary_collision(scenario, planning_problems, solution)
        return True, "triangulation"
    except solution_checker.CollisionException:
        return False, "triangulation"
    except Exception:  # no package `triangle`, or a road that it cannot triangulate
        pass
    from commonroad_dc.boundary.boundary import create_road_boundary_obstacle
    from commonroad_dc.pycrcc import CollisionChecker

    for method in ("aligned_triangulation", "obb_rectangles"):
        try:
            _, boundary = create_road_boundary_obstacle(scenario, method=method)
        except Exception:
            continue
        checker = CollisionChecker()
        checker.add_collision_object(boundary)
        ego = [
            solution_checker._create_pp_solution_collision_object(planning_problems, s, scenario.dt)
            for s in solution.planning_problem_solutions
        ]
        return not any(checker.collide(e) for e in ego), method
    return False, "none"
