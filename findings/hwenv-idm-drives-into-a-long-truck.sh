#!/usr/bin/env bash
# highway-env: the IDM car keeps its distance to the middle of the vehicle in front, however long that is.
#
# Expected: the Intelligent Driver Model keeps its gap to the rear of the vehicle in front, so that a car stops
# behind a standing bus or truck as it does behind a car, and a car that stands 2 m behind another stays.
# What happens: distances are from centre to centre, and the wanted one is 10 m for all: 5 m and the length of
# the car itself. Behind a 12 m bus the car comes to 0.7 m of it, and into an 18 m truck it drives at 2.7 m/s.
# A car in a queue, 2 m behind the next, wants 10 m too and reverses by 3.5 m, at up to 1.4 m/s, as the IDM has no rule
# for it and the simulation lets speeds become negative.
# Why it matters: mixed traffic; a planner judged against these drivers is hit from behind through no fault of its own.
#
# Output seen:
#   highway-env 1.12.1
#   behind a vehicle of  5 m: crashed False, smallest gap 4.2 m
#   behind a vehicle of 12 m: crashed False, smallest gap 0.7 m
#   behind a vehicle of 18 m: crashed True, smallest gap 0.0 m, at 2.7 m/s
#   in a queue, 2 m behind a car: backwards by 3.5 m, speed down to -1.4 m/s
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps highway-env==1.12.1 gymnasium==1.4.0 Farama-Notifications==0.0.6 cloudpickle==3.1.2 typing_extensions==4.16.0 pygame==2.6.1 pandas==3.1.1 numpy==2.4.6 python-dateutil==3.0.0 six==1.17.0 matplotlib==3.11.2 contourpy==1.3.3 cycler==0.12.1 fonttools==4.65.0 kiwisolver==1.5.1 packaging==26.3 pillow==12.3.0 pyparsing==3.3.3
cd "$dir"
PYGAME_HIDE_SUPPORT_PROMPT=1 SDL_VIDEODRIVER=dummy "$dir/venv/bin/python" -W ignore - <<'PY'
import math
from importlib.metadata import version

import numpy as np
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

print('highway-env', version('highway-env'))


def drive(speed, ahead, length):
    """30 s of an IDM car behind one that stands: whether it crashes, smallest gap, places and speeds."""
    class Front(Vehicle):
        LENGTH = length

    road = Road(RoadNetwork.straight_road_network(1, length=1000))
    car = IDMVehicle(road, [0.0, 0.0], 0.0, speed, target_speed=15.0, enable_lane_change=False)
    front = Front(road, [ahead, 0.0], 0.0, 0.0)
    road.vehicles, places, speeds = [car, front], [0.0], [speed]
    for _ in range(450):
        if car.crashed:
            break
        road.act()
        road.step(1.0 / 15.0)
        places.append(float(car.position[0]))
        speeds.append(float(car.speed))
    gap = ahead - max(places) - 0.5 * (Vehicle.LENGTH + length)
    return car.crashed, max(gap, 0.0), places, speeds


found = {}
for length in (5.0, 12.0, 18.0):
    crashed, gap, places, speeds = drive(15.0, 150.0, length)
    found[length] = crashed, gap
    print(f'behind a vehicle of {length:2.0f} m: crashed {crashed}, smallest gap {gap:.1f} m'
          + (f', at {speeds[-2]:.1f} m/s' if crashed else ''))
crashed, gap, places, speeds = drive(0.0, 7.0, 5.0)
print(f'in a queue, 2 m behind a car: backwards by {-min(places):.1f} m, speed down to {min(speeds):.1f} m/s')
ok = not found[5.0][0] and found[5.0][1] > 4.0 and not found[12.0][0] and found[12.0][1] < 1.0 and found[18.0][0]
ok = ok and min(places) < -2.5 and min(speeds) < -1.0 and math.isclose(Vehicle.LENGTH, 5.0)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
