#!/usr/bin/env bash
# scenariogeneration: a clothoid between two arcs, given by its angle, turns up to twice as far; a ring of four quarters turns by 600 degrees.
#
# Expected: Spiral(0.02, 0.03, angle=a) is as long as it takes to turn by a: 2 a / (0.02 + 0.03).
# What happens: its length is 2 a by the larger of the two curvatures, which is right only if the other one is 0. From radius 50 to 33 m a
# quarter turns by 150 degrees, from 53 to 50 m by 176, and an S-bend from left to right by less than it should. Length and cdot
# given instead are right. Four quarters make an oval ring: with angles it turns by 600 degrees and ends 43 m from its start.
# Why it matters: ramps and roundabouts are made of such clothoids; the file is consistent in itself, since what
# follows is attached to where the road has got to.
#
# Output seen:
#   scenariogeneration 0.16.7
#   curvature 0.0 to 0.02, 90 degrees: by angle 157.1 m and 90 degrees, by length 157.1 m and 90 degrees, by cdot 90 degrees
#   curvature 0.02 to 0.03, 90 degrees: by angle 104.7 m and 150 degrees, by length 62.8 m and 90 degrees, by cdot 90 degrees
#   curvature 0.019 to 0.02, 90 degrees: by angle 157.1 m and 176 degrees, by length 80.6 m and 90 degrees, by cdot 90 degrees
#   curvature 0.03 to 0.02, 90 degrees: by angle 104.7 m and 150 degrees, by length 62.8 m and 90 degrees, by cdot 90 degrees
#   curvature -0.01 to 0.02, 90 degrees: by angle 157.1 m and 45 degrees, by length 314.2 m and 90 degrees, by cdot 90 degrees
#   ring of four quarters given by angle: turns by 600 degrees, ends 43.3 m from its start
#   ring of four quarters given by length: turns by 360 degrees, ends 0.0 m from its start
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps numpy==2.4.6 elementpath==5.1.4 lxml==6.1.3 pyclothoids==0.2.0 scenariogeneration==0.16.7 scipy==1.17.1 xmlschema==4.3.2
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import xml.etree.ElementTree as ET
from importlib.metadata import version

import numpy as np
from scenariogeneration import xodr

print('scenariogeneration', version('scenariogeneration'))
QUARTER = np.pi / 2.0


def written(*spirals):
    """Angle turned by, in degrees, and distance from start to end, of the road as it stands in the OpenDRIVE file."""
    road = xodr.create_road(list(spirals), id=1, left_lanes=0, right_lanes=1)
    drive = xodr.OpenDrive('bend')
    drive.add_road(road)
    drive.adjust_roads_and_lanes()
    drive.write_xml('bend.xodr')
    heading, place = 0.0, 0.0j
    for geometry in ET.parse('bend.xodr').iter('geometry'):
        length, spiral = float(geometry.get('length')), geometry.find('spiral')
        s, first, last = np.linspace(0.0, length, 20001), float(spiral.get('curvStart')), float(spiral.get('curvEnd'))
        angles = heading + first * s + (last - first) * s**2 / (2.0 * length)
        place += np.trapezoid(np.exp(1j * angles), s)
        heading = angles[-1]
    return np.degrees(heading), abs(place)


ok = True
for first, last in ((0.0, 0.02), (0.02, 0.03), (0.019, 0.02), (0.03, 0.02), (-0.01, 0.02)):
    right = 2.0 * QUARTER / abs(first + last)
    by_angle, by_length = xodr.Spiral(first, last, angle=QUARTER), xodr.Spiral(first, last, length=right)
    by_cdot = xodr.Spiral(first, last, cdot=(last - first) / right)
    turns = [written(spiral)[0] for spiral in (by_angle, by_length, by_cdot)]
    print(f'curvature {first} to {last}, 90 degrees: by angle {by_angle.length:.1f} m and {turns[0]:.0f} degrees, by length {by_length.length:.1f} m and '
          f'{turns[1]:.0f} degrees, by cdot {turns[2]:.0f} degrees')
    wrong = np.degrees((first + last) / max(abs(first), abs(last)) * QUARTER)
    ok = ok and abs(turns[0] - wrong) < 0.5 and abs(turns[1] - 90.0) < 0.5 and abs(turns[2] - 90.0) < 0.5
for name, given in (('angle', {'angle': QUARTER}), ('length', {'length': 2.0 * QUARTER / 0.05})):
    turned, gap = written(*(xodr.Spiral(first, last, **given) for first, last in ((0.02, 0.03), (0.03, 0.02)) * 2))
    print(f'ring of four quarters given by {name}: turns by {turned:.0f} degrees, ends {gap:.1f} m from its start')
    ok = ok and (turned > 500.0 and gap > 10.0 if name == 'angle' else abs(turned - 360.0) < 0.5 and gap < 0.1)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
