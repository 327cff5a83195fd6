#!/usr/bin/env bash
# fiss-planner on CommonRoad: where a recording ends, the car ahead becomes a wall, and a car that stands is driven through.
#
# Expected: the package's adapter hands the rest of an obstacle's recorded states to the planner. A car 30 m ahead that drives
# as fast as the ego is no reason to brake, and one that stands 50 m ahead is, however many states of them are left.
# What happens: beyond its last state an obstacle is gone, except if that state is its only one: then it stays for the whole
# horizon. Behind the car that drives on, the plan keeps 15 m/s until six states are left, brakes to half of that with five
# to two, and with one there is no plan at all. Towards the car that stands it brakes with 21 states or more and with one,
# and drives through its place with two to eleven.
# Why it matters: recordings end at different steps for different cars, often within the horizon. The plan of one scene is to
# drive on, to brake, none or a collision, depending on how much of it has been recorded.
#
# Output seen:
#   fiss-planner 1.0.0
#   commonroad-io 2024.3
#   it drives as fast as the ego, 51 of its states left: to 15.0 m/s in 75 m
#   it drives as fast as the ego, 21 of its states left: to 15.0 m/s in 75 m
#   it drives as fast as the ego, 11 of its states left: to 15.0 m/s in 75 m
#   it drives as fast as the ego, 6 of its states left: to 15.0 m/s in 75 m
#   it drives as fast as the ego, 5 of its states left: to 7.5 m/s in 56 m
#   it drives as fast as the ego, 2 of its states left: to 7.5 m/s in 56 m
#   it drives as fast as the ego, 1 of its states left: no plan
#   it stands, 51 of its states left: to 7.5 m/s in 34 m
#   it stands, 21 of its states left: to 7.5 m/s in 45 m
#   it stands, 11 of its states left: to 15.0 m/s in 75 m
#   it stands, 6 of its states left: to 15.0 m/s in 75 m
#   it stands, 5 of its states left: to 15.0 m/s in 75 m
#   it stands, 2 of its states left: to 15.0 m/s in 75 m
#   it stands, 1 of its states left: to 7.5 m/s in 34 m
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps commonroad-io==2024.3 commonroad-vehicle-models==3.0.2 contourpy==1.3.3 cycler==0.12.1 fiss-planner==1.0.0 fonttools==4.68.0 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 packaging==26.4 pillow==13.0.0 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==4.0.0 PyYAML==6.0.4 rtree==1.4.1 scipy==1.17.1 shapely==2.2.0 tqdm==4.70.1 tzdata==2026.6
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import fiss_planner as fp
import numpy as np
from commonroad.geometry.shape import Rectangle
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.state import CustomState, InitialState
from commonroad.scenario.trajectory import Trajectory
from fiss_planner.commonroad.adapter import obstacles_at

for name in ('fiss-planner', 'commonroad-io'):
    print(name, version(name))
DT, LAST, SPEED = 0.1, 50, 15.0
x = np.arange(0.0, 600.0, 2.0)
road = fp.ReferenceLine(x, np.zeros_like(x))
lane = fp.Corridor.parallel_lanes(0.0, road.length, 3.5, 0, 0)


def recorded(start, speed):
    """A car on the lane that is recorded from step 0 to the last one."""
    def state(k):
        return dict(time_step=k, position=np.array([start + speed * DT * k, 0.0]), orientation=0.0, velocity=speed)
    shape = Rectangle(4.5, 1.9)
    path = Trajectory(1, [CustomState(**state(k)) for k in range(1, LAST + 1)])
    return DynamicObstacle(7, ObstacleType.CAR, shape, InitialState(yaw_rate=0.0, slip_angle=0.0, acceleration=0.0, **state(0)),
                           TrajectoryPrediction(path, shape))


def final(car, left, gap):
    """Speed at the end of the plan, if there is one, made where so many states of the car are left, `gap` behind it."""
    now = LAST + 1 - left
    traffic = obstacles_at([car], now, DT, 5.0)
    own = car.state_at_time(now).position[0] - gap
    plan = fp.make_planner(fp.make_config('fop')).plan(fp.FrenetState(s=own, s_d=SPEED), road, lane, traffic, target_speed=SPEED)
    if not plan.success:
        return None
    return plan.trajectory.s_d[-1], plan.trajectory.s[-1] - own


rows = {}
for name, speed, gap in (('drives as fast as the ego', SPEED, 30.0), ('stands', 0.0, 50.0)):
    car = recorded(200.0, speed)
    for left in (51, 21, 11, 6, 5, 2, 1):
        made = rows[name, left] = final(car, left, gap)
        print(f'it {name}, {left} of its states left:', 'no plan' if made is None else f'to {made[0]:.1f} m/s in {made[1]:.0f} m')
seen = {name: [made and round(made[0], 2) for (of, _), made in rows.items() if of == name]
        for name in ('drives as fast as the ego', 'stands')}
ok = seen['drives as fast as the ego'] == [15.0, 15.0, 15.0, 15.0, 7.5, 7.5, None]
ok = ok and seen['stands'] == [7.5, 7.5, 15.0, 15.0, 15.0, 15.0, 7.5]
ok = ok and all(made[1] > 70.0 for (of, left), made in rows.items() if of == 'stands' and 2 <= left <= 11)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
