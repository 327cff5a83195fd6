#!/usr/bin/env bash
# commonroad-io: in a trajectory with a gap, the state and the occupancy at a step are
# those of different steps.
#
# Expected: state_at_time_step(k) returns the state whose time_step is k, or None;
# append_state asks only for a larger time step, and the constructor does not look.
# What happens: states are looked up by position in the list. With states at steps
# 1, 2, 6 and 7 (occluded in between, as recordings have it) the state "at step 3"
# is the one of step 6, and there is none at 6 and 7. The occupancy, looked up by its
# time step, is missing at 3 and right at 6 and 7. The XML file keeps the gap, and
# the reader returns it.
# Why it matters: time to collision from states and collision checks from occupancies
# then contradict each other; the obstacle jumps 4 steps ahead and then vanishes.
#
# Output seen:
#   commonroad-io 2024.3
#   step 1: state x = 10.0, occupancy x = 10.0
#   step 2: state x = 20.0, occupancy x = 20.0
#   step 3: state x = 60.0, occupancy x = None
#   step 4: state x = 70.0, occupancy x = None
#   step 5: state x = None, occupancy x = None
#   step 6: state x = None, occupancy x = 60.0
#   step 7: state x = None, occupancy x = 70.0
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-io==2024.3 numpy==2.4.6 scipy==1.17.1 shapely==2.2.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
for name in ['commonroad-io']:
    print(name, version(name))
import numpy as np
from commonroad.geometry.shape import Rectangle
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.state import InitialState, KSState
from commonroad.scenario.trajectory import Trajectory

def state(k):
    return KSState(time_step=k, position=np.array([10.0 * k, 0.0]), orientation=0.0, velocity=10.0, steering_angle=0.0)

trajectory = Trajectory(1, [state(1)])
for k in (2, 6, 7):
    trajectory.append_state(state(k))
car = DynamicObstacle(1, ObstacleType.CAR, Rectangle(4.0, 2.0),
    InitialState(time_step=0, position=np.array([0.0, 0.0]), orientation=0.0, velocity=10.0),
    TrajectoryPrediction(trajectory, Rectangle(4.0, 2.0)))
rows = {}
for k in range(1, 8):
    at, occupied = car.state_at_time(k), car.occupancy_at_time(k)
    rows[k] = (None if at is None else float(at.position[0]), None if occupied is None else float(occupied.shape.center[0]))
    print(f"step {k}: state x = {rows[k][0]}, occupancy x = {rows[k][1]}")
assert rows[2] == (20.0, 20.0) and rows[3] == (60.0, None) and rows[4] == (70.0, None)
assert rows[6] == (None, 60.0) and rows[7] == (None, 70.0)
print("behaviour as stated")
PY
