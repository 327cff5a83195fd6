#!/usr/bin/env bash
# drivability checker: CollisionChecker.raytrace returns the hit segments in no order,
# and some of them from exit to entry.
#
# Expected: the pieces of the ray inside obstacles, from near to far, each from where
# the ray enters to where it leaves: result[0][:2] is the nearest hit.
# What happens with join = False: obstacles come in the order of an internal tree, a
# box may be listed entry first and a circle exit first, a polygon is listed once per
# triangle with internal seams. The first point of the first segment is 50 m away
# where the nearest obstacle is at 9 m. With join = True the list is sorted, and
# touching obstacles become one piece.
# Why it matters: free-sight distance and lidar-style features take the first entry;
# here they overestimate the free distance by 41 m.
#
# Output seen:
#   commonroad-drivability-checker 2025.4.0
#   join=False: [(50.0, 49.0), (50.0, 51.0), (39.0, 41.0), (29.0, 31.0), (19.0, 21.0), (11.0, 9.0)]
#   join=True:  [(9.0, 11.0), (19.0, 21.0), (29.0, 31.0), (39.0, 41.0), (49.0, 51.0)]
#   first entry 50.0 m, nearest obstacle 9.0 m
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-io==2024.3 numpy==2.4.6 scipy==1.17.1 shapely==2.2.0 commonroad-drivability-checker==2025.4.0 commonroad-vehicle-models==3.0.2
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
for name in ['commonroad-drivability-checker']:
    print(name, version(name))
import numpy as np
from commonroad.geometry.shape import Polygon
from commonroad_dc import pycrcc
from commonroad_dc.collision.collision_detection.pycrcc_collision_dispatch import create_collision_object

checker = pycrcc.CollisionChecker()
checker.add_collision_object(pycrcc.Circle(1.0, 10.0, 0.0))
for x in (20.0, 30.0, 40.0):
    checker.add_collision_object(pycrcc.RectAABB(1.0, 1.0, x, 0.0))
checker.add_collision_object(create_collision_object(Polygon(np.array([[49, -1], [51, -1], [51, 1], [49, 1.0]]))))
apart = [(segment[0], segment[2]) for segment in checker.raytrace(0.0, 0.0, 100.0, 0.0, False)]
joined = [(segment[0], segment[2]) for segment in checker.raytrace(0.0, 0.0, 100.0, 0.0, True)]
print("join=False:", apart)
print("join=True: ", joined)
print("first entry", apart[0][0], "m, nearest obstacle", min(min(pair) for pair in apart), "m")
assert [round(a, 6) for a, _ in joined] == sorted(round(a, 6) for a, _ in joined) and abs(joined[0][0] - 9.0) < 1e-6
assert apart != sorted(apart) and any(a > b for a, b in apart) and any(a < b for a, b in apart)
assert apart[0][0] > 11.5
print("behaviour as stated")
PY
