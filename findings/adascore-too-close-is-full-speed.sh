#!/usr/bin/env bash
# adas-core: its cruise control drives faster once it is closer than the minimum distance: 6 m/s at 12.1 m, 15 m/s at 11.9 m.
#
# Expected: the nearer the car ahead, the lower the target speed; with a minimum distance of 12 m nobody is followed nearer than that.
# What happens: the target falls from 15 m/s at 30 m to 6 m/s at 12 m and jumps back to 14.9 m/s just inside of it ("too close, reduce speed
# proportionally" starts again from the cruising speed). Behind a car at 8 m/s it keeps 16 m. Behind one at 5 m/s it comes to 12 m,
# accelerates to 9.6 m/s, and follows at 4 m; into one at 2 m/s, or one that stands, it drives, faster within the last 12 m than before.
# The distance at rest is 30 m times v / 15 outside and 12 m times v / 15 inside, so no speed below 6 m/s has one at which it
# keeps the minimum.
# Why it matters: tests at motorway speeds and on a clear road pass; a jam is where it fails.
#
# Output seen:
#   adas-core 0.1.0
#   target speeds: 15.0 m/s at 40.0 m, 15.0 m/s at 30.0 m, 10.0 m/s at 20.0 m, 6.0 m/s at 12.1 m, 14.9 m/s at 11.9 m, 10.0 m/s at 8.0 m, 5.0 m/s at 4.0 m, 2.5 m/s at 2.0 m
#   behind a car at 8 m/s: ends 16.0 m behind it at 8.0 m/s, never nearer than 15.6 m, at most 0.0 m/s within 12 m
#   behind a car at 5 m/s: ends 4.0 m behind it at 5.0 m/s, never nearer than 2.9 m, at most 9.6 m/s within 12 m
#   behind a car at 2 m/s: ends -0.1 m behind it at 3.7 m/s, never nearer than -0.1 m, at most 10.1 m/s within 12 m
#   behind a car at 0 m/s: ends -0.1 m behind it at 5.9 m/s, never nearer than -0.1 m, at most 10.5 m/s within 12 m
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps adas-core==0.1.0 numpy==2.4.6
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import logging
from importlib.metadata import version

from adas.control.controller import PIDLikeLongitudinalController
from adas.core.models import BoundingBox, TrackedObject
from adas.planning.behavior_planner import BehaviorPlanner

logging.disable(logging.CRITICAL)
print('adas-core', version('adas-core'))
PLANNER, CONTROLLER = BehaviorPlanner(), PIDLikeLongitudinalController()
BOX = BoundingBox(300.0, 200.0, 340.0, 240.0, 0.9, 'car')


def target(distance, speed=0.0):
    """Plan behind a car at a distance that drives with a speed."""
    return PLANNER.plan(640, 320.0, [TrackedObject(1, BOX, speed, distance)])


def follow(lead, gap=60.0, speed=15.0, dt=0.05, duration=120.0):
    """Gap and speed at the end, the least gap, and the highest speed within the minimum distance; throttle is 3 and brake 8 m/s²."""
    least, fastest = gap, 0.0
    for _ in range(round(duration / dt)):
        command = CONTROLLER.to_command(target(max(gap, 0.0), lead), speed)
        speed = max(0.0, speed + (3.0 * command.throttle - 8.0 * command.brake) * dt)
        gap += (lead - speed) * dt
        least = min(least, gap)
        fastest = max(fastest, speed) if gap < PLANNER.min_follow_distance_m else fastest
        if gap <= 0.0:
            break
    return gap, speed, least, fastest


targets = {distance: target(distance).target_speed_mps for distance in (40.0, 30.0, 20.0, 12.1, 11.9, 8.0, 4.0, 2.0)}
print('target speeds: ' + ', '.join(f'{value:.1f} m/s at {distance} m' for distance, value in targets.items()))
seen = {}
for lead in (8.0, 5.0, 2.0, 0.0):
    seen[lead] = follow(lead)
    print('behind a car at {:.0f} m/s: ends {:.1f} m behind it at {:.1f} m/s, never nearer than {:.1f} m, at most {:.1f} m/s within 12 m'
          .format(lead, *seen[lead]))
ok = targets[12.1] < 6.1 and targets[11.9] > 14.8 and targets[8.0] > targets[20.0] * 0.99
ok = ok and abs(seen[8.0][0] - 16.0) < 0.5 and abs(seen[5.0][0] - 4.0) < 0.5 and seen[5.0][3] > 7.0
ok = ok and seen[0.0][0] <= 0.5
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
