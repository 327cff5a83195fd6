#!/usr/bin/env bash
# commonroad-scenario-designer: after a poly3 bend a road doubles back on itself; pyxodr reads the same file right.
#
# Expected: a road of a cubic bend (geometry poly3, 60 m long along its local axis, 63.4 m along the curve) and 30 m
# of straight road is a lane of 93.4 m on the centre line whose heading changes steadily.
# What happens: the position along the road is taken for the local coordinate u of the polynomial. The bend is
# drawn with u up to its own length, 3.9 m beyond its end, and the straight part begins where it should: the lane
# goes forward, back and forward again, is 100.4 m long, and its polygon crosses itself. Along the bend all
# that lies at a position (signs, lane widths, sections) is up to 3.9 m further on. paramPoly3 is right.
# Why it matters: headings jump by 180 degrees there, and a curvilinear coordinate system, a route length or
# a boundary made of the lane is wrong; nothing is said during the conversion.
#
# Output seen:
#   commonroad-scenario-designer 0.8.5
#   pyxodr 0.1.3
#   the curve: 63.4 m of bend and 30 m of straight road, 93.4 m
#   scenario designer, poly3: lane border of 100.4 m, largest turn between two points 179 degrees, 0.05 m off the curve
#     polygon of the lane valid: False
#   pyxodr, poly3: lane border of 93.4 m, largest turn between two points 0 degrees, 0.00 m off the curve
#   scenario designer, paramPoly3: lane border of 93.4 m, largest turn between two points 0 degrees, 0.00 m off the curve
#     polygon of the lane valid: True
#   pyxodr, paramPoly3: lane border of 93.4 m, largest turn between two points 0 degrees, 0.00 m off the curve
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps PyQt6==6.11.0 PyQt6_sip==13.13.0 PyYAML==6.0.4 antlr4-python3-runtime==4.9.3 certifi==2026.10.19.post1 charset-normalizer==3.5.3 commonroad-clcs==2025.2.0 commonroad-io==2024.3 commonroad-scenario-designer==0.8.5 commonroad-sumo==2025.1.4 commonroad-vehicle-models==3.0.2 cycler==0.12.1 fonttools==4.68.0 idna==3.20 iso3166==2.1.1 kdtree==0.16 kiwisolver==1.5.1 libsumo==1.28.0 lxml==6.1.3 matplotlib==3.11.2 mgrs==1.6.0 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 ordered-set==4.1.0 osqp==0.6.7.post3 packaging==26.4 pandas==2.3.3 pillow==13.0.0 protobuf==3.20.2 pyclothoids==0.1.5 pymetis==2025.2.2 pyparsing==3.3.3 pyproj==3.7.2 python-dateutil==4.0.0 pytz==2026.6 pyxodr==0.1.3 qdldl==0.1.9.post1 requests==2.34.2 rich==15.0.0 scipy==1.17.1 shapely==2.2.0 similaritymeasures==1.5.0 sumolib==1.28.0 tqdm==4.70.1 traci==1.28.0 typing_extensions==4.16.0 urllib3==2.8.0 PyQt6-Qt6==6.11.2 commonroad-drivability-checker==2025.4.0 Polygon3==3.0.9.1 mercantile==1.2.1 PyGeodesy==23.12.29 rtree==1.4.1 six==1.17.0 utm==0.7.0 click==8.5.1 sumo-data==1.28.0 contourpy==1.3.3
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { grep -v nanobind errors | tail -3 >&2; exit 1; }
import math
from importlib.metadata import version
from pathlib import Path

import numpy as np
import shapely
from crdesigner.map_conversion.map_conversion_interface import opendrive_to_commonroad
from pyxodr.road_objects.network import RoadNetwork

print('commonroad-scenario-designer', version('commonroad-scenario-designer'))
print('pyxodr', version('pyxodr'))
U, C, STRAIGHT, WIDTH = 60.0, 0.005, 30.0, 3.0
u = np.linspace(0.0, U, 60001)
bend = np.c_[u, C * u**2]
length = float(np.linalg.norm(np.diff(bend, axis=0), axis=1).sum())
heading = math.atan(2 * C * U)
end = bend[-1] + STRAIGHT * np.array([math.cos(heading), math.sin(heading)])
truth = shapely.LineString(np.vstack([bend, end]))


def written(first):
    """A road whose first part is `first`, then straight, with one lane right of its centre line."""
    return f"""<?xml version="1.0"?>
<OpenDRIVE><header revMajor="1" revMinor="4" name="" version="1" north="0" south="0" east="0" west="0"/>
<road name="" length="{length + STRAIGHT}" id="1" junction="-1"><link/><type s="0" type="town"/>
<planView><geometry s="0" x="0" y="0" hdg="0" length="{length}">{first}</geometry>
<geometry s="{length}" x="{U}" y="{C * U * U}" hdg="{heading}" length="{STRAIGHT}"><line/></geometry></planView>
<elevationProfile/><lateralProfile/>
<lanes><laneSection s="0"><center><lane id="0" type="none" level="false"><link/></lane></center>
<right><lane id="-1" type="driving" level="false"><link/><width sOffset="0" a="{WIDTH}" b="0" c="0" d="0"/></lane></right>
</laneSection></lanes></road></OpenDRIVE>"""


def described(name, line):
    steps = np.diff(line, axis=0)
    steps = steps[np.linalg.norm(steps, axis=1) > 1e-6]
    turns = np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
    far = float(np.linalg.norm(steps, axis=1).sum())
    turn = math.degrees(np.abs(turns).max())
    print(f'{name}: lane border of {far:.1f} m, largest turn between two points {turn:.0f} degrees, '
          f'{shapely.distance(shapely.points(line), truth).max():.2f} m off the curve')
    return far, turn


print(f'the curve: {length:.1f} m of bend and {STRAIGHT:.0f} m of straight road, {length + STRAIGHT:.1f} m')
found = {}
forms = {'poly3': f'<poly3 a="0" b="0" c="{C}" d="0"/>',
         'paramPoly3': f'<paramPoly3 aU="0" bU="{U}" cU="0" dU="0" aV="0" bV="0" cV="{C * U * U}" dV="0" pRange="normalized"/>'}
for form, text in forms.items():
    path = Path('road.xodr')
    path.write_text(written(text))
    lane, = opendrive_to_commonroad(path).lanelet_network.lanelets
    found['designer', form] = *described(f'scenario designer, {form}', lane.left_vertices), lane.polygon.shapely_object.is_valid
    print(f'  polygon of the lane valid: {found["designer", form][2]}')
    road, = RoadNetwork(str(path), resolution=0.1).get_roads()
    found['pyxodr', form] = described(f'pyxodr, {form}', road.reference_line[:, :2])
far, turn, valid = found['designer', 'poly3']
ok = abs(far - 100.4) < 0.5 and turn > 170.0 and not valid
ok = ok and found['designer', 'paramPoly3'][2]
ok = ok and all(abs(found[key][0] - length - STRAIGHT) < 0.2 and found[key][1] < 5.0 for key in found if key != ('designer', 'poly3'))
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
