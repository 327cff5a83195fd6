#!/usr/bin/env bash
# frenet-system-creator: a quarter of the points of a U-turn are 38 m beside the path that they make.
#
# Expected: a point of the reference path has the lateral offset 0 and its own arc length, on any path that does not cross itself.
# What happens: so it is on straight and winding roads and on a ring. On a path that goes 120 m ahead, turns by 180 degrees with
# 15 m radius and comes back, 35 of 147 of its own points, those between 4 and 72 m, lie on the way back: up to 38 m beside it
# and up to 275 m further on. The distance to the path has two minima there, and a bounded search for one of them takes
# either; which one is decided by the length of the path, not by the point.
# Why it matters: a car that drives down the first leg is, to a planner in this frame, at the end of its route.
#
# Output seen:
#   frenet-system-creator 0.3.0
#   a straight road: 0 of 147 of its own points are off it, by up to 0.0 m, and up to 0 m from where they are along it
#   a winding road: 0 of 147 of its own points are off it, by up to 0.0 m, and up to 0 m from where they are along it
#   a ring: 0 of 147 of its own points are off it, by up to 0.0 m, and up to 0 m from where they are along it
#   a U-turn: 35 of 147 of its own points are off it, by up to 38.5 m, and up to 275 m from where they are along it
#   those of the U-turn are at 4 to 72 m
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps frenet-system-creator==0.3.0 numpy==2.2.6 scipy==1.17.1
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import numpy as np
from frenet_system_creator import FrenetSystem

print('frenet-system-creator', version('frenet-system-creator'))
PLACES = np.arange(0.0, 302.0, 2.0)


def path(curvature):
    """A path of points 2 m apart with a curvature by its length."""
    heading = 2.0 * np.cumsum(curvature)
    return 2.0 * np.cumsum(np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)


turning = (PLACES > 120.0) & (PLACES < 120.0 + 15.0 * np.pi)
ROADS = {'a straight road': 0.0 * PLACES, 'a winding road': 0.03 * np.sin(PLACES / 20.0), 'a ring': 0.0 * PLACES + 1.0 / 60.0,
         'a U-turn': turning / 15.0}
lost = {}
for name, curvature in ROADS.items():
    points = path(curvature)
    frame = FrenetSystem(points)
    own = [frame.cartesian2ds_frame(point)[0] for point in points[2:-2]]
    beside, along = np.abs(np.array(own) - np.column_stack([0.0 * frame.s_values, frame.s_values])[2:-2]).T
    lost[name] = beside > 0.1
    print(f'{name}: {np.sum(lost[name])} of {len(own)} of its own points are off it, by up to {beside.max():.1f} m, '
          f'and up to {along.max():.0f} m from where they are along it')
gone = PLACES[2:-2][lost['a U-turn']]
print(f'those of the U-turn are at {gone.min():.0f} to {gone.max():.0f} m')
ok = not any(lost[name].any() for name in ROADS if name != 'a U-turn') and lost['a U-turn'].sum() > 25
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
