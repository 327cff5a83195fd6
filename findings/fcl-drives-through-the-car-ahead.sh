#!/usr/bin/env bash
# FCL: continuous collision misses the car that stands straight ahead.
#
# Expected: a box of 4.5 m by 1.8 m that moves 40 m towards an equal one, 20 m ahead, touches it at 15.5 / 40 =
# 0.3875 of the way, however far the two are beside each other, as long as they overlap.
# What happens: with the default request (conservative advancement) continuousCollide says that there is no
# collision if the other box stands exactly ahead, 1 cm to the left, 0.5 m to the right or turned by 1 or 5 degrees, at all
# distances tried from 5 to 30 m; 0.1 m or 0.5 m to the left, or with the scene turned by 30 degrees, it is found. More iterations
# change nothing. Half-way the same boxes collide by `collide`. The naive solver finds it at the next of 10 samples of the
# motion, later than it happens, and misses it where a sample step is longer than both boxes.
# Why it matters: rear-end collisions in one lane are the plainest case of all, and the answer is "free".
#
# Output seen:
#   python-fcl 0.7.0.11
#   straight ahead: continuous not found, at half of the way True
#   to the left by 0.01, 0.1, 0.5 m: not found, 0.3875, 0.3875
#   to the right by 0.5, 1.0 m: not found, 0.3875
#   turned by 1, 5, 20 degrees: not found, not found, 0.3832
#   5, 10, 15, 30 m ahead: not found, not found, not found, not found
#   straight ahead, 10000 iterations: not found; the scene turned by 30 degrees: 0.3927
#   naive solver, moving by 40, 400 m: 0.4444 (expected 0.3875), not found (expected 0.0387)
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps python-fcl==0.7.0.11 numpy==2.4.6
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import math
from importlib.metadata import version

import fcl
import numpy as np

print('python-fcl', version('python-fcl'))
LENGTH, WIDTH = 4.5, 1.8


def body(x, y, heading, scene):
    """A car's box at a place and heading of a scene that is turned about the origin."""
    c, s = math.cos(scene), math.sin(scene)
    a, b = math.cos(scene + heading), math.sin(scene + heading)
    at = fcl.Transform(np.array([[a, -b, 0.0], [b, a, 0.0], [0.0, 0.0, 1.0]]), np.array([c * x - s * y, s * x + c * y, 0.0]))
    return fcl.CollisionObject(fcl.Box(LENGTH, WIDTH, 1.0), at), at


def touched(ahead=20.0, beside=0.0, turned=0.0, scene=0.0, move=40.0, **request):
    """Where on its way a car that moves along its axis touches one that stands, or None."""
    turned, scene = math.radians(turned), math.radians(scene)
    mover, other = body(0.0, 0.0, 0.0, scene)[0], body(ahead, beside, turned, scene)
    result = fcl.ContinuousCollisionResult()
    fcl.continuousCollide(mover, body(move, 0.0, 0.0, scene)[1], *other, fcl.ContinuousCollisionRequest(**request), result)
    return result.time_of_contact if result.is_collide else None


def said(times):
    return ', '.join('not found' if time is None else f'{time:.4f}' for time in times)


half = fcl.collide(body(20.0, 0.0, 0.0, 0.0)[0], body(20.0, 0.0, 0.0, 0.0)[0],
                   fcl.CollisionRequest(), fcl.CollisionResult()) > 0
ahead = touched()
print(f'straight ahead: continuous {said([ahead])}, at half of the way {half}')
left, right = [touched(beside=y) for y in (0.01, 0.1, 0.5)], [touched(beside=-y) for y in (0.5, 1.0)]
turned, gaps = [touched(turned=d) for d in (1, 5, 20)], [touched(ahead=x) for x in (5.0, 10.0, 15.0, 30.0)]
print('to the left by 0.01, 0.1, 0.5 m:', said(left))
print('to the right by 0.5, 1.0 m:', said(right))
print('turned by 1, 5, 20 degrees:', said(turned))
print('5, 10, 15, 30 m ahead:', said(gaps))
longer, scene = touched(num_max_iterations=10000), touched(scene=30)
print(f'straight ahead, 10000 iterations: {said([longer])}; the scene turned by 30 degrees: {said([scene])}')
naive = [touched(beside=0.3, move=m, ccd_solver_type=fcl.CCDSolverType.CCDC_NAIVE) for m in (40.0, 400.0)]
print(f'naive solver, moving by 40, 400 m: {said(naive[:1])} (expected 0.3875), {said(naive[1:])} (expected 0.0387)')
ok = half and ahead is None and longer is None and gaps == [None] * 4 and turned[:2] == [None, None] and turned[2]
ok = ok and scene and abs(left[1] - 0.3875) < 1e-3 and abs(right[1] - 0.3875) < 1e-3 and naive[0] > 0.43 and naive[1] is None
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
