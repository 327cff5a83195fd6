#!/usr/bin/env bash
# highway-env: on the far half of a loop ramp cars have negative arc lengths and nobody sees them.
#
# Expected: along a circular lane of 270 degrees, local_coordinates undoes position, and an IDM car stops for one
# that stands ahead, as it does on a straight lane.
# What happens: the angle on the circle is taken within half a turn around that of the lane's start. A place at
# 110 m of a lane of 141 m comes back as -78.5 m, is not on the lane, and the car that stands there is behind
# everybody: the IDM car, 50 m before it, has no neighbour in front and drives into it at full speed. On a lane of
# 162 degrees the same two cars are fine.
# Why it matters: loop ramps and roundabouts as one lane; rewards, observations and goals in lane coordinates too.
#
# Output seen:
#   highway-env 1.12.1
#   lane of 162 degrees: 70 m comes back as 70.0 m, on the lane True, seen ahead True, crashed False
#   lane of 270 degrees: 110 m comes back as -78.5 m, on the lane False, seen ahead False, crashed True, at 8.0 m/s
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

from highway_env.road.lane import CircularLane
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

print('highway-env', version('highway-env'))


def drive(degrees, start):
    """An IDM car at 8 m/s, 50 m before one that stands on an arc of radius 30 m."""
    lane, network = CircularLane([0.0, 0.0], 30.0, 0.0, math.radians(degrees), clockwise=True), RoadNetwork()
    network.add_lane('a', 'b', lane)
    road, ahead = Road(network), start + 50.0
    assert ahead < lane.length
    car = IDMVehicle(road, lane.position(start, 0.0), lane.heading_at(start), 8.0, target_speed=8.0,
                     enable_lane_change=False)
    front = Vehicle(road, lane.position(ahead, 0.0), lane.heading_at(ahead), 0.0)
    road.vehicles, before = [car, front], 8.0
    back, _ = lane.local_coordinates(front.position)
    seen = road.neighbour_vehicles(car)[0] is front
    for _ in range(300):
        if car.crashed:
            break
        before = float(car.speed)
        road.act()
        road.step(1.0 / 15.0)
    print(f'lane of {degrees} degrees: {ahead:.0f} m comes back as {back:.1f} m, on the lane '
          f'{lane.on_lane(front.position)}, seen ahead {seen}, crashed {car.crashed}'
          + (f', at {before:.1f} m/s' if car.crashed else ''))
    return float(back), bool(lane.on_lane(front.position)), seen, car.crashed


near, far = drive(162, 20.0), drive(270, 60.0)
ok = abs(near[0] - 70.0) < 1e-6 and near[1:] == (True, True, False)
ok = ok and abs(far[0] - (110.0 - 60.0 * math.pi)) < 1e-6 and far[1:] == (False, False, True)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
