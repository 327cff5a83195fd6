"""Runs inside a peer's interpreter, which knows nothing of us: ``python peer_worker.py JOB.json``.

The job names the scenario's file and the measure, and carries the path that ``repair`` drives along, so
that all plan on the same road:
``{"scenario", "measure", "rounds", "path": [[x, y], ...], "ego": [[x, y, heading, v], ...]}``.
The answer is one line of JSON, the last one on standard output.
"""

import json
import logging
import os
import sys
import time
import warnings

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"
os.environ["MPLBACKEND"] = "Agg"
warnings.simplefilter("ignore")
logging.disable(logging.CRITICAL)


def timed(call, rounds):
    """CPU and wall time of every call [s], and the last answer."""
    cpu, wall, answer = [], [], None
    for _ in range(rounds):
        begin_wall, begin = time.perf_counter(), time.process_time()
        answer = call()
        cpu.append(time.process_time() - begin)
        wall.append(time.perf_counter() - begin_wall)
    return cpu, wall, answer


def crime_ttr(job):
    """CommonRoad-CriMe: Time-To-React of an ego that drives along the path at constant speed."""
    import numpy as np
    from commonroad.common.file_reader import CommonRoadFileReader
    from commonroad.geometry.shape import Rectangle
    from commonroad.prediction.prediction import TrajectoryPrediction
    from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
    from commonroad.scenario.state import CustomState, InitialState
    from commonroad.scenario.trajectory import Trajectory
    from commonroad_crime.data_structure.configuration import CriMeConfiguration
    from commonroad_crime.measure import TTR

    scenario, _ = CommonRoadFileReader(job["scenario"]).open()
    x, y, heading, speed = job["ego"][0]
    first = InitialState(
        time_step=0,
        position=np.array([x, y]),
        orientation=heading,
        velocity=speed,
        acceleration=0.0,
        yaw_rate=0.0,
        slip_angle=0.0,
    )
    states = [
        CustomState(
            time_step=k, position=np.array(row[:2]), orientation=row[2], velocity=row[3], acceleration=0.0
        )
        for k, row in enumerate(job["ego"][1:], start=1)
    ]
    shape, name = Rectangle(length=4.298, width=1.674), 99999
    prediction = TrajectoryPrediction(Trajectory(1, states), shape)
    scenario.add_objects(DynamicObstacle(name, ObstacleType.CAR, shape, first, prediction))
    scenario.assign_obstacles_to_lanelets()

    def make():
        config = CriMeConfiguration()
        config.general.set_scenario_name(str(scenario.scenario_id))
        config.update(ego_id=name, sce=scenario)
        return TTR(config)

    built = timed(make, 1)
    measure = built[2]
    timed(lambda: measure.compute(time_step=0, verbose=False), 1)
    cpu, wall, value = timed(lambda: measure.compute(time_step=0, verbose=False), job["rounds"])
    return cpu, wall, f"TTR {value} s, built in {1e3 * built[0][0]:.0f} ms"


def reactive_planner(job):
    """commonroad-reactive-planner: one replan from t = 0 along the path, 60 steps, one process."""
    import numpy as np
    from commonroad.common.file_reader import CommonRoadFileReader
    from commonroad_clcs.config import CLCSParams
    from commonroad_rp.reactive_planner import ReactivePlanner
    from commonroad_rp.utility.config import ReactivePlannerConfiguration
    from commonroad_rp.utility.utils_coordinate_system import CoordinateSystem

    scenario, problems = CommonRoadFileReader(job["scenario"]).open()
    problem = next(iter(problems.planning_problem_dict.values()))
    config = ReactivePlannerConfiguration()
    config.debug.multiproc = False
    config.debug.logging_level = "CRITICAL"
    config.update(scenario=scenario, planning_problem=problem)
    planner = ReactivePlanner(config)
    planner.set_reference_path(
        coordinate_system=CoordinateSystem(np.array(job["path"]), clcs_params=CLCSParams())
    )
    start = planner.x_0  # made of the problem's initial state by the constructor

    def replan():
        planner.reset(
            initial_state_cart=start,
            collision_checker=planner.collision_checker,
            coordinate_system=planner.coordinate_system,
        )
        planner.set_desired_velocity(problem.initial_state.velocity, problem.initial_state.velocity)
        return planner.plan()

    timed(replan, 1)
    cpu, wall, answer = timed(replan, job["rounds"])
    return cpu, wall, "found a plan" if answer is not None else "found no plan"


def main(path):
    with open(path, encoding="utf-8") as file:
        job = json.load(file)
    measures = {"crime": crime_ttr, "reactive-planner": reactive_planner}
    distribution = {"crime": "commonroad-crime", "reactive-planner": "commonroad-reactive-planner"}
    try:
        cpu, wall, note = measures[job["measure"]](job)
        from importlib.metadata import version

        answer = {"cpu": cpu, "wall": wall, "note": note, "version": version(distribution[job["measure"]])}
    except Exception as error:  # whatever a peer breaks on is the answer, not our crash
        answer = {"error": f"{type(error).__name__}: {' '.join(str(error).split())[:300]}"}
    print("\n" + json.dumps(answer))


if __name__ == "__main__":
    main(sys.argv[1])
