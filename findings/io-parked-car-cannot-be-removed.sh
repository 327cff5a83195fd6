#!/usr/bin/env bash
# commonroad-io: a parked car that straddles two lanes cannot be removed once
# assign_obstacles_to_lanelets has run (KeyError).
#
# Expected: assign_obstacles_to_lanelets (shapes, the default) enters the obstacle
# at every lanelet that its shape touches, as it does for dynamic obstacles, and
# remove_obstacle takes it out again.
# What happens: static obstacles are entered only at the lanelet under their
# centre. So lanelet.static_obstacles_on_lanelet says that the second lane is free
# although the car's own initial_shape_lanelet_ids names it, and
# Scenario.remove_obstacle, which goes by the shape, raises KeyError and leaves
# the car in the scenario. The same car as a dynamic obstacle works.
# Why it matters: a lane-wise obstacle query misses a car that intrudes into the
# ego lane; what-if runs ("remove the obstacle and look again") crash.
#
# Output seen:
#   commonroad-io 2024.3
#   StaticObstacle: shape on {1, 2}, lanes 1 and 2 hold [{5}, set()], KeyError 5, 1 left
#   DynamicObstacle: shape on {1, 2}, lanes 1 and 2 hold [{5}, {5}], removed, 0 left
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
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.obstacle import StaticObstacle, DynamicObstacle, ObstacleType
from commonroad.scenario.state import InitialState
from commonroad.geometry.shape import Rectangle

def lanelet(number, low):
    x = np.linspace(0.0, 100.0, 11)
    left, right = np.c_[x, np.full(11, low + 3.5)], np.c_[x, np.full(11, low)]
    return Lanelet(left, (left + right) / 2, right, number)

state = InitialState(time_step=0, position=np.array([50.0, 3.0]), orientation=0.0, velocity=0.0)
result = {}
for kind in (StaticObstacle, DynamicObstacle):
    scenario = Scenario(0.1)
    scenario.add_objects([lanelet(1, 0.0), lanelet(2, 3.5)])
    car = kind(5, ObstacleType.CAR, Rectangle(4.0, 2.0), state)
    scenario.add_objects(car)
    scenario.assign_obstacles_to_lanelets()
    lanes = [la.static_obstacles_on_lanelet if kind is StaticObstacle else la.dynamic_obstacle_by_time_step(0)
             for la in scenario.lanelet_network.lanelets]
    lanes = [set(lane) for lane in lanes]
    try:
        scenario.remove_obstacle(car)
        answer = "removed"
    except KeyError as error:
        answer = f"KeyError {error}"
    result[kind] = (set(car.initial_shape_lanelet_ids), lanes, answer, len(scenario.obstacles))
    print(f"{kind.__name__}: shape on {result[kind][0]}, lanes 1 and 2 hold {lanes}, {answer}, {result[kind][3]} left")
assert result[StaticObstacle] == ({1, 2}, [{5}, set()], "KeyError 5", 1)
assert result[DynamicObstacle] == ({1, 2}, [{5}, {5}], "removed", 0)
print("behaviour as stated")
PY
