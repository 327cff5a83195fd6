#!/usr/bin/env bash
# trajectory-planning-helpers (TUM): a car that begins at the top speed holds it for ever, whatever the drag is.
#
# Expected: calc_vel_profile keeps to what the machine can do: a car whose motor and drag balance at 56 m/s comes down to that
# speed on a straight, from 80 m/s as from 79.99 m/s, and settles at it on a fast oval.
# What happens: the machine's limit is looked at only where the profile from the bends rises, since there
# accelerations begin. If that profile is flat, v_max from the first point to the last, there is nothing to begin: the
# car holds 80 m/s for 3 km with a motor that yields 1 m/s² against 5.1 m/s² of drag. A start 0.01 m/s slower, or one
# bend anywhere that has to be taken slower, and the same car loses 24 m/s on the same straight.
# Why it matters: fast ovals, motorways and all stretches on which the limit of speed counts and not the bends are
# driven as if the car had no drag; lap times, energy and friction come from it.
#
# Output seen:
#   trajectory-planning-helpers 0.79
#   motor and drag balance at 55.9 m/s; at 80 m/s the motor yields 1.0, the drag takes 5.1 m/s²
#   straight, from 80.00 m/s: 80.0 m/s after 1 km, 80.0 m/s after 3 km
#   straight, from 79.99 m/s: 58.0 m/s after 1 km, 56.0 m/s after 3 km
#   straight, from 60.00 m/s: 56.2 m/s after 1 km, 55.9 m/s after 3 km
#   oval of 1000 m radius: 80.0 to 80.0 m/s, a lap of 78.6 s
#   the same with 40 m of 400 m radius: 54.5 to 55.9 m/s, a lap of 112.5 s
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps trajectory-planning-helpers==0.79 quadprog==0.1.14 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 kiwisolver==1.5.1 matplotlib==3.11.2 numpy==2.4.6 packaging==26.4 pillow==13.0.0 pyparsing==3.3.3 python-dateutil==4.0.0 scipy==1.17.1 six==1.17.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import numpy as np
from trajectory_planning_helpers.calc_vel_profile import calc_vel_profile

print('trajectory-planning-helpers', version('trajectory-planning-helpers'))
TOP, DRAG, MASS, STEP = 80.0, 0.8, 1000.0, 2.0
tyres = np.array([[0.0, 8.0, 8.0], [TOP, 8.0, 8.0]])
motor = np.array([[0.0, 6.0], [TOP, 1.0]])
speeds = np.linspace(0.0, TOP, 80001)
balance = speeds[np.argmin(np.abs(np.interp(speeds, motor[:, 0], motor[:, 1]) - DRAG * speeds**2 / MASS))]
print(f'motor and drag balance at {balance:.1f} m/s; at {TOP:.0f} m/s the motor yields {motor[-1, 1]:.1f}, the drag takes {DRAG * TOP**2 / MASS:.1f} m/s²')


def driven(curvature, start=None):
    closed = start is None
    return calc_vel_profile(ax_max_machines=motor, kappa=curvature, el_lengths=np.full(len(curvature) - (not closed), STEP),
                            closed=closed, drag_coeff=DRAG, m_veh=MASS, ggv=tyres, v_start=start)


ok = True
straight = np.zeros(1501)
for start in (80.0, 79.99, 60.0):
    speed = driven(straight, start)
    print(f'straight, from {start:5.2f} m/s: {speed[500]:.1f} m/s after 1 km, {speed[-1]:.1f} m/s after 3 km')
    ok = ok and abs(speed[-1] - (TOP if start == TOP else balance)) < 0.2
oval = np.full(3142, 1.0 / 1000.0)
chicane = oval.copy()
chicane[:20] = 1.0 / 400.0
for name, curvature in (('oval of 1000 m radius', oval), ('the same with 40 m of 400 m radius', chicane)):
    speed = driven(curvature)
    print(f'{name}: {speed.min():.1f} to {speed.max():.1f} m/s, a lap of {np.sum(STEP / speed):.1f} s')
    ok = ok and abs(speed.max() - (TOP if curvature is oval else balance)) < 0.3
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
