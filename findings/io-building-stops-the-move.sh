#!/usr/bin/env bash
# commonroad-io: a scenario with an environment obstacle (a building) cannot be moved:
# translate_rotate moves the road and all traffic, then raises AttributeError.
#
# Expected: the scenario with its building is moved as a whole, or refused before
# anything is changed.
# What happens: Scenario.obstacles lists environment obstacles too, and translate_rotate
# calls a method on each that EnvironmentObstacle does not have. By then the lanelets and
# the other obstacles are at their new place already: who catches the error goes on
# with a road and cars a kilometre from the building, and a second call moves them again.
# Phantom obstacles have the same role in the format and are moved.
# Why it matters: normalising a map to its origin is the first thing many tools do, and
# buildings are what occlusion studies add to their files.
#
# Output seen:
#   commonroad-io 2024.3
#   AttributeError: 'EnvironmentObstacle' object has no attribute 'translate_rotate'
#   after the first call:  lane starts at x = 1000, car at x = 1050, building at x = 20
#   after the second call: lane starts at x = 2000, car at x = 2050, building at x = 20
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-io==2024.3 numpy==2.4.6 scipy==1.17.1 shapely==2.2.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
print("commonroad-io", version("commonroad-io"))
import numpy as np
from commonroad.geometry.shape import Polygon, Rectangle
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.obstacle import EnvironmentObstacle, ObstacleType, StaticObstacle
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import InitialState

x = np.linspace(0.0, 100.0, 11)
left, right = np.c_[x, np.full(11, 3.5)], np.c_[x, np.zeros(11)]
scenario = Scenario(0.1)
scenario.add_objects(Lanelet(left, (left + right) / 2, right, 1))
scenario.add_objects(StaticObstacle(9, ObstacleType.PARKED_VEHICLE, Rectangle(4, 2),
    InitialState(time_step=0, position=np.array([50.0, 1.75]), orientation=0.0, velocity=0.0)))
corner = np.array([[20.0, 6.0], [30.0, 6.0], [30.0, 12.0], [20.0, 12.0]])
scenario.add_objects(EnvironmentObstacle(10, ObstacleType.BUILDING, Polygon(corner)))

def places():
    lane = scenario.lanelet_network.lanelets[0].left_vertices[0, 0]
    car = scenario.static_obstacles[0].initial_state.position[0]
    building = scenario.environment_obstacle[0].obstacle_shape.vertices[:, 0].min()
    return round(float(lane)), round(float(car)), round(float(building))

seen = []
for _ in range(2):
    try:
        scenario.translate_rotate(np.array([1000.0, 0.0]), 0.0)
        said = ""
    except AttributeError as error:
        said = f"AttributeError: {error}"
    if not seen:
        print(said or "no error")
    seen.append((said, places()))
for name, (said, (lane, car, building)) in zip(("first call: ", "second call:"), seen):
    print(f"after the {name} lane starts at x = {lane}, car at x = {car}, building at x = {building}")
assert all("translate_rotate" in said for said, _ in seen)
assert [p for _, p in seen] == [(1000, 1050, 20), (2000, 2050, 20)]
print("behaviour as stated")
PY
