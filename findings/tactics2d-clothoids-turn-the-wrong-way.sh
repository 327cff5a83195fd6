#!/usr/bin/env bash
# tactics2d: of the four clothoids of a left and a right bend only the one into the left bend is right.
#
# Expected: a clothoid from curvature k0 to k1 leaves in its given heading, turns by (k0 + k1) L / 2 and ends where
# the next element of an OpenDRIVE road begins; the clothoid into a right bend turns right.
# What happens: the curve is always that of a clothoid that begins straight and turns left. A start curvature
# only turns it as a whole, and a falling curvature is drawn as a rising one: into a right bend it turns left, out
# of a bend it begins 34 degrees from its heading. Roads read from OpenDRIVE are up to 15 m off and have a gap
# of 15 m where the next element begins. pyclothoids draws all four right.
# Why it matters: nearly all roads of OpenDRIVE maps go into and out of bends by clothoids; lane borders, the
# places where agents start and the distance to the road are wrong there, without a word.
#
# Output seen:
#   tactics2d 0.1.9
#   pyclothoids 0.2.0
#   into a left bend: begins at 0 degrees, ends at 34 degrees instead of 34, up to 0.0 m off; end of pyclothoids 0.0 m off
#   out of a left bend: begins at 34 degrees, ends at 68 degrees instead of 34, up to 15.6 m off; end of pyclothoids 0.0 m off
#   into a right bend: begins at 0 degrees, ends at 34 degrees instead of -34, up to 13.7 m off; end of pyclothoids 0.0 m off
#   out of a right bend: begins at -34 degrees, ends at -0 degrees instead of -34, up to 5.9 m off; end of pyclothoids 0.0 m off
#   road with a left bend, from OpenDRIVE: up to 15.4 m off, largest gap between two points 15.4 m
#   road with a right bend, from OpenDRIVE: up to 13.3 m off, largest gap between two points 15.4 m
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps certifi==2026.10.19.post1 defusedxml==0.7.1 geopandas==1.1.4 numpy==2.2.6 packaging==26.4 pandas==2.3.3 pyclothoids==0.2.0 pyogrio==0.13.0 pyproj==3.7.1 python-dateutil==3.0.0 pytz==2026.6 tzdata==2026.6 scipy==1.15.3 shapely==2.0.7 six==1.17.0 tactics2d==0.1.9
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import logging
import math
from importlib.metadata import version

import numpy as np
import shapely
from pyclothoids import Clothoid
from tactics2d.interpolator import Spiral
from tactics2d.map.parser import XODRParser

logging.disable(logging.CRITICAL)
print('tactics2d', version('tactics2d'))
print('pyclothoids', version('pyclothoids'))
LENGTH, K, BEND, STRAIGHT = 40.0, 0.03, 20.0, 30.0


def integrated(k0, k1, length, x=0.0, y=0.0, heading=0.0):
    """Points along a curve of linear curvature, and its heading at the end."""
    s = np.linspace(0.0, length, 20001)
    at = heading + k0 * s + (k1 - k0) * s**2 / (2 * length)
    steps = np.diff(s)[:, None] * np.c_[np.cos((at[1:] + at[:-1]) / 2), np.sin((at[1:] + at[:-1]) / 2)]
    return np.vstack([[x, y], [x, y] + np.cumsum(steps, axis=0)]), float(at[-1])


def heading_of(step):
    return math.degrees(math.atan2(step[1], step[0]))


ok = True
for name, k0, k1 in (('into a left bend', 0.0, K), ('out of a left bend', K, 0.0),
                     ('into a right bend', 0.0, -K), ('out of a right bend', -K, 0.0)):
    truth, _ = integrated(k0, k1, LENGTH)
    drawn = Spiral.get_curve(LENGTH, np.zeros(2), 0.0, k0, (k1 - k0) / LENGTH)
    other = Clothoid.StandardParams(0.0, 0.0, 0.0, k0, (k1 - k0) / LENGTH, LENGTH)
    off = float(shapely.distance(shapely.points(drawn), shapely.LineString(truth)).max())
    agrees = float(np.hypot(other.X(LENGTH) - truth[-1, 0], other.Y(LENGTH) - truth[-1, 1]))
    print(f'{name}: begins at {heading_of(drawn[1] - drawn[0]):.0f} degrees, ends at {heading_of(drawn[-1] - drawn[-2]):.0f} '
          f'degrees instead of {heading_of(truth[-1] - truth[-2]):.0f}, up to {off:.1f} m off; '
          f'end of pyclothoids {agrees:.1f} m off')
    ok = ok and agrees < 1e-3 and (off < 1e-3 if name == 'into a left bend' else off > 3.0)

for side, k in (('left', K), ('right', -K)):
    x, y, heading, s, plan, truth = 0.0, 0.0, 0.0, 0.0, '', []
    for k0, k1, length in ((0.0, 0.0, STRAIGHT), (0.0, k, LENGTH), (k, k, BEND), (k, 0.0, LENGTH), (0.0, 0.0, STRAIGHT)):
        kind = '<line/>' if k0 == k1 == 0.0 else f'<arc curvature="{k0}"/>' if k0 == k1 else f'<spiral curvStart="{k0}" curvEnd="{k1}"/>'
        plan += f'<geometry s="{s}" x="{x}" y="{y}" hdg="{heading}" length="{length}">{kind}</geometry>'
        points, heading = integrated(k0, k1, length, x, y, heading)
        (x, y), s = points[-1], s + length
        truth.append(points)
    with open('bend.xodr', 'w') as file:
        file.write(f"""<?xml version="1.0"?>
<OpenDRIVE><header revMajor="1" revMinor="6" name="" version="1" north="0" south="0" east="0" west="0"/>
<road name="" length="{s}" id="1" junction="-1"><link/><planView>{plan}</planView><elevationProfile/><lateralProfile/>
<lanes><laneSection s="0"><center><lane id="0" type="none" level="false"><link/></lane></center><right>
<lane id="-1" type="driving" level="false"><link/><width sOffset="0" a="3" b="0" c="0" d="0"/></lane></right>
</laneSection></lanes></road></OpenDRIVE>""")
    lane, = XODRParser().parse('bend.xodr').lanes.values()
    centre = np.array(lane.left_side.coords)[:, :2]
    curve = shapely.LineString(np.vstack(truth))
    off = float(shapely.distance(shapely.points(centre), curve).max())
    gap = float(np.linalg.norm(np.diff(centre, axis=0), axis=1).max())
    print(f'road with a {side} bend, from OpenDRIVE: up to {off:.1f} m off, largest gap between two points {gap:.1f} m')
    ok = ok and off > 10.0 and gap > 10.0
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
