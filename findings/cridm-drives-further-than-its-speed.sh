#!/usr/bin/env bash
# commonroad-idm-planner: a car drives 10 to 25 % further than its speed says, or stands still while it speeds up.
#
# Expected: on a free road at its desired speed of 20 m/s a car is at 80 m after 4 s. From standstill it speeds up
# and moves, at most some centimetres wrong by the sampling of the path.
# What happens: a time step is integrated in parts of 0.01 s, one part too many: 11 for 0.1 s and 5 for 0.04 s,
# so that every step lasts 0.11 or 0.05 s. At dt = 0.1 s the car is at 88 m after 4 s, at dt = 0.04 s (that of
# recorded traffic) at 100 m, with a velocity of 20 m/s in all states; speeding up is too fast by the same factor.
# Then the car is set to the nearest point of the path. On one sampled every metre a car that starts from
# standstill stays for more than 5 s, until its velocity is 4.5 m/s, and then moves by whole metres per step.
# Why it matters: the planner is a baseline for others, and takes part in traffic as ego: its positions and its
# velocities belong to two different motions, none of which is the IDM's.
#
# Output seen:
#   commonroad-idm-planner 0.2.1
#   at its desired speed of 20 m/s, dt 0.10 s: after 4 s 88.0 m at 20.0 m/s, steps of 2.20 m
#   at its desired speed of 20 m/s, dt 0.04 s: after 4 s 100.0 m at 20.0 m/s, steps of 1.00 m
#   from standstill, path points  0.01 m apart: after 5 s 10.8 m at 4.0 m/s
#   from standstill, path points  1.00 m apart: after 5 s 0.0 m at 4.0 m/s
#   from standstill, path points  2.00 m apart: after 5 s 0.0 m at 4.0 m/s
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps commonroad-clcs==2025.2.0 commonroad-drivability-checker==2025.4.0 commonroad-idm-planner==0.2.1 commonroad-io==2024.3 commonroad-route-planner==2025.1.0 commonroad-vehicle-models==3.0.2 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 imageio==2.38.1 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 antlr4-python3-runtime==4.9.3 osqp==0.6.7.post3 packaging==26.4 pandas==3.1.1 pillow==13.0.0 Polygon3==3.0.9.1 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==4.0.0 PyYAML==6.0.4 qdldl==0.1.9.post1 rtree==1.4.1 scipy==1.17.1 shapely==2.2.0 six==1.17.0 tqdm==4.70.1
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { grep -v nanobind errors | tail -3 >&2; exit 1; }
from dataclasses import replace
from importlib.metadata import version

import numpy as np
from commonroad.common.util import Interval
from commonroad.geometry.shape import Rectangle
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import CustomState, InitialState
from commonroad_idm_planner.configuration.planner_config import IDMConfigFactory
from commonroad_idm_planner.idm_path import IDMPathFactory
from commonroad_idm_planner.idm_planner import IDMPlanner

print('commonroad-idm-planner', version('commonroad-idm-planner'))


def drive(velocity, dt, spacing, seconds):
    """States of a car alone on 1 km of straight road."""
    scenario = Scenario(dt)
    x = np.arange(-50.0, 1001.0, 10.0)
    scenario.add_objects(Lanelet(np.c_[x, 0 * x + 2], np.c_[x, 0 * x], np.c_[x, 0 * x - 2], 1))
    start = InitialState(time_step=0, position=np.zeros(2), orientation=0.0, velocity=velocity, acceleration=0.0,
                         yaw_rate=0.0, slip_angle=0.0)
    goal = CustomState(time_step=Interval(0, 1000), position=Rectangle(10.0, 4.0, np.array([900.0, 0.0])))
    settings = replace(IDMConfigFactory.generate_default_config(), v_desired=20.0,
                       planning_horizon=round(seconds / dt))
    path = np.arange(-20.0, 1000.0 + spacing / 2, spacing)
    planner = IDMPlanner(scenario, PlanningProblem(1, start, GoalRegion([goal])), settings,
                         IDMPathFactory.generate_idm_path_from_np_2d_positional_array(np.c_[path, 0 * path]))
    states = planner.plan().state_list
    return states[round(seconds / dt)], states


ok = True
for dt, far in ((0.1, 88.0), (0.04, 100.0)):
    at, states = drive(20.0, dt, 0.01, 4.0)
    steps = np.diff([s.position[0] for s in states])
    print(f'at its desired speed of 20 m/s, dt {dt:.2f} s: after 4 s {at.position[0]:.1f} m at {at.velocity:.1f} m/s, '
          f'steps of {steps.mean():.2f} m')
    ok = ok and abs(at.position[0] - far) < 0.1 and all(abs(s.velocity - 20.0) < 1e-6 for s in states)
for spacing in (0.01, 1.0, 2.0):
    at, states = drive(0.0, 0.1, spacing, 5.0)
    print(f'from standstill, path points {spacing:5.2f} m apart: after 5 s {at.position[0]:.1f} m at {at.velocity:.1f} m/s')
    ok = ok and abs(at.velocity - 4.0) < 0.1
    ok = ok and (abs(at.position[0] - 10.8) < 0.1 if spacing < 1.0 else at.position[0] == 0.0)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
