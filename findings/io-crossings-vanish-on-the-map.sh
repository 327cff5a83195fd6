#!/usr/bin/env bash
# commonroad-io: compute_polyline_intersections finds no crossing a kilometre away
# from the origin.
#
# Expected: where two polylines cross does not depend on where the map lies; at
# most some digits are lost.
# What happens: a crossing point is kept only if is_point_on_polyline says it lies
# on both lines, and that compares an AREA with 1e-12, for points that were just
# rounded. At the origin most crossings are found, at (1000, 1000) and
# in UTM coordinates the answer is an empty array. At the origin, too, one
# crossing in seven is missed, and at 1 km is_point_on_polyline denies nearly half
# of the segments their own midpoint. Shapely finds all.
# Why it matters: conflict points (post-encroachment time, intersections of
# reference paths) are silently absent on real maps, while all tests near the
# origin pass.
#
# Output seen:
#   commonroad-io 2024.3
#   shapely 2.2.0
#   origin  of 200 crossing pairs: commonroad-io 171, shapely 200; segments that contain their midpoint 200
#   1 km    of 200 crossing pairs: commonroad-io   0, shapely 200; segments that contain their midpoint 111
#   UTM     of 200 crossing pairs: commonroad-io   0, shapely 200; segments that contain their midpoint 200
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
from shapely.geometry import LineString
from commonroad.geometry.polyline_util import compute_polyline_intersections, is_point_on_polyline

rng = np.random.default_rng(0)
rates = {}
for name, offset in (("origin", (0.0, 0.0)), ("1 km", (1000.0, 1000.0)), ("UTM", (690000.0, 5300000.0))):
    ours = shapely = middles = 0
    for _ in range(200):
        angle = rng.uniform(0.0, np.pi)
        c, s = np.cos(angle), np.sin(angle)
        one = np.array([[-50 * c, -50 * s], [50 * c, 50 * s]]) + offset
        two = np.array([[40 * s, -40 * c], [-40 * s, 40 * c]]) + rng.uniform(-20, 20, 2) + offset
        ours += len(compute_polyline_intersections(one, two)) > 0
        shapely += LineString(one).intersects(LineString(two))
        middles += is_point_on_polyline(one, one.mean(axis=0))
    rates[name] = (ours, shapely, middles)
    print(f"{name:7s} of 200 crossing pairs: commonroad-io {ours:3d}, shapely {shapely}; segments that contain their midpoint {middles}")
assert all(value[1] == 200 for value in rates.values())
assert rates["UTM"][0] == 0 and rates["1 km"][0] < 20
print("behaviour as stated")
PY
