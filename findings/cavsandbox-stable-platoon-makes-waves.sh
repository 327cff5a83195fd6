#!/usr/bin/env bash
# CAVSandbox: a string-stable platoon behind a car at constant speed makes a stop-and-go wave of its own.
#
# Expected: sixteen cars with the package's CACC controller, which calls its gains string stable, begin at their set gaps and at
# the speed of the car in front, which keeps it. Without noise, delay or disturbance nothing happens.
# What happens: with the kinematic drive it is so. With the default drive (lag) the cars begin to swing, each more than the one
# ahead: the second by 0.02 m/s, the third by 0.08, the sixth by 0.37, from the eighth on by half a metre per second, for ever.
# Commands between -0.05 and 0.05 m/s² are replaced by what a coasting car does: at 25 m/s who asks for 0 gets -0.23 m/s²,
# who asks for 0.051 gets it.
# Why it matters: string stability is what the package is there to show, and its own test of it is about the gains alone. What
# is measured with the default drive, with or without V2V, has this wave in it.
#
# Output seen:
#   cavsandbox 0.11.2
#   kinematic, string stable by its own test: True; cars 1, 2, 3, 4, 6, 8, 12 and 16 swing by 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 m/s
#   lag, string stable by its own test: True; cars 1, 2, 3, 4, 6, 8, 12 and 16 swing by 0.00 0.02 0.08 0.18 0.37 0.51 0.53 0.45 m/s
#   asked for 0 m/s² the drive gives -0.23 m/s², asked for 0.051 m/s² 0.051 m/s²
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps cavsandbox==0.11.2 contourpy==1.3.3 cycler==0.12.1 et_xmlfile==2.0.0 filelock==4.3.1 fonttools==4.68.0 kiwisolver==1.5.1 matplotlib==3.11.2 numpy==2.4.6 openpyxl==3.1.5 packaging==26.4 pandas==3.1.1 pillow==13.0.0 pygame==2.6.1 pyparsing==3.3.3 python-dateutil==4.0.0 PyYAML==6.0.4 tzdata==2026.6
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import numpy as np
from cacc_sim import CACCController, CACCModel, VehicleState
from cacc_sim.plant import VehiclePlant, VehicleResponseModel

print('cavsandbox', version('cavsandbox'))
STEP, SPEED, LENGTH = 0.01, 25.0, 5.0


def swings(mode, cars):
    """Half of the range of every car's speed in the last of four minutes behind one at constant speed, and least command."""
    controllers = [CACCController() for _ in range(cars)]
    gap = controllers[0].T_h * SPEED + controllers[0].s0
    models = [CACCModel(desired_speed=40.0, controller=c) for c in controllers]
    drives = [VehicleResponseModel(mode=mode, dt=STEP) for _ in range(cars)]
    row = [VehiclePlant(-k * (gap + LENGTH), SPEED, LENGTH, STEP) for k in range(cars + 1)]
    speeds = []
    for k in range(24000):
        applied = []
        for model, drive, lead, own in zip(models, drives, row, row[1:]):
            seen = VehicleState(speed=own.v, acceleration=own.a, time=k * STEP, position=own.x, gap=own.gap_to(lead),
                                lead_speed=lead.v, lead_a_v2v=lead.a)
            applied.append(drive.step(model.compute(seen).acceleration, own.v))
        for own, acceleration in zip(row, [0.0, *applied]):
            own.step(acceleration)
        if k >= 18000:
            speeds.append([own.v for own in row])
    return controllers[0].string_stable, np.ptp(speeds, axis=0) / 2.0


seen = {}
for mode in ('kinematic', 'lag'):
    stable, seen[mode] = swings(mode, 16)
    print(f'{mode}, string stable by its own test: {stable}; cars 1, 2, 3, 4, 6, 8, 12 and 16 swing by '
          + ' '.join(f'{seen[mode][k]:.2f}' for k in (1, 2, 3, 4, 6, 8, 12, 16)) + ' m/s')
drive = VehicleResponseModel(dt=STEP)
for _ in range(1000):
    coasting = drive.step(0.0, SPEED)
drive = VehicleResponseModel(dt=STEP)
for _ in range(1000):
    driving = drive.step(0.051, SPEED)
print(f'asked for 0 m/s² the drive gives {coasting:.2f} m/s², asked for 0.051 m/s² {driving:.3f} m/s²')
ok = stable and np.all(seen['kinematic'] < 1e-9) and seen['lag'][1] < 0.01 and seen['lag'][4] > 0.1 and np.all(seen['lag'][8:] > 0.4)
ok = ok and abs(coasting + 0.23) < 0.01 and abs(driving - 0.051) < 0.001
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
