"""What CommonRoad's own checker says about a written solution file.

Nothing of ours takes part: the file is read back by commonroad-io and handed to
``commonroad_dc.feasibility.solution_checker``. The search does not call this (it takes 0.3 to 1 s);
sweeps and certificates do.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from repair.io.plotting import import_matplotlib

__all__ = ["OfficialVerdict", "check_solution_file"]


@dataclass(frozen=True)
class OfficialVerdict:
    """The drivability checker's three answers, and by which road boundary it judged.

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
    """

    feasible: bool
    collision_free: bool
    on_road: bool
    road_method: str

    @property
    def ok(self) -> bool:
        """All three."""
        return self.feasible and self.collision_free and self.on_road


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
    from commonroad_dc.feasibility import solution_checker

    try:
        answers = solution_checker.solution_feasible(solution, scenario.dt, planning_problems)
        feasible = all(bool(answer[0]) for answer in answers.values())
    except Exception:  # the checker raises where it cannot reconstruct inputs: that is a no
        feasible = False
    try:
        solution_checker.obstacle_collision(scenario, planning_problems, solution)
        collision_free = True
    except solution_checker.CollisionException:
        collision_free = False
    on_road, method = _on_road(solution, scenario, planning_problems)
    return OfficialVerdict(feasible, collision_free, on_road, method)


def _on_road(solution: Any, scenario: Any, planning_problems: Any) -> tuple[bool, str]:
    from commonroad_dc.feasibility import solution_checker

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
