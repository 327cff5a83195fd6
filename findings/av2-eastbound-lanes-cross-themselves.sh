#!/usr/bin/env bash
# av2 (Argoverse 2): the polygon of a lane that runs east at first crosses itself, and has half of its area.
#
# Expected: centerline_to_polygon makes a lane's area of 3.8 m from its centre line, and get_double_polylines two lines, the
# left and the right one, whichever way the lane runs on the map.
# What happens: left and right are told by the signs of dx and dy. Where one of them is exactly 0 and the lane runs east,
# north or south the sides are exchanged, compared with all other headings. A lane of 100 m to the east with a lane change
# in its middle is an invalid polygon of 212 m² (381 m²) without a fifth of its centre line; to the west it is right,
# and so it is turned by a thousandth of a radian. Of the double lines of a straight road the left one is the right one.
# Why it matters: roads that run along an axis are those of every synthetic map and every test; a map from a survey passes.
#
# Output seen:
#   av2 0.3.6
#   east: valid False, 212 of 381 m², 78 % of the centre line inside; the left of the double lines is on the right
#   east + 0.001 rad: valid True, 381 of 381 m², 100 % of the centre line inside; the left of the double lines is on the left
#   north: valid False, 212 of 381 m², 78 % of the centre line inside; the left of the double lines is on the right
#   west: valid True, 381 of 381 m², 100 % of the centre line inside; the left of the double lines is on the left
#   south: valid False, 212 of 381 m², 78 % of the centre line inside; the left of the double lines is on the right
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps av2==0.3.6 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 fsspec==2026.9.0 kiwisolver==1.5.1 matplotlib==3.11.2 numpy==2.4.6 packaging==26.4 pathlib-abc==0.5.2 pillow==13.0.0 pyparsing==3.3.3 python-dateutil==4.0.0 scipy==1.17.1 shapely==2.1.2 six==1.17.0 universal-pathlib==0.3.10
cd "$dir"
MPLCONFIGDIR="$dir" "$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import numpy as np
from av2.geometry.polyline_utils import centerline_to_polygon, get_double_polylines
from shapely import LineString, Polygon

print('av2', version('av2'))
S = np.arange(0.0, 101.0, 2.0)
STRAIGHT = np.column_stack([S, np.zeros_like(S)])
CHANGE = np.column_stack([S, 3.5 * np.clip((S - 40.0) / 20.0, 0.0, 1.0)])


def turned(points, heading):
    """The points, turned by a multiple of 90 degrees without rounding, or by any other angle."""
    quarter, rest = divmod(heading, 90.0)
    for _ in range(int(quarter)):
        points = np.column_stack([-points[:, 1], points[:, 0]])
    c, s = np.cos(np.radians(rest)), np.sin(np.radians(rest))
    return points @ np.array([[c, s], [-s, c]])


ok = True
for name, heading in (('east', 0.0), ('east + 0.001 rad', np.degrees(0.001)), ('north', 90.0), ('west', 180.0), ('south', 270.0)):
    lane = turned(CHANGE, heading) + 0.0
    polygon, strip = Polygon(centerline_to_polygon(lane)), LineString(lane).buffer(1.9, cap_style='flat')
    covered = LineString(lane).intersection(polygon.buffer(0.0)).length / LineString(lane).length
    line = turned(STRAIGHT, heading) + 0.0
    left = get_double_polylines(line, 0.1)[0]
    along, beside = line[-1] - line[0], left[0] - line[0]
    side = 'left' if along[0] * beside[1] - along[1] * beside[0] > 0.0 else 'right'
    print(f'{name}: valid {polygon.is_valid}, {polygon.area:.0f} of {strip.area:.0f} m², {100.0 * covered:.0f} % of the centre '
          f'line inside; the left of the double lines is on the {side}')
    crossed = heading in (0.0, 90.0, 270.0)
    ok = ok and polygon.is_valid != crossed and (polygon.area < 0.7 * strip.area) == crossed and (side == 'right') == crossed
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
