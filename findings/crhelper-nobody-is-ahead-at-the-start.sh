#!/usr/bin/env bash
# commonroad-helper-functions: at step 0 nobody is ahead, cars are seen and hit that come 10 s later, and a car that leaves hides all crashes.
#
# Expected: the car 40 m ahead on the lane is the leader at every step; who is visible or collides at a step is there at that step; and two
# cars that overlap collide, whoever else is in the scenario, and in whatever order.
# What happens: for the leader and the follower the ego's place at step 0 is the last one of its trajectory: 60 m further on, the car ahead is
# no longer so, and the one 40 m behind is 100 m behind. A step is an index into the list of states, whatever step that begins with: a car
# that appears at step 100 is visible at step 0, and collides at step 30 with one that was there 10 s before. And if one of
# two obstacles has too short a trajectory, the rest of the pairs is left out: the crash of the first car with the third is found
# if the third is named before the second, which has left by then.
# Why it matters: recordings cut into scenarios have cars that come late and leave early, and planners ask for the leader at step 0 first.
#
# Output seen:
#   commonroad-helper-functions 1.0.0
#   commonroad-io 2024.3
#   40 m apart, step 0: leader None, follower 100 at -100 m
#   40 m apart, step 1: leader 200 at 40 m, follower 100 at -40 m
#   40 m apart, step 30: leader 200 at 40 m, follower 100 at -40 m
#   car 300 appears at step 100; visible at step 0: [100, 300]
#   car 300 comes to the place of 100 at step 100; collisions at step 30: [[100, 300]]
#   cars 100 and 400 overlap, 500 is 100 m ahead until step 20; collisions at step 30: [[100, 400]] with 400 before 500, [] with 500 before 400
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps commonroad-helper-functions==1.0.0 commonroad-io==2024.3 commonroad-vehicle-models==3.0.2 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 packaging==26.4 pillow==13.0.0 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==4.0.0 PyYAML==6.0.4 rtree==1.4.1 scipy==1.17.1 shapely==2.2.0 six==1.17.0 tqdm==4.70.1
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from contextlib import redirect_stdout
from importlib.metadata import version
from io import StringIO

import numpy as np
from commonroad.geometry.shape import Rectangle
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import CustomState, InitialState
from commonroad.scenario.trajectory import Trajectory
from commonroad_helper_functions.collision_check import collision_check
from commonroad_helper_functions.sensor_model import get_visible_objects
from commonroad_helper_functions.spacial import get_follower_on_lanelet, get_leader_on_lanelet

for name in ('commonroad-helper-functions', 'commonroad-io'):
    print(name, version(name))
SPEED, STEP = 10.0, 0.1


def scene(*cars):
    """A lane of 300 m to the east with cars at 10 m/s: number, first place, first step and number of steps."""
    scenario, x = Scenario(STEP), np.linspace(0.0, 300.0, 31)
    right, centre, left = (np.column_stack([x, np.full(31, y)]) for y in (-1.75, 0.0, 1.75))
    scenario.add_objects(Lanelet(left, centre, right, 1))
    for number, place, begin, length in cars:
        places = np.column_stack([place + SPEED * STEP * np.arange(length + 1), np.zeros(length + 1)])
        first = InitialState(time_step=begin, position=places[0], orientation=0.0, velocity=SPEED, acceleration=0.0, yaw_rate=0.0, slip_angle=0.0)
        later = [CustomState(time_step=begin + k, position=places[k], orientation=0.0, velocity=SPEED) for k in range(1, length + 1)]
        shape = Rectangle(4.5, 1.8)
        scenario.add_objects(DynamicObstacle(number, ObstacleType.CAR, shape, first, TrajectoryPrediction(Trajectory(begin + 1, later), shape)))
    return scenario


behind, ahead = (100, 20.0, 0, 60), (200, 60.0, 0, 60)
two, ok = scene(behind, ahead), True
two.assign_obstacles_to_lanelets(time_steps=list(range(60)))
for step in (0, 1, 30):
    leader, distance, _ = get_leader_on_lanelet(two, 100, 1, step)
    follower, back, _ = get_follower_on_lanelet(two, 200, 1, step)
    print(f'40 m apart, step {step}: leader {leader}' + (f' at {distance:.0f} m' if leader else '') + f', follower {follower} at {back:.0f} m')
    ok = ok and follower == 100 and ((leader is None and abs(back + 100.0) < 0.1) if step == 0 else leader == 200 and abs(distance - 40.0) < 0.1 > abs(back + 40.0))
LATE = (300, 30.0, 100, 60)
seen, _ = get_visible_objects(scene(behind, LATE), 0, np.array([20.0, 0.0]), occlusions=False)
print(f'car 300 appears at step 100; visible at step 0: {seen}')
ok = ok and 300 in seen


def crashes(step, *cars):
    """Pairs that collide at a step."""
    with redirect_stdout(StringIO()):
        return collision_check(scene(*cars), step)[1]


late = crashes(30, behind, (300, 20.0, 100, 60))
print(f'car 300 comes to the place of 100 at step 100; collisions at step 30: {late}')
touching, leaves = (400, 20.5, 0, 60), (500, 120.0, 0, 20)
before, after = crashes(30, behind, touching, leaves), crashes(30, behind, leaves, touching)
print(f'cars 100 and 400 overlap, 500 is 100 m ahead until step 20; collisions at step 30: {before} with 400 before 500, {after} with 500 before 400')
ok = ok and late == [[100, 300]] and before == [[100, 400]] and after == []
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
