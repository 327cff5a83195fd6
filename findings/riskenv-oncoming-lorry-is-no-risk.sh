#!/usr/bin/env bash
# riskenv: a lorry that will be hit is no risk until 0.2 s before, and between two cars the place of the ego itself is unsafe.
#
# Expected: the risk envelope bounds what the agent should avoid: bodies (circles by safety_radius) closer than the safety
# distance, and those that will come so close within 15 s. What is certain to be touched belongs to it, as soon as what is
# missed; the agent does not belong to it; and who drives a circle is predicted to be on it.
# What happens: the present distance is that between the bodies, the distance at the closest approach that of the centres.
# A lorry with a radius of 9 m comes towards the ego (radius 2 m), 8 m aside: 3 m too near. Nothing is unsafe until 0.2 s
# before they touch; a motorcycle that will pass with 1.9 m to spare has an envelope 15 s ahead. The envelope is one
# hull around all: with a car on either side, 0.5 m of room to each, it contains the ego.
# The predicted place is straight ahead in the heading of that time: with 0.5 rad/s at 10 m/s after 4 s it is 36 m off.
# Why it matters: a planner that keeps out of the envelope drives into the long vehicles, and has nowhere to be between
# two small ones.
#
# Output seen:
#   riskenv 1.0.0
#   motorcycle of radius 1 m, 4.9 m aside (room +1.9 m): closest at 0 s, envelope from -15.00 s
#   lorry of radius 9 m, 8.0 m aside (room -3.0 m): closest at 0 s, envelope from -0.46 s, touched from -0.25 s
#   1 car(s) at 4 m beside the ego: the ego is inside the envelope False
#   2 car(s) at 4 m beside the ego: the ego is inside the envelope True
#   10 m/s and 0.5 rad/s for 4 s: at (-16.6, 36.4); on the circle it is at (18.2, 28.3), 35.7 m off
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps riskenv==1.0.0 numpy==2.4.6 scipy==1.17.1 shapely==2.1.2
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import math
from importlib.metadata import version

from riskenv.objects import Agent, Obstacle
from riskenv.position_prediction import predict_position
from riskenv.unsafe_set import create_unsafe_set
from shapely import Point, Polygon

print('riskenv', version('riskenv'))
EGO, DISTANCE = Agent((0.0, 0.0), 0.0, 15.0, 0.0, 2.0), 5.0


def first_envelope(aside, radius):
    """How long before the closest approach an envelope is there, of who comes towards the ego at 15 m/s."""
    for step in range(2000, 0, -1):
        there = Obstacle((30.0 * step / 100.0, aside), math.pi, 15.0, 0.0, radius)
        if create_unsafe_set(EGO, [there], DISTANCE, 15.0):
            return step / 100.0
    return 0.0


ok = True
for name, aside, radius in (('motorcycle', 4.9, 1.0), ('lorry', 8.0, 9.0)):
    room = aside - radius - EGO.safety_radius
    touch = math.sqrt(max(0.0, (radius + EGO.safety_radius) ** 2 - aside**2)) / 30.0
    begins = first_envelope(aside, radius)
    print(f'{name} of radius {radius:.0f} m, {aside} m aside (room {room:+.1f} m): closest at 0 s, envelope from {-begins:.2f} s'
          + (f', touched from {-touch:.2f} s' if touch else ''))
    ok = ok and (abs(begins - 15.0) < 0.02 and not touch if room > 0.0 else touch < begins < touch + 0.25)
beside = [Obstacle((0.0, y), 0.0, 15.0, 0.0, 1.5) for y in (4.0, -4.0)]
for cars in (beside[:1], beside):
    inside = Polygon(create_unsafe_set(EGO, cars, DISTANCE)).contains(Point(EGO.position))
    print(f'{len(cars)} car(s) at 4 m beside the ego: the ego is inside the envelope {inside}')
    ok = ok and inside == (len(cars) == 2)
x, y = predict_position((0.0, 0.0), 0.0, 10.0, 0.5, 4.0)
circle = (20.0 * math.sin(2.0), 20.0 * (1.0 - math.cos(2.0)))
off = math.dist((x, y), circle)
print(f'10 m/s and 0.5 rad/s for 4 s: at ({x:.1f}, {y:.1f}); on the circle it is at ({circle[0]:.1f}, {circle[1]:.1f}), '
      f'{off:.1f} m off')
ok = ok and off > 30.0 and abs(math.hypot(x, y) - 40.0) < 1e-9
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
