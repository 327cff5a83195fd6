#!/usr/bin/env bash
# commonroad-velocity-planner: the acceleration that goes with a velocity profile vanishes with finer sampling.
#
# Expected: along a profile with v² = 20² - 2 * 4 * s (braking by 4 m/s² from 20 m/s) the SplineProfile, given no
# acceleration, finds -4 m/s², however closely the profile is sampled.
# What happens: it takes the square of the change of speed from one point to the next by the distance between
# them, where half of the change of the squares belongs. With a point every 2 m that is -0.1 m/s², a fortieth,
# and half as much each time the distance is halved. In the first step from standstill it is twice too large.
# The jerk is made of it.
# Why it matters: SplineProfile is what the planners return, and the bang-bang planner gives it no acceleration: full
# braking stands in its trajectory as coasting, and feasibility, comfort and controllers are judged by that.
#
# Output seen:
#   commonroad-velocity-planner 1.0.0
#   braking by 4 m/s² from 20 m/s, a point every 2.0 m: acceleration at 10 m -0.098 m/s², from the speeds -4.000 m/s²
#   braking by 4 m/s² from 20 m/s, a point every 1.0 m: acceleration at 10 m -0.049 m/s², from the speeds -4.000 m/s²
#   braking by 4 m/s² from 20 m/s, a point every 0.5 m: acceleration at 10 m -0.025 m/s², from the speeds -4.000 m/s²
#   starting by 2 m/s², a point every 0.5 m: acceleration at 0, 1, 10 m 4.000, 0.686, 0.051 m/s²
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps commonroad-velocity-planner==1.0.0 numpy==1.26.4 scipy==1.13.1
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

print('commonroad-velocity-planner', version('commonroad-velocity-planner'))
import numpy as np
from commonroad_velocity_planner.spline_profile import SplineProfile


def accelerations(start, rate, step, places):
    """Of a profile of constant acceleration, as the profile has it and as its own speeds have it."""
    s = np.arange(0.0, 40.0 + 0.5 * step, step)
    profile = SplineProfile(s, np.sqrt(start * start + 2.0 * rate * s))
    given = profile.interpolate_acceleration_at_arc_lenth(np.array(places))
    v = profile.interpolate_velocity_at_arc_lenth(s)
    return [float(a) for a in given], float(np.interp(10.0, 0.5 * (s[1:] + s[:-1]), 0.5 * np.diff(v * v) / step))


found = {}
for step in (2.0, 1.0, 0.5):
    (given,), right = accelerations(20.0, -4.0, step, [10.0])
    found[step] = given, right
    print(f'braking by 4 m/s² from 20 m/s, a point every {step} m: acceleration at 10 m {given:.3f} m/s², '
          f'from the speeds {right:.3f} m/s²')
starting, _ = accelerations(0.0, 2.0, 0.5, [0.0, 1.0, 10.0])
print('starting by 2 m/s², a point every 0.5 m: acceleration at 0, 1, 10 m ' + ', '.join(f'{a:.3f}' for a in starting) + ' m/s²')
ok = all(abs(right + 4.0) < 1e-6 and abs(given) < 0.1 for given, right in found.values())
ok = ok and 1.9 < found[2.0][0] / found[1.0][0] < 2.1 and 1.9 < found[1.0][0] / found[0.5][0] < 2.1
ok = ok and abs(starting[0] - 4.0) < 0.01 and starting[2] < 0.1
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
