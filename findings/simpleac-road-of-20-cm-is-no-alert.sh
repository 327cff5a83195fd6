#!/usr/bin/env bash
# simple-autonomous-car: perceived boundaries that close to 20 cm in front of the car raise no alert, ones that are too far out do.
#
# Expected: TrackBoundsAlert compares perceived boundaries with those of the map, within 20 m ahead: 1 m of difference is a warning, 2 m
# critical, whichever way they differ.
# What happens: outwards it is so. Inwards the deviation is 0 for any difference: a road of 5 m that is seen to narrow to 20 cm right
# ahead has deviation 0, no warning and nothing critical, since every point between the map's boundaries counts as within them.
# And short of the finish nothing is looked at: 3 m before the end of the lap 4 of 30 points ahead are compared, those behind the line
# having a smaller arc length than the car; 0.5 m before it none is, and the answer is "no alert" again.
# Why it matters: works, parked cars and a wrong map narrow the road; a boundary further away than on the map endangers nobody.
#
# Output seen:
#   simple-autonomous-car 0.1.2
#   5 m wide on the map, seen as 5.0 m: deviation 0.00 m, warning: False, critical: False
#   5 m wide on the map, seen as 8.0 m: deviation 1.50 m, warning: True, critical: False
#   5 m wide on the map, seen as 10.0 m: deviation 2.50 m, warning: True, critical: True
#   5 m wide on the map, seen as 3.0 m: deviation 0.00 m, warning: False, critical: False
#   5 m wide on the map, seen as 1.0 m: deviation 0.00 m, warning: False, critical: False
#   5 m wide on the map, seen as 0.2 m: deviation 0.00 m, warning: False, critical: False
#   30.0 m before the end of the lap, seen as 10 m: 30 of 30 points compared, critical: True
#   3.0 m before the end of the lap, seen as 10 m: 4 of 30 points compared, critical: True
#   0.5 m before the end of the lap, seen as 10 m: 0 of 30 points compared, critical: False
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 kiwisolver==1.5.1 matplotlib==3.11.2 numpy==2.4.6 packaging==26.4 pillow==13.0.0 pyparsing==3.3.3 python-dateutil==4.0.0 scipy==1.17.1 simple-autonomous-car==0.1.2
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import numpy as np
from simple_autonomous_car.alerts.track_bounds_alert import TrackBoundsAlert
from simple_autonomous_car.car.car import CarState
from simple_autonomous_car.maps.frenet_map import FrenetMap
from simple_autonomous_car.perception.perception import PerceptionPoints
from simple_autonomous_car.track.track import Track

print('simple-autonomous-car', version('simple-autonomous-car'))
RADIUS, LAP = 50.0, 2.0 * np.pi * 50.0


def circle(angles, radius):
    """Points on a circle about the origin."""
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def check(width, place=20.0):
    """Deviation, warning, critical, and number of points compared, for a ring of 5 m that is seen with a width 1 to 15 m ahead."""
    alert = TrackBoundsAlert(FrenetMap(Track(circle(np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False), RADIUS), 5.0)))
    x, y = circle(np.array([place / RADIUS]), RADIUS)[0]
    ahead = (place + np.linspace(1.0, 15.0, 15)) / RADIUS
    seen = np.vstack([circle(ahead, RADIUS - width / 2.0), circle(ahead, RADIUS + width / 2.0)])
    result = alert.check(PerceptionPoints(seen, frame='global'), CarState(x, y, place / RADIUS + np.pi / 2.0, velocity=10.0))
    return float(result['max_deviation']), bool(result['has_warning']), bool(result['has_critical']), len(result['deviations'])


ok = True
for width in (5.0, 8.0, 10.0, 3.0, 1.0, 0.2):
    deviation, warning, critical, number = check(width)
    print(f'5 m wide on the map, seen as {width} m: deviation {deviation:.2f} m, warning: {warning}, critical: {critical}')
    ok = ok and number == 30 and warning == (width > 7.0) and critical == (width > 9.0) and (width > 5.0 or deviation < 0.01)
left = {rest: check(10.0, LAP - rest) for rest in (30.0, 3.0, 0.5)}
for rest, (_, _, critical, number) in left.items():
    print(f'{rest} m before the end of the lap, seen as 10 m: {number} of 30 points compared, critical: {critical}')
ok = ok and left[30.0][3] == 30 and left[3.0][3] < 10 and left[0.5][2:] == (False, 0)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
