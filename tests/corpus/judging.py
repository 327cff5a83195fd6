"""What was answered about a file, held against commonroad-io, shapely, and CommonRoad's own checks.

A contact time is right where the ego drawn smaller by 2 cm meets nobody before it, and drawn larger by 2 cm
somebody at it or before: how shapes and ways are drawn makes no more difference than that.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from tests.corpus.records import Examined
from tests.corpus.road import Road, lane_drive
from tests.judge import Ego, contact_time, draws_a_trailer, ego_of, first_contact, obstacles_of, off_centre

import repair

__all__ = ["Judge"]

DEPTH = 0.02  # [m]
INSTANT = 2e-3  # [s]
ROAD = 0.05  # beyond the gap that is closed: of what leaves the road by less the readings differ [m]


class Judge:
    """The file read once more by commonroad-io, and what shapely makes of it."""

    def __init__(self, path: Path, scene: Any, found: Examined) -> None:
        from commonroad.common.file_reader import CommonRoadFileReader

        self.scenario, problems = CommonRoadFileReader(str(path)).open()
        self.problem = problems.planning_problem_dict[scene.planning_problem_id]
        self.scene, self.found, self.dt = scene, found, float(self.scenario.dt)
        self.first = scene.initial_time_step
        self.road = Road(self.scenario, repair.load_config().checker.road_gap)
        start = self.problem.initial_state
        left_out = [o for o in self.scenario.dynamic_obstacles if _is_own(o, self.problem, self.first)]
        self.apart = frozenset(o.obstacle_id for o in left_out)
        self.trains = frozenset(o.obstacle_id for o in obstacles_of(self.scenario) if draws_a_trailer(o))
        #: Turned about its own centre and as a whole it is no rigid body, and covers both over a step.
        self.twice = frozenset(o.obstacle_id for o in obstacles_of(self.scenario) if off_centre(o))
        self.start = np.asarray(start.position, dtype=float)[:2]

    def reference(self, prepared: Any, reference: str) -> None:
        """Contact, margin and edge of the road of a reference, against what was reported."""
        checker, conflict = prepared.checker, prepared.conflict
        driven = checker.drive(prepared.reference, prepared.t_reference)
        poses = np.column_stack([driven.x, driven.y, driven.orientation])
        vehicle = prepared.scene.vehicle
        ego = _fine(Ego(np.asarray(driven.t), poses, vehicle.length, vehicle.width))
        own = prepared.scene.recorded_ego
        apart = self.apart | ({own.id} if own is not None else set())
        until = prepared.t_reference

        def met(deeper: float, apart: frozenset[int] = apart) -> float:
            return contact_time(ego, self.scenario, self.first, until, deeper=deeper, apart=apart)

        def says(kind: str, reason: str) -> None:
            self.found.says(kind, reason, "", reference)

        self.found.counts["contact times"] += 1
        early, late, said = met(-DEPTH), met(DEPTH), conflict.contact_time
        if conflict.contact_id in self.twice:
            early -= self.dt
        if conflict.contact_id not in self.trains and not early - INSTANT <= said <= late + INSTANT:
            says("contact", f"reported {said:.3f} s, is {early:.3f} to {late:.3f} s")
        room = prepared.config.checker.clearance
        beside = _beside(ego, self.scenario, self.first, room + DEPTH, apart)
        early, late = met(-room - DEPTH, apart | beside), met(-room + DEPTH, apart | beside)
        floor = np.floor(early / self.dt + 1e-9) * self.dt if early < np.inf else early
        held = conflict.obstacle_id in self.trains | self.twice | beside
        if conflict.time > late + INSTANT and not held:
            says("ttc", f"reported {conflict.time:.3f} s, the margin is entered at {late:.3f} s")
        if conflict.kind in ("margin", "collision") and not held and conflict.time < floor - INSTANT:
            says("ttc", f"reported {conflict.time:.3f} s, nobody is near before {early:.3f} s")
        self._edge(ego, prepared, reference)

    def _edge(self, ego: Ego, prepared: Any, reference: str) -> None:
        """The edge of the road: left where it is said, and not left where it is not."""
        conflict, checked = prepared.conflict, prepared.scene
        self.found.counts["road verdicts"] += 1
        if conflict.kind == "off_road":
            until, speed = conflict.time + self.dt, float(checked.start[1, 0])
            words = ""
            if self.road.inside(_until(ego, until)).all():
                words = "the ego is within the lanelets"
            elif reference == "constant" and speed > 0.5 and self.road.inside(_until(ego, 0.0)).all():
                size, lanes = (ego.length, ego.width), checked.route_lanelets
                lane = lane_drive(self.scenario, lanes, self.start, speed, until + 0.5, size)
                if lane is not None and self.road.inside(lane).all():
                    words = "the middle of the lane stays on the road"
            if words:
                said = f"said at {conflict.time:.2f} s, and {words}: {conflict.detail}"
                self.found.says("off_road", said, "", reference)
            return
        until = min(conflict.time, prepared.t_reference)
        coarse = _until(ego, until, every=20)
        if (far := self.road.beyond(coarse).max(initial=0.0)) > ROAD + prepared.config.checker.road_gap:
            said = f"not said, and the ego is {far:.2f} m off the lanelets"
            self.found.says("off_road", said, "", reference)

    def result(self, result: Any, backend: str, reference: str) -> bool:
        """The written trajectory: contact, road, and CommonRoad's own checks; whether all accept it."""
        from commonroad.common.solution import CommonRoadSolutionReader
        from commonroad.planning.planning_problem import PlanningProblemSet
        from commonroad_dc.feasibility import solution_checker

        from repair.io.official import check_solution_file

        if result.status.value not in ("found", "no_conflict"):
            return False
        before = sum(not one.told for one in self.found.deviations)

        def says(kind: str, reason: str, *, told: bool = False) -> None:
            self.found.says(kind, reason, backend, reference, told=told)

        with tempfile.TemporaryDirectory() as folder:
            files = [f for f in result.save(folder, figure=False) if f.name.startswith("solution_")]
            solution = CommonRoadSolutionReader.open(str(files[0]))
            problems = PlanningProblemSet([self.problem])
            scene = result.prepared.scene
            official = check_solution_file(files[0], scene.official(), problems)
        self.found.counts["official checks"] += 1
        for name in ("feasible", "collision_free"):
            if not getattr(official, name):
                says("official", f"not {name}")
        try:
            solution_checker.starts_at_correct_state(solution, problems)
        except Exception as error:
            says("official", f"{type(error).__name__}: {' '.join(str(error).split())[:150]}")
        states = solution.planning_problem_solutions[0].trajectory.state_list
        if len(states) > 1:
            ego = ego_of(states, self.dt, _parameters(scene.vehicle.type_id))
            own = scene.recorded_ego
            apart = self.apart | ({own.id} if own is not None else set())
            time, who = first_contact(ego, self.scenario, self.first, float(ego.t[-1]), apart=apart)
            if time < np.inf:
                says("trajectory", f"touches obstacle {who} at {time:.3f} s")
            far = self.road.beyond(_until(ego, np.inf, every=20)).max(initial=0.0)
            if far > ROAD + result.prepared.config.checker.road_gap:
                says("off_road", f"the trajectory is {far:.2f} m off the lanelets")
            elif not official.on_road:  # a gap of the map, or one that the drivability checker cannot lay out
                how = f"{official.road_method}; {far:.2f} m off the lanelets"
                says("boundary", f"CommonRoad's own boundary check says no ({how})", told=True)
        return sum(not one.told for one in self.found.deviations) == before


def _is_own(obstacle: Any, problem: Any, first: int) -> bool:
    """Whether an obstacle starts in the ego's own place: its recording, and no traffic."""
    state = obstacle.state_at_time(first)
    if state is None or hasattr(state.position, "center") or hasattr(state.position, "shapes"):
        return False
    ego = problem.initial_state
    if obstacle.obstacle_id == problem.planning_problem_id:
        return abs(getattr(state, "velocity", ego.velocity) - ego.velocity) < 1.0
    return bool(np.hypot(*(np.asarray(state.position)[:2] - np.asarray(ego.position)[:2])) < 0.5)


def _parameters(kind: int) -> Any:
    from importlib import import_module

    module = import_module(f"vehiclemodels.parameters_vehicle{kind}")
    return getattr(module, f"parameters_vehicle{kind}")()


def _fine(ego: Ego) -> Ego:
    """Every millisecond, linearly between the poses."""
    t = np.arange(0.0, ego.t[-1] + 5e-4, 1e-3)
    heading = np.unwrap(ego.poses[:, 2])
    columns = [np.interp(t, ego.t, c) for c in (ego.poses[:, 0], ego.poses[:, 1], heading)]
    return Ego(t, np.column_stack(columns), ego.length, ego.width)


def _until(ego: Ego, until: float, every: int = 1) -> Ego:
    kept = np.flatnonzero(ego.t <= until + 1e-9)[::every]
    return Ego(ego.t[kept], ego.poses[kept], ego.length, ego.width)


def _beside(ego: Ego, scenario: Any, first: int, margin: float, apart: frozenset[int]) -> frozenset[int]:
    """Obstacles within the margin at the start: it counts once they have been left."""
    found: set[int] = set()
    while True:
        _, who = first_contact(ego, scenario, first, 0.0, deeper=-margin, apart=apart | found)
        if who is None:
            return frozenset(found)
        found.add(who)
