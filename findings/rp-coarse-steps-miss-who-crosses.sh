#!/usr/bin/env bash
# commonroad-reactive-planner: with steps longer than the scenario's, collisions are looked for at the wrong times.
#
# Expected: `factor` says how many steps of the scenario one of the planner lasts, so that collisions can be looked for
# where the two differ: with 0.2 s and a factor of 2 in a scenario of 0.1 s the planner keeps clear of the same
# traffic as with 0.1 s and 1.
# What happens: the factor numbers the states of the result (0, 2, 4, ...), but the collision checker is asked
# for the steps 0, 1, 2, ... Someone who crosses the road at 2 s is met at 2 s; looked for is where he is
# at 1 s. The same planner with steps of 0.1 s finds the collision and swerves.
# Why it matters: the plan is returned as free of collisions, and the scenario's obstacles are in it.
#
# Output seen:
#   commonroad-reactive-planner 2025.1
#   dt 0.1 s, factor 1: states of the steps [0, 1, 2, 3] ..., plans refused for collisions 58, the plan touches the pedestrian at the steps []
#   dt 0.2 s, factor 2: states of the steps [0, 2, 4, 6] ..., plans refused for collisions 20, the plan touches the pedestrian at the steps [20, 22]
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps commonroad-clcs==2025.2.0 commonroad-drivability-checker==2025.4.0 commonroad-reactive-planner==2025.1 methodtools==0.4.7 wirerope==1.0.0 commonroad-io==2024.3 commonroad-route-planner==2025.1.0 commonroad-vehicle-models==3.0.2 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 imageio==2.38.1 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 antlr4-python3-runtime==4.9.3 osqp==0.6.7.post3 packaging==26.4 pandas==3.1.1 pillow==13.0.0 Polygon3==3.0.9.1 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==4.0.0 PyYAML==6.0.4 qdldl==0.1.9.post1 rtree==1.4.1 scipy==1.17.1 shapely==2.2.0 six==1.17.0 tqdm==4.70.1
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { grep -v nanobind errors | tail -3 >&2; exit 1; }
from importlib.metadata import version

import numpy as np
from commonroad.common.util import Interval
from commonroad.geometry.shape import Rectangle
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import CustomState, InitialState, KSState
from commonroad.scenario.trajectory import Trajectory
from commonroad_rp.reactive_planner import ReactivePlanner
from commonroad_rp.utility.config import ReactivePlannerConfiguration
from commonroad_rp.utility.utils_coordinate_system import create_coordinate_system

print('commonroad-reactive-planner', version('commonroad-reactive-planner'))
WHERE, WHEN, WALK = 42.0, 20, 2.0  # m, time step, m/s


def at(x, y, heading, velocity):
    return InitialState(time_step=0, position=np.array([x, y]), orientation=heading, velocity=velocity, acceleration=0.0,
                        yaw_rate=0.0, slip_angle=0.0)


def planned(dt, factor):
    """Steps of the scenario at which the planned car touches the one who crosses, and how many plans were refused."""
    scenario = Scenario(0.1)
    x = np.arange(-50.0, 601.0, 5.0)
    scenario.add_objects(Lanelet(np.c_[x, 0 * x + 40], np.c_[x, 0 * x], np.c_[x, 0 * x - 40], 1))
    body = Rectangle(2.0, 1.0)
    walked = [KSState(time_step=k, position=np.array([WHERE, WALK * 0.1 * (k - WHEN)]), orientation=np.pi / 2,
                      velocity=WALK, steering_angle=0.0) for k in range(1, 121)]
    crossing = DynamicObstacle(10, ObstacleType.PEDESTRIAN, body, at(WHERE, -WALK * 0.1 * WHEN, np.pi / 2, WALK),
                               TrajectoryPrediction(Trajectory(1, walked), body))
    scenario.add_objects(crossing)
    settings = ReactivePlannerConfiguration()
    settings.debug.multiproc, settings.debug.logging_level = False, 'ERROR'
    settings.planning.dt, settings.planning.factor, settings.planning.time_steps_computation = dt, factor, round(4.0 / dt)
    goal = CustomState(time_step=Interval(0, 1000), velocity=Interval(0.0, 30.0))
    settings.update(scenario=scenario, planning_problem=PlanningProblem(1, at(0.0, 0.0, 0.0, 20.0), GoalRegion([goal])))
    planner = ReactivePlanner(settings)
    planner.reset(coordinate_system=create_coordinate_system(np.c_[np.arange(-40.0, 551.0), np.zeros(591)]))
    planner.set_desired_velocity(20.0, 20.0)
    states = planner.convert_state_list_to_commonroad_object(planner.plan()[0].state_list).prediction.trajectory.state_list
    size = settings.vehicle.length, settings.vehicle.width
    touched = [int(s.time_step) for s in states
               if crossing.occupancy_at_time(int(s.time_step)).shape.shapely_object.intersects(
                   Rectangle(*size, s.position, s.orientation).shapely_object)]
    return touched, planner.infeasible_count_collision, [int(s.time_step) for s in states[:4]]


found = {}
for dt, factor in ((0.1, 1), (0.2, 2)):
    found[factor] = touched, refused, steps = planned(dt, factor)
    print(f'dt {dt} s, factor {factor}: states of the steps {steps} ..., plans refused for collisions {refused}, '
          f'the plan touches the pedestrian at the steps {touched}')
ok = found[1][0] == [] and found[1][1] > 0 and 20 in found[2][0] and found[2][2] == [0, 2, 4, 6]
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
