#!/usr/bin/env bash
# commonroad-io: the occupancy of an obstacle whose uncertain position is a polygon
# does not cover the obstacle.
#
# Expected: for uncertain states occupancy_at_time_step returns an enclosing set
# (the method cited in the source encloses): wherever in the polygon the vehicle
# stands, it lies inside.
# What happens: the rectangle has the extent of the polygon's bounding box, but it
# is centred at the polygon's CENTROID. The two centres differ for any polygon
# that is not symmetric. For a triangular set of positions (a fan behind a
# junction) the vehicle sticks out by several metres, and the error grows with
# the set. Rectangles and circles are covered.
# Why it matters: collision checks against perception uncertainty or predicted
# sets are then not conservative, which is their only purpose.
#
# Output seen:
#   commonroad-io 2024.3
#   shapely 2.2.0
#   rectangle     occupied x from -2.00 to 22.00; at the worst corner 0 % of the car is outside
#   triangle      occupied x from 1.33 to 25.33; at the worst corner 83 % of the car is outside
#   long triangle occupied x from 8.00 to 72.00; at the worst corner 100 % of the car is outside
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-io==2024.3 numpy==2.4.6 scipy==1.17.1 shapely==2.2.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
for name in ['commonroad-io', 'shapely']:
    print(name, version(name))
import numpy as np
from shapely.affinity import translate
from commonroad.geometry.shape import Polygon, Rectangle
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.state import CustomState
from commonroad.scenario.trajectory import Trajectory

car = Rectangle(4.0, 2.0)
sets = {
    "rectangle": Rectangle(20.0, 2.0, np.array([10.0, 0.0])),
    "triangle": Polygon(np.array([[0.0, 0.0], [20.0, -1.0], [20.0, 1.0]])),
    "long triangle": Polygon(np.array([[0.0, 0.0], [60.0, -3.0], [60.0, 3.0]])),
}
found = {}
for name, positions in sets.items():
    state = CustomState(time_step=1, position=positions, orientation=0.0, velocity=5.0)
    prediction = TrajectoryPrediction(Trajectory(1, [state]), car)
    occupied = prediction.occupancy_at_time_step(1).shape.shapely_object
    outside = max(translate(car.shapely_object, *p).difference(occupied.buffer(1e-9)).area
                  for p in positions.shapely_object.exterior.coords)
    low, high = occupied.bounds[0], occupied.bounds[2]
    found[name] = outside / car.shapely_object.area
    print(f"{name:13s} occupied x from {low:.2f} to {high:.2f}; at the worst corner {100 * found[name]:.0f} % of the car is outside")
assert found["rectangle"] == 0.0 and found["triangle"] > 0.5 and found["long triangle"] == 1.0
print("behaviour as stated")
PY
