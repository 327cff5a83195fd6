#!/usr/bin/env bash
# simple-scenario: on a road to the south-east or north-west a wrong-way driver faces the way of the traffic and drives backwards.
#
# Expected: a vehicle with inverse_driving_direction=True has the heading of its motion, whichever way the road runs on the map; so
# has one that changes its lane, by either kind of lane change.
# What happens: on roads at -45 and 135 degrees the wrong-way driver's heading is the road's. Steps are taken for a standstill, in which
# the heading is that of the road, where dx + dy is zero, and on that diagonal dx = -dy at any speed. At 5 m/s and dt = 0.01 s a
# band of 0.8 degrees to both sides is struck. And a lane change by a lateral speed (lc_type='vy') has heading 0 on every road;
# the same manoeuvre as a polynomial has the right one.
# Why it matters: occupancies of a box are symmetric, so the drawing looks right; predictions from the heading, and what is written
# for a simulator, say that the oncoming car goes along with the ego.
#
# Output seen:
#   simple_scenario 1.0.1, lanelet2 1.2.3
#   road at -90 degrees: the wrong-way driver is 0 degrees from its motion, lane changes: polynomial 0, vy 90 degrees
#   road at -45 degrees: the wrong-way driver is 180 degrees from its motion, lane changes: polynomial 0, vy 45 degrees
#   road at 0 degrees: the wrong-way driver is 0 degrees from its motion, lane changes: polynomial 0, vy 0 degrees
#   road at 45 degrees: the wrong-way driver is 0 degrees from its motion, lane changes: polynomial 0, vy 45 degrees
#   road at 135 degrees: the wrong-way driver is 180 degrees from its motion, lane changes: polynomial 0, vy 135 degrees
#   5 m/s, dt 0.01 s, road at -44.5 degrees: 180 degrees off, at -44 degrees: 0
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps certifi==2026.10.19.post1 commonroad-vehicle-models==3.0.2 contourpy==1.3.3 cycler==0.12.1 elementpath==5.1.4 fonttools==4.68.0 kiwisolver==1.5.1 lanelet2==1.2.3 loguru==0.7.3 lxml==6.1.3 matplotlib==3.11.2 numpy==2.4.6 omegaconf==2.4.0 packaging==26.4 pandas==3.1.1 pillow==13.0.0 pybind11==3.1.0 pyclothoids==0.2.0 pyparsing==3.3.3 pyproj==3.7.2 python-dateutil==4.0.0 PyYAML==6.0.4 scenariogeneration==0.16.7 scipy==1.17.1 simple-scenario==1.0.1 tqdm==4.70.1 typing_extensions==4.16.0 xmlschema==4.3.2
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import numpy as np
from loguru import logger

logger.remove()
from simple_scenario import EgoConfiguration, Scenario, Vehicle  # noqa: E402
from simple_scenario.road import StraightSegment, SyntheticRoad  # noqa: E402

print(f"simple_scenario {version('simple-scenario')}, lanelet2 {version('lanelet2')}")
LANE_CHANGE = {'target_lanelet_id': 1002, 'start_s': 100.0, 'lc_direction': 1, 'lc_delay': 1.0}


def error(degrees, dt=0.1, speed=20.0, **how):
    """Largest angle, in degrees, between a vehicle's heading and its motion on a straight road of three lanes."""
    road = SyntheticRoad(3, 3.5, [StraightSegment(600.0, np.deg2rad(degrees))])
    ego = EgoConfiguration(start_lanelet_id=1002, start_s=10.0, start_t=0.0, target_s=500.0, target_t=0.0, v0=20.0)
    car = Vehicle(1, start_lanelet_id=1001, start_t=0.0, v0=speed, **how)
    Scenario('a road', road, ego, [car], 6.0, dt)
    motion = np.arctan2(np.diff(car.y), np.diff(car.x))
    return np.rad2deg(np.abs(np.angle(np.exp(1j * (car.heading[:-1] - motion)))).max())


ok = True
for degrees in (-90, -45, 0, 45, 135):
    wrong = error(degrees, start_s=400.0, inverse_driving_direction=True)
    smooth, sideways = error(degrees, **LANE_CHANGE), error(degrees, lc_type='vy', lc_vy=0.5, **LANE_CHANGE)
    print(f'road at {degrees} degrees: the wrong-way driver is {wrong:.0f} degrees from its motion, '
          f'lane changes: polynomial {smooth:.0f}, vy {round(sideways / 5) * 5} degrees')
    ok = ok and abs(wrong - (180.0 if degrees in (-45, 135) else 0.0)) < 1.0
    ok = ok and smooth < 1.0 and abs(sideways - abs(degrees)) < 3.0
near, far = (error(-45.0 + side, dt=0.01, speed=5.0, start_s=400.0, inverse_driving_direction=True) for side in (0.5, 1.0))
print(f'5 m/s, dt 0.01 s, road at -44.5 degrees: {near:.0f} degrees off, at -44 degrees: {far:.0f}')
ok = ok and near > 179.0 and far < 1.0
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
