#!/usr/bin/env bash
# interpolatepy: a stop that the limits do not allow is braked over the limit, and one that is far too short is driven through.
#
# Expected: a trajectory that cannot reach its end within the limits of acceleration and jerk is refused with a ValueError,
# as the documentation of TrapezoidalTrajectory says.
# What happens: none is refused. With limits of 4 m/s² and 10 m/s³ a stop from 20 m/s takes 54 m. By DoubleSTrajectory it
# comes out in 45 m with 5 m/s², in 30 m with 10 m/s². Below that its phases vanish: a stop within 20 m is a ride at
# 20 m/s that ends, at 20 m/s, 20 m behind the place of the stop, in a time that looks like that of a stop. With
# a jerk limit of 2 m/s³ it is so for 60 m. TrapezoidalTrajectory lets the speed fall to 15.8 m/s at once.
# Why it matters: emergency stops and short gaps are when the limits are reached; the profile is used as one that keeps
# them and its end.
#
# Output seen:
#   interpolatepy 3.3.2
#   stop within 60 m, 4 m/s² and 10 m/s³: ends at 60.0 m with 0.0 m/s, largest deceleration 3.54 m/s²
#   stop within 45 m, 4 m/s² and 10 m/s³: ends at 45.0 m with 0.0 m/s, largest deceleration 5.00 m/s²
#   stop within 30 m, 4 m/s² and 10 m/s³: ends at 30.0 m with 0.0 m/s, largest deceleration 10.00 m/s²
#   stop within 20 m, 4 m/s² and 10 m/s³: ends at 40.0 m with 20.0 m/s, largest deceleration 0.00 m/s²
#   stop within 60 m, 4 m/s² and 2 m/s³: ends at 120.0 m with 20.0 m/s, largest deceleration 0.00 m/s²
#   trapezoidal, within 30 m: 20.0 m/s at the start, 15.8 m/s after 1 ms
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps interpolatepy==3.3.2 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 kiwisolver==1.5.1 matplotlib==3.11.2 numpy==2.4.6 packaging==26.4 pillow==13.0.0 pyparsing==3.3.3 python-dateutil==4.0.0 scipy==1.17.1 six==1.17.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import numpy as np
from interpolatepy import DoubleSTrajectory, StateParams, TrajectoryBounds, TrapezoidalTrajectory, TrapezoidalTrajectoryParams

print('interpolatepy', version('interpolatepy'))
SPEED, LIMIT = 20.0, 4.0


def stop(distance, jerk):
    made = DoubleSTrajectory(StateParams(0.0, distance, SPEED, 0.0), TrajectoryBounds(30.0, LIMIT, jerk))
    rows = np.array([made.evaluate_full(float(t)) for t in np.linspace(0.0, made.get_duration(), 2001)])
    return rows[-1, 0], rows[-1, 1], np.abs(rows[:, 2]).max()


ok = True
for distance, jerk, how in ((60.0, 10.0, 'kept'), (45.0, 10.0, 'over'), (30.0, 10.0, 'over'), (20.0, 10.0, 'through'), (60.0, 2.0, 'through')):
    place, speed, most = stop(distance, jerk)
    print(f'stop within {distance:.0f} m, {LIMIT:.0f} m/s² and {jerk:.0f} m/s³: ends at {place:.1f} m with {speed + 0.0:.1f} m/s, largest deceleration {most:.2f} m/s²')
    there = abs(place - distance) < 0.01 and abs(speed) < 0.01
    ok = ok and {'kept': there and most <= LIMIT, 'over': there and most > 1.2 * LIMIT,
                 'through': abs(place - 2 * distance) < 0.01 and speed == SPEED and most == 0.0}[how]
profile, _ = TrapezoidalTrajectory.generate_trajectory(
    TrapezoidalTrajectoryParams(q0=0.0, q1=30.0, v0=SPEED, v1=0.0, amax=LIMIT, vmax=30.0))
before, after = profile(0.0)[1], profile(0.001)[1]
print(f'trapezoidal, within 30 m: {before:.1f} m/s at the start, {after:.1f} m/s after 1 ms')
ok = ok and before == SPEED and after < SPEED - 4.0
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
