#!/usr/bin/env bash
# commonroad-io: after Scenario.translate_rotate the lanelets are found at their
# OLD place, and nowhere else.
#
# Expected: the network and its look-ups move together.
# What happens: lanelet.polygon is rebuilt, but the spatial index of the network
# keeps the polygons from before; find_lanelet_by_position answers [] on the road
# and the lanelet's id where the road no longer is. copy.deepcopy and a pickle
# round trip do not repair it (they rebuild the index from the same old polygons).
# assign_obstacles_to_lanelets then puts no obstacle on any lane.
# Why it matters: moving a scenario to local coordinates before planning (for
# conditioning) leaves every lane look-up, goal-lanelet and criticality measure
# empty without an error. create_from_lanelet_list gives a network that is right.
#
# Output seen:
#   commonroad-io 2024.3
#   new place lies in the lanelet's own polygon: True
#   moved     at the new place [], at the old place [1]
#   deepcopy  at the new place [], at the old place [1]
#   pickle    at the new place [], at the old place [1]
#   rebuilt   at the new place [1], at the old place []
#   the parked car that moved along is assigned to set()
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
import copy, pickle
import numpy as np
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.obstacle import StaticObstacle, ObstacleType
from commonroad.scenario.state import InitialState
from commonroad.geometry.shape import Rectangle

x = np.linspace(0.0, 100.0, 11)
left, right = np.c_[x, np.full(11, 3.5)], np.c_[x, np.zeros(11)]
scenario = Scenario(0.1)
scenario.add_objects(Lanelet(left, (left + right) / 2, right, 1))
scenario.add_objects(StaticObstacle(9, ObstacleType.PARKED_VEHICLE, Rectangle(4, 2),
    InitialState(time_step=0, position=np.array([50.0, 1.75]), orientation=0.0, velocity=0.0)))
scenario.translate_rotate(np.array([1000.0, 0.0]), 0.0)
network = scenario.lanelet_network
new, old = np.array([1050.0, 1.75]), np.array([50.0, 1.75])
inside = network.lanelets[0].polygon.contains_point(new)
answers = {
    "moved": network.find_lanelet_by_position([new, old]),
    "deepcopy": copy.deepcopy(network).find_lanelet_by_position([new, old]),
    "pickle": pickle.loads(pickle.dumps(network)).find_lanelet_by_position([new, old]),
    "rebuilt": LaneletNetwork.create_from_lanelet_list(network.lanelets).find_lanelet_by_position([new, old]),
}
print("new place lies in the lanelet's own polygon:", inside)
for key, value in answers.items():
    print(f"{key:9s} at the new place {value[0]}, at the old place {value[1]}")
scenario.assign_obstacles_to_lanelets()
assigned = scenario.static_obstacles[0].initial_shape_lanelet_ids
print("the parked car that moved along is assigned to", assigned)
assert inside and assigned == set()
assert answers["moved"] == [[], [1]]
assert answers["deepcopy"][0] == [] and answers["pickle"][0] == []
assert answers["rebuilt"] == [[1], []]
print("behaviour as stated")
PY
