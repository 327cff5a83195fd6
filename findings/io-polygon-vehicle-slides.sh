#!/usr/bin/env bash
# commonroad-io and drivability checker: a vehicle given as a polygon turns about
# its centroid, not about the position in its state.
#
# Expected: the shape is given in the vehicle's own frame (position = origin of
# that frame), so at heading psi each vertex is position + R(psi) vertex; this is
# how a rectangle (centred) is placed.
# What happens: Polygon.rotate_translate_local rotates about the polygon's centroid
# and keeps the centroid's offset unrotated. A 10 m truck whose origin is 1 m
# ahead of its rear end stands, heading north, 4 m to the east and 4 m to the
# south of where it is. The collision object made from it misses an obstacle at
# the truck's nose and hits one beside it. The error is zero only for a polygon
# whose centroid is its origin: not for a reference point at the rear axle, and
# not for an asymmetric outline.
# Why it matters: rear-axle references and tapered outlines are common in
# recorded data; at heading 0 (and so in most tests) all is well.
#
# Output seen:
#   commonroad-io 2024.3
#   commonroad-drivability-checker 2025.4.0
#   heading  0: occupied [-1.0, -1.0] to [9.0, 1.0], should be [-1.0, -1.0] to [9.0, 1.0]; obstacle at the nose hit True, beside hit False
#   heading 90: occupied [3.0, -5.0] to [5.0, 5.0], should be [-1.0, -1.0] to [1.0, 9.0]; obstacle at the nose hit False, beside hit True
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-io==2024.3 numpy==2.4.6 scipy==1.17.1 shapely==2.2.0 commonroad-drivability-checker==2025.4.0 commonroad-vehicle-models==3.0.2
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
for name in ['commonroad-io', 'commonroad-drivability-checker']:
    print(name, version(name))
import numpy as np
from commonroad.geometry.shape import Polygon
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.state import KSState
from commonroad.scenario.trajectory import Trajectory
from commonroad_dc import pycrcc
from commonroad_dc.collision.collision_detection.pycrcc_collision_dispatch import create_collision_object

outline = np.array([[-1.0, -1.0], [-1.0, 1.0], [9.0, 1.0], [9.0, -1.0]])
truck = Polygon(outline)
found = {}
for heading in (0.0, np.pi / 2):
    state = KSState(time_step=0, position=np.array([0.0, 0.0]), orientation=heading, velocity=0.0, steering_angle=0.0)
    prediction = TrajectoryPrediction(Trajectory(0, [state]), truck)
    vertices = prediction.occupancy_at_time_step(0).shape.vertices
    c, s = np.cos(heading), np.sin(heading)
    true = outline @ np.array([[c, s], [-s, c]])
    body = create_collision_object(prediction)
    nose = bool(body.collide(pycrcc.Circle(0.2, 8.0 * c, 8.0 * s)))
    beside = bool(body.collide(pycrcc.Circle(0.2, 4.0, -3.0)))
    found[heading] = (vertices.min(axis=0).round(6).tolist(), vertices.max(axis=0).round(6).tolist(), nose, beside)
    print(f"heading {np.degrees(heading):2.0f}: occupied {found[heading][0]} to {found[heading][1]}, should be "
          f"{true.min(axis=0).round(6).tolist()} to {true.max(axis=0).round(6).tolist()}; obstacle at the nose hit {nose}, beside hit {beside}")
assert found[0.0] == ([-1.0, -1.0], [9.0, 1.0], True, False)
assert found[np.pi / 2] == ([3.0, -5.0], [5.0, 5.0], False, True)
print("behaviour as stated")
PY
