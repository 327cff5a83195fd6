#!/usr/bin/env bash
# CAVSandbox: the faster the car ahead drives away, the harder its drivers brake.
#
# Expected: the intelligent driver model brakes for who is near and slower. Behind a car that drives away the desired gap is
# small, and the model accelerates, the more the faster that car is.
# What happens: the desired gap, with its term by the approach, is squared without a bound at zero. A car that cuts in 20 m
# ahead and is 5 m/s faster is followed with 1 m/s², one that is 10 m/s faster is braked for with 3 m/s², one that
# is 15 m/s faster with 6 m/s², the hardest that the model knows, and the follower is at 14 m/s by the time that
# one 20 m/s faster is out of the way.
# Why it matters: ACC and human drivers of the package are this model; at a merge of fast on slow traffic it is the
# followers' emergency braking, in scenes without any conflict, that makes the jam.
#
# Output seen:
#   cavsandbox 0.11.2
#   20 m behind a car -5, 0, 5, 10, 15, 20 m/s faster: -6.0, -4.8, +1.0, -3.0, -6.0, -6.0 m/s²
#   50 m behind a car -5, 0, 5, 10, 15, 20 m/s faster: -2.4, +0.1, +1.0, +0.4, -1.8, -5.6 m/s²
#   a cut-in by one 5 m/s faster: from 25 down to 25.0 m/s
#   a cut-in by one 10 m/s faster: from 25 down to 20.7 m/s
#   a cut-in by one 15 m/s faster: from 25 down to 15.0 m/s
#   a cut-in by one 20 m/s faster: from 25 down to 14.1 m/s
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps cavsandbox==0.11.2 contourpy==1.3.3 cycler==0.12.1 et_xmlfile==2.0.0 filelock==4.3.1 fonttools==4.68.0 kiwisolver==1.5.1 matplotlib==3.11.2 numpy==2.4.6 openpyxl==3.1.5 packaging==26.4 pandas==3.1.1 pillow==13.0.0 pygame==2.6.1 pyparsing==3.3.3 python-dateutil==4.0.0 PyYAML==6.0.4 tzdata==2026.6
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

from cacc_sim import IDMModel, VehicleState
from cacc_sim.plant import VehiclePlant

print('cavsandbox', version('cavsandbox'))
STEP, SPEED = 0.01, 25.0


def asked(gap, faster):
    """Acceleration asked for behind a car that drives faster by so much."""
    seen = VehicleState(speed=SPEED, acceleration=0.0, time=0.0, position=0.0, gap=gap, lead_speed=SPEED + faster)
    return IDMModel(desired_speed=33.0, time_headway=1.5).compute(seen).acceleration


def slowest(faster):
    """Least speed after a car has cut in 20 m ahead that drives away, faster by so much."""
    model, lead = IDMModel(desired_speed=33.0, time_headway=1.5), VehiclePlant(25.0, SPEED + faster, 5.0, STEP)
    own, least = VehiclePlant(0.0, SPEED, 5.0, STEP), SPEED
    for k in range(1000):
        seen = VehicleState(speed=own.v, acceleration=own.a, time=k * STEP, position=own.x, gap=own.gap_to(lead), lead_speed=lead.v)
        own.step(model.compute(seen).acceleration)
        lead.step(0.0)
        least = min(least, own.v)
    return least


asks, speeds = {}, {}
for gap in (20.0, 50.0):
    asks[gap] = [asked(gap, faster) for faster in (-5.0, 0.0, 5.0, 10.0, 15.0, 20.0)]
    print(f'{gap:.0f} m behind a car -5, 0, 5, 10, 15, 20 m/s faster: ' + ', '.join(f'{a:+.1f}' for a in asks[gap]) + ' m/s²')
for faster in (5.0, 10.0, 15.0, 20.0):
    speeds[faster] = slowest(faster)
    print(f'a cut-in by one {faster:.0f} m/s faster: from {SPEED:.0f} down to {speeds[faster]:.1f} m/s')
ok = [round(a, 1) for a in asks[20.0]] == [-6.0, -4.8, 1.0, -3.0, -6.0, -6.0] and asks[50.0][2] > asks[50.0][3] > 0.0 > asks[50.0][4]
ok = ok and speeds[5.0] > 24.9 and speeds[10.0] < 21.0 and speeds[15.0] < 16.0 and speeds[20.0] < 15.0
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
