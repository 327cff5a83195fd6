#!/usr/bin/env bash
# OSC-Generator: of the lane changes of one vehicle over one line it finds a single one; a car that overtakes only moves to the right.
#
# Expected: a car that overtakes, over the broken line to the left and 10 s later back to the right, has both lane changes in the
# manoeuvre vectors from which the OpenSCENARIO file is written.
# What happens: alone, each is found. Of the two, only the one to the right is: the car of the scenario that is written moves over to the
# right from the right lane. Of three, left, right, left, only the first, or in one of 24
# directions of the road on the map the second. The intersections of the lane line and the track are all computed, and the first in
# the list is taken; the list's order is the geometry library's.
# Why it matters: the line between two lanes is one line in the input; cut-ins with a return, overtaking and weaving are what such
# scenarios are made for.
#
# Output seen:
#   osc-generator 0.2.0
#   left at 5 s: found left at 5 s (24 of 24 directions)
#   left at 5 s, right at 15 s: found right at 15 s (24 of 24 directions)
#   left at 3 s, right at 12 s, left at 20 s: found left at 3 s (23 of 24 directions); right at 12 s (1 of 24 directions)
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps certifi==2026.10.19.post1 charset-normalizer==3.5.3 contourpy==1.3.2 cycler==0.12.1 et_xmlfile==2.0.0 fonttools==4.68.0 geographiclib==2.1 idna==3.20 kiwisolver==1.5.1 matplotlib==3.10.9 numpy==1.24.4 openpyxl==3.1.5 osc_generator==0.2.0 packaging==26.4 pandas==2.0.3 pillow==13.0.0 pyparsing==3.3.3 pyproj==3.7.2 python-dateutil==4.0.0 pytz==2026.6 requests==2.34.2 scipy==1.10.1 Shapely==1.8.5.post1 simplekml==1.3.6 tzdata==2026.6 urllib3==2.8.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from collections import Counter
from importlib.metadata import version

import numpy as np
import pandas as pd
from osc_generator.tools import rulebased

print('osc-generator', version('osc-generator'))
TIMES = np.arange(0.0, 30.0, 0.1)
NORTH, EAST = 111200.0, 111320.0 * np.cos(np.deg2rad(48.7))


def geographic(along, left, degrees):
    """Latitude and longitude of points of a straight road with a direction on the map."""
    way = np.deg2rad(degrees)
    return 48.7 + (np.sin(way) * along + np.cos(way) * left) / NORTH, 11.5 + (np.cos(way) * along - np.sin(way) * left) / EAST


def found(changes, degrees):
    """Begins of the lane changes that are found; a change is its begin and +1 (left) or -1 (right), over 3.5 m within 3 s."""
    lines = pd.DataFrame()
    for number, left in enumerate((-3.5, 0.0, 3.5)):
        along = np.linspace(-50.0, 1000.0, TIMES.size)
        lines[f'{number}lat'], lines[f'{number}lon'] = geographic(along, np.full(TIMES.size, left), degrees)
    left = np.full(TIMES.size, -1.75)
    for begin, sign in changes:
        part = np.clip((TIMES - begin) / 3.0, 0.0, 1.0)
        left += sign * 3.5 * part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
    latitude, longitude = geographic(30.0 * TIMES, left, degrees)
    vectors = rulebased.create_lateral_maneuver_vectors(lines, pd.Series(latitude), pd.Series(longitude))
    return [(side, round(TIMES[k])) for side, vector in zip(('left', 'right'), vectors)
            for k in np.flatnonzero(np.diff(np.concatenate(([0.0], vector))) > 0.0)]


CASES = {'left at 5 s': [(5.0, 1)], 'left at 5 s, right at 15 s': [(5.0, 1), (15.0, -1)],
         'left at 3 s, right at 12 s, left at 20 s': [(3.0, 1), (12.0, -1), (20.0, 1)]}
ok = True
for name, changes in CASES.items():
    seen = [found(changes, degrees) for degrees in range(0, 360, 15)]
    counts = Counter(', '.join(f'{side} at {begin} s' for side, begin in result) for result in seen)
    print(f'{name}: found ' + '; '.join(f'{what} ({number} of 24 directions)' for what, number in sorted(counts.items())))
    ok = ok and all(len(result) == 1 for result in seen) and (len(changes) > 1 or len(counts) == 1)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
