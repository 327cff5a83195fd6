#!/usr/bin/env bash
# commonroad-idm-planner: the harder a car is willing to brake, the earlier and the longer it does.
#
# Expected: in the intelligent driver model a larger comfortable deceleration b means later braking: the dynamic
# part of the desired gap is v dv / (2 sqrt(a b)). At 20 m/s, 150 m from a standing car, with a = 0.73 m/s² a
# driver with b = 8 m/s² begins with 0.5 m/s², one with b = 1 m/s² with 2.5 m/s².
# What happens: the planner multiplies by sqrt(a b) where it should divide: v dv / 2 * sqrt(a b). The order turns
# round: 1.5 m/s² with b = 1 m/s² and 9.3 m/s² with b = 8 m/s². Only at a b = 1 both agree.
# Why it matters: that part of the gap is too large by a b (1.2 with the default settings, 8 with 2 and 4 m/s²), and
# counts in the square; who fits b to recorded driving gets the wrong direction.
#
# Output seen:
#   commonroad-idm-planner 0.2.1
#   b 1.00 m/s²: first acceleration  -1.46 m/s², of the model  -2.50 m/s²; after 2 s 17.1 m/s
#   b 1.37 m/s²: first acceleration  -1.90 m/s², of the model  -1.90 m/s²; after 2 s 16.5 m/s
#   b 1.67 m/s²: first acceleration  -2.25 m/s², of the model  -1.61 m/s²; after 2 s 16.1 m/s
#   b 4.00 m/s²: first acceleration  -4.90 m/s², of the model  -0.79 m/s²; after 2 s 13.9 m/s
#   b 8.00 m/s²: first acceleration  -9.29 m/s², of the model  -0.47 m/s²; after 2 s 11.9 m/s
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps commonroad-clcs==2025.2.0 commonroad-drivability-checker==2025.4.0 commonroad-idm-planner==0.2.1 commonroad-io==2024.3 commonroad-route-planner==2025.1.0 commonroad-vehicle-models==3.0.2 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 imageio==2.38.1 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 antlr4-python3-runtime==4.9.3 osqp==0.6.7.post3 packaging==26.4 pandas==3.1.1 pillow==13.0.0 Polygon3==3.0.9.1 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==4.0.0 PyYAML==6.0.4 qdldl==0.1.9.post1 rtree==1.4.1 scipy==1.17.1 shapely==2.2.0 six==1.17.0 tqdm==4.70.1
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { grep -v nanobind errors | tail -3 >&2; exit 1; }
import math
from dataclasses import replace
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
from commonroad_idm_planner.configuration.planner_config import IDMConfigFactory
from commonroad_idm_planner.idm_path import IDMPathFactory
from commonroad_idm_planner.idm_planner import IDMPlanner

print('commonroad-idm-planner', version('commonroad-idm-planner'))
V, GAP, A, S0, T, LENGTH = 20.0, 145.0, 0.73, 2.0, 1.6, 5.0


def at(x, velocity):
    return InitialState(time_step=0, position=np.array([x, 0.0]), orientation=0.0, velocity=velocity,
                        acceleration=0.0, yaw_rate=0.0, slip_angle=0.0)


def planned(b, seconds=2.0):
    """The first acceleration, and the velocity after some seconds."""
    scenario = Scenario(0.1)
    x = np.arange(-50.0, 1001.0, 10.0)
    scenario.add_objects(Lanelet(np.c_[x, 0 * x + 2], np.c_[x, 0 * x], np.c_[x, 0 * x - 2], 1))
    stays = [KSState(time_step=k, position=np.array([GAP + LENGTH, 0.0]), orientation=0.0, velocity=0.0,
                     steering_angle=0.0) for k in range(1, 301)]
    body = Rectangle(LENGTH, 1.8)
    scenario.add_objects(DynamicObstacle(10, ObstacleType.CAR, body, at(GAP + LENGTH, 0.0),
                                         TrajectoryPrediction(Trajectory(1, stays), body)))
    goal = CustomState(time_step=Interval(0, 1000), position=Rectangle(10.0, 4.0, np.array([900.0, 0.0])))
    settings = replace(IDMConfigFactory.generate_default_config(), v_desired=V, maximum_acceleration=A,
                       desired_deceleration=b, planning_horizon=round(seconds / 0.1))
    path = np.arange(-20.0, 1000.005, 0.01)
    planner = IDMPlanner(scenario, PlanningProblem(1, at(0.0, V), GoalRegion([goal])), settings,
                         IDMPathFactory.generate_idm_path_from_np_2d_positional_array(np.c_[path, 0 * path]))
    states = planner.plan().state_list
    return states[1].acceleration, states[round(seconds / 0.1)].velocity


def model(b):
    """The model's acceleration at the same moment."""
    wanted = S0 + V * T + V * V / (2 * math.sqrt(A * b))
    return A * (1 - 1 - (wanted / GAP) ** 2)


found = []
for b in (1.0, 1.0 / A, 1.67, 4.0, 8.0):
    first, later = planned(b)
    found.append((b, first, later))
    print(f'b {b:.2f} m/s²: first acceleration {first:6.2f} m/s², of the model {model(b):6.2f} m/s²; after 2 s {later:.1f} m/s')
ok = all(x[1] > y[1] and x[2] > y[2] for x, y in zip(found, found[1:]))
ok = ok and all(model(x[0]) < model(y[0]) for x, y in zip(found, found[1:]))
ok = ok and abs(found[1][1] - model(1.0 / A)) < 0.05
ok = ok and all(abs(first + A * ((S0 + V * T + V * V / 2 * math.sqrt(A * b)) / GAP) ** 2) < 0.05 for b, first, _ in found)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
