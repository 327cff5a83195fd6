#!/usr/bin/env bash
# commonroad-io: two lanelets (or polygons) with more than 500 vertices are equal
# whatever lies in their middle.
#
# Expected: == looks at all vertices (a short lanelet does).
# What happens: the comparison goes through the printed form of the array, and an
# array with more than 1000 numbers is printed with "..." in the middle. Only the
# first and last three vertices count; the hash is the same as well, so sets and
# dicts merge the two. A lane that is one metre wider over most of its length, and
# a polygon with little more than half the area, count as equal.
# Why it matters: maps resampled to 0.1 m, and occupancies from reachability
# tools, have such lengths; "did the map change", caches and de-duplication that
# rely on == or hash answer yes for different roads.
#
# Output seen:
#   commonroad-io 2024.3
#   numpy 2.4.6
#     100 vertices, one lane 1 m wider: equal False, same hash False
#     500 vertices, one lane 1 m wider: equal False, same hash False
#     501 vertices, one lane 1 m wider: equal True, same hash True
#    2000 vertices, one lane 1 m wider: equal True, same hash True
#   polygons of area 314 and 179 m2: equal True, in a set 1
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-io==2024.3 numpy==2.4.6 scipy==1.17.1 shapely==2.2.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
for name in ['commonroad-io', 'numpy']:
    print(name, version(name))
import numpy as np
from commonroad.scenario.lanelet import Lanelet
from commonroad.geometry.shape import Polygon

def lanelet(n, bulge):
    x = np.linspace(0.0, 100.0, n)
    left, right = np.c_[x, np.full(n, 3.5)], np.c_[x, np.zeros(n)]
    left[n // 10: -n // 10, 1] += bulge
    return Lanelet(left, np.c_[x, np.full(n, 1.75)], right, 1)

found = {}
for n in (100, 500, 501, 2000):
    a, b = lanelet(n, 0.0), lanelet(n, 1.0)
    found[n] = (a == b, hash(a) == hash(b))
    print(f"{n:5d} vertices, one lane 1 m wider: equal {found[n][0]}, same hash {found[n][1]}")
angle = np.linspace(0.0, 2.0 * np.pi, 700)[:-1]
circle = 10.0 * np.c_[np.cos(angle), np.sin(angle)]
dented = circle.copy()
dented[100:500] *= 0.5
p, q = Polygon(circle), Polygon(dented)
print(f"polygons of area {p.shapely_object.area:.0f} and {q.shapely_object.area:.0f} m2: equal {p == q}, in a set {len({p, q})}")
assert found[100] == found[500] == (False, False)
assert found[501] == found[2000] == (True, True)
assert p == q and len({p, q}) == 1
print("behaviour as stated")
PY
