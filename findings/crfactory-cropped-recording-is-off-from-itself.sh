#!/usr/bin/env bash
# CommonRoad scenario factory: by its Waymo metrics a recording that is cut differs from itself by metres, and who starts late misses less.
#
# Expected: displacement errors compare two trajectories of one car at equal times, so that the same recording, cropped by the factory's own
# function to begin 2 s later, is 0 m off; the miss rate after 3 s is the share of states up to 3 s that are too far off.
# What happens: an obstacle that begins 20 steps later than in the reference is compared with the reference another 20 steps on:
# 20 m off at 10 m/s, the final displacement after 8 s is missing, and the miss rate, which compares equal times, is 0 all the same.
# The miss rate counts the states up to the end, for 3, 5 and 8 s alike, and divides by the number of the last time step: a car that
# leaves its lane after 6 s has missed 39 % within 3 s (displacement 0), and one that is 3.2 m beside all the
# time misses 100 %, 50 % or 25 %, as the scenario begins at step 0, 100 or 300.
# The traffic density averages from step 0: nine cars on 900 m of lanes are 10, 5 or 2.5 cars for every km.
# Why it matters: the numbers say how real a simulated scenario is; scenarios cut out of recordings begin anywhere.
#
# Output seen:
#   commonroad-scenario-factory 2.1.0
#   commonroad-io 2024.3
#   after 3, 5 and 8 s
#   the recording and itself: average displacement 0.0 0.0 0.0 m, final 0.0 0.0 0.0 m, misses 0.00 0.00 0.00
#   the recording from step 20 on, and itself: average displacement 20.0 20.0 nan m, final 20.0 20.0 nan m, misses 0.00 0.00 0.00
#   beside the lane from 6 s on: average displacement 0.0 0.0 5.2 m, final 0.0 0.0 20.0 m, misses 0.39 0.39 0.39
#   3.2 m beside, from step 0 on: average displacement 3.2 3.2 3.2 m, final 3.2 3.2 3.2 m, misses 1.00 1.00 1.00
#   nine cars on 900 m from step 0 on: 10.0 cars/km
#   3.2 m beside, from step 100 on: average displacement 3.2 3.2 3.2 m, final 3.2 3.2 3.2 m, misses 0.50 0.50 0.50
#   nine cars on 900 m from step 100 on: 5.0 cars/km
#   3.2 m beside, from step 300 on: average displacement 3.2 3.2 3.2 m, final 3.2 3.2 3.2 m, misses 0.25 0.25 0.25
#   nine cars on 900 m from step 300 on: 2.5 cars/km
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps casadi==3.8.2 cloudpickle==3.1.3 commonroad-clcs==2025.2.0 commonroad-crime==0.4.5 commonroad-drivability-checker==2025.3.1 commonroad-io==2024.3 commonroad-labeling==2025.1.2 commonroad-reach==2025.2.0 commonroad-reactive-planner==2025.1 commonroad-route-planner==2025.1.0 commonroad-vehicle-models==3.0.2 contourpy==1.3.3 cycler==0.12.1 Cython==3.3.1 fonttools==4.68.0 ImageIO==2.38.1 iso3166==3.0.0 joblib==1.6.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 methodtools==0.4.7 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 opencv-python==4.14.0.94 osqp==0.6.7.post3 packaging==26.4 pandas==2.3.3 pillow==13.0.0 Polygon3==3.0.9.1 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==4.0.0 pytz==2026.6 PyYAML==6.0.4 qdldl==0.1.9.post1 rtree==1.4.1 scikit-learn==1.9.1 scipy==1.17.1 seaborn==0.13.2 shapely==2.2.0 six==1.17.0 threadpoolctl==3.8.0 tqdm==4.70.1 triangle==20250106 tzdata==2026.6 wirerope==1.0.0 commonroad-scenario-factory==2.1.0 typing_extensions==4.16.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import numpy as np
from commonroad.geometry.shape import Rectangle
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario, ScenarioID
from commonroad.scenario.state import CustomState, InitialState
from commonroad.scenario.trajectory import Trajectory
from scenario_factory.metrics import compute_general_scenario_metric, compute_waymo_metric
from scenario_factory.utils import crop_scenario_to_time_frame

for name in ('commonroad-scenario-factory', 'commonroad-io'):
    print(name, version(name))
STEP, SPEED, FRAMES, WIDTH = 0.1, 10.0, 100, 3.5


def traffic(begin=0, beside=0.0, leaves=None, cars=2):
    """Cars at 10 m/s to the east on three lanes of 300 m, seen for 10 s, some of it beside their lane from a step on."""
    scenario, x = Scenario(STEP, ScenarioID()), np.linspace(0.0, 300.0, 31)
    for lane in range(3):
        right, centre, left = (np.column_stack([x, np.full(31, lane * WIDTH + shift)]) for shift in (-WIDTH / 2, 0.0, WIDTH / 2))
        scenario.add_objects(Lanelet(left, centre, right, lane + 1))
    steps = np.arange(FRAMES + 1)
    for number in range(cars):
        y = number % 3 * WIDTH + np.where(steps > (-1 if leaves is None else leaves), beside, 0.0)
        places = np.column_stack([20.0 + SPEED * STEP * steps, y])
        first = InitialState(time_step=begin, position=places[0], orientation=0.0, velocity=SPEED, acceleration=0.0, yaw_rate=0.0, slip_angle=0.0)
        later = [CustomState(time_step=int(begin + k), position=places[k], orientation=0.0, velocity=SPEED) for k in steps[1:]]
        shape = Rectangle(4.5, 1.8)
        scenario.add_objects(DynamicObstacle(100 + number, ObstacleType.CAR, shape, first, TrajectoryPrediction(Trajectory(begin + 1, later), shape)))
    return scenario


def show(name, metric):
    """Print the metrics after 3, 5 and 8 s."""
    print(f'{name}: average displacement {metric.ade3:.1f} {metric.ade5:.1f} {metric.ade8:.1f} m, '
          f'final {metric.fde3:.1f} {metric.fde5:.1f} {metric.fde8:.1f} m, misses {metric.mr3:.2f} {metric.mr5:.2f} {metric.mr8:.2f}')
    return metric


print('after 3, 5 and 8 s')
same = show('the recording and itself', compute_waymo_metric(traffic(), traffic()))
cut = show('the recording from step 20 on, and itself', compute_waymo_metric(crop_scenario_to_time_frame(traffic(), 20), traffic()))
late = show('beside the lane from 6 s on', compute_waymo_metric(traffic(beside=20.0, leaves=60), traffic()))
ok = same.ade3 == same.fde8 == same.mr8 == 0.0 and abs(cut.ade3 - 20.0) < 0.1 and abs(cut.fde5 - 20.0) < 0.1 and np.isnan(cut.fde8) and cut.mr3 == 0.0
ok = ok and late.fde5 == 0.0 and abs(late.mr3 - 39 / 99) < 0.01 and late.mr3 == late.mr5 == late.mr8
for begin, misses, density in ((0, 1.0, 10.0), (100, 0.5, 5.0), (300, 0.25, 2.5)):
    beside = show(f'3.2 m beside, from step {begin} on', compute_waymo_metric(traffic(begin, beside=3.2), traffic(begin)))
    counted = compute_general_scenario_metric(traffic(begin, cars=9)).traffic_density_mean
    print(f'nine cars on 900 m from step {begin} on: {counted:.1f} cars/km')
    ok = ok and abs(beside.mr3 - misses) < 0.01 and abs(beside.mr8 - misses) < 0.01 and abs(counted - density) < 0.1
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
