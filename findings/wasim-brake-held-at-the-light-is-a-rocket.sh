#!/usr/bin/env bash
# wa-simulator: after 10 s with the brake held at a red light the car leaves with 5 m/s² and reaches 200 km/h in 15 s.
#
# Expected: a car that stands with its brake on for 2, 10 or 30 s leaves, with full throttle, as it did from its first start: 2.7 m/s².
# What happens: after any hold of 2 s and more it leaves with 5 m/s², the force of a tyre that slides, and after 10 s goes on so for
# a quarter of a minute, to 60 m/s where it normally has 36. The brake is a negative throttle, so its torque turns the engine backwards
# as long as it is held, standing or not: at -444 rad/s after 10 s. Full throttle only slows that down, and while the slip is beyond
# one, whatever its sign, the car is pushed forward with the largest force. The longer the red light, the longer the push.
# The yaw rate, too, has the wrong sign: -0.28 rad/s in a left turn in which the heading grows by 0.28 rad each second.
# Why it matters: drives without a stop are right, and so is the way of braking; stop and go is what it fails at.
#
# Output seen:
#   wa-simulator 2.3.7
#   from the first start: 2.7 m/s², 36 m/s after 15 s
#   brake held for 2 s at a standstill: motor at -165 rad/s, leaves with 5.0 m/s², 26 m/s after 15 s
#   brake held for 10 s at a standstill: motor at -444 rad/s, leaves with 5.0 m/s², 60 m/s after 15 s
#   brake held for 30 s at a standstill: motor at -900 rad/s, leaves with 5.0 m/s², 60 m/s after 15 s
#   left turn after 5 s: heading grows by +0.28 rad/s, yaw rate -0.28 rad/s
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps asttokens==3.0.2 contourpy==1.3.3 cycler==0.12.1 dill==0.4.1 executing==2.3.0 fonttools==4.68.0 ipython==9.18.1 ipython_pygments_lexers==1.1.1 jedi==0.20.1 kiwisolver==1.5.1 matplotlib==3.11.2 matplotlib-inline==0.2.2 multipledispatch==1.0.0 numpy==1.26.4 packaging==26.4 parso==0.8.7 pexpect==4.9.0 pillow==13.0.0 prompt_toolkit==3.0.53 psutil==7.2.2 ptyprocess==0.7.0 pure_eval==0.2.4 Pygments==2.21.0 pyparsing==3.3.3 pyrr==0.10.3 python-dateutil==4.0.0 PyYAML==6.0.4 scipy==1.17.1 stack-data==0.6.3 traitlets==5.16.1 typing_extensions==4.16.0 tzdata==2026.6 wa-simulator==2.3.7 wcwidth==0.9.4
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import json
from importlib.metadata import version

import wa_simulator as wa

print('wa-simulator', version('wa-simulator'))
CAR = {'Wheelbase': 2.8, 'Mass': 2000.0, 'Gear Ratio': 0.35, 'Effective Radius': 0.3, 'Inertia': 10.0, 'Tire Radius': 0.3,
       'Aerodynamic Coefficient': 1.36, 'Friction Coefficient': 0.01, 'C': 10000.0, 'Max Force': 10000.0,
       'Torque Coefficients': [400.0, 0.1, -0.0002], 'Steering': [-0.5, 0.5], 'Throttle': [0.0, 1.0], 'Braking': [0.0, 1.0]}
with open('car.json', 'w') as file:
    json.dump({'Visualization Properties': {}, 'Vehicle Properties': CAR}, file)
STEP, BRAKED = 0.002, 12.0


def drive(pedals, duration, steering=0.0):
    """Speeds, motor speeds, headings and yaw rates every 0.1 s of a drive with (throttle, braking) by the time."""
    inputs = wa.WAVehicleInputs(steering, 0.0, 0.0)
    car = wa.WALinearKinematicBicycle(wa.WASystem(step_size=STEP), inputs, 'car.json')
    kept = []
    for count in range(round(duration / STEP)):
        inputs.throttle, inputs.braking = pedals(count * STEP)
        car.synchronize(count * STEP)
        car.advance(STEP)
        if count % round(0.1 / STEP) == 0:
            kept.append((car.get_pos_dt().length, car._omega, car.get_rot().to_euler_yaw(), car._yaw_dt))
    return list(zip(*kept))


ok = True
first = drive(lambda time: (1.0, 0.0), 16.0)
print(f'from the first start: {first[0][20] / 2.0:.1f} m/s², {first[0][150]:.0f} m/s after 15 s')
for hold in (2.0, 10.0, 30.0):
    go = BRAKED + hold
    speeds, motor, _, _ = drive(lambda time: (1.0, 0.0) if time < 5.0 or time >= go else (0.0, 1.0), go + 16.0)
    leave = round(go / 0.1)
    print(f'brake held for {hold:.0f} s at a standstill: motor at {motor[leave]:.0f} rad/s, leaves with {speeds[leave + 20] / 2.0:.1f} m/s², '
          f'{speeds[leave + 150]:.0f} m/s after 15 s')
    ok = ok and speeds[leave] < 0.05 and 4.5 < speeds[leave + 20] / 2.0 < 5.5 and motor[leave] < -80.0
    ok = ok and (hold < 5.0 or speeds[leave + 150] > 50.0)
_, _, headings, rates = drive(lambda time: (0.5, 0.0), 6.0, steering=0.1)
print(f'left turn after 5 s: heading grows by {(headings[50] - headings[49]) / 0.1:+.2f} rad/s, yaw rate {rates[50]:+.2f} rad/s')
ok = ok and first[0][20] / 2.0 < 3.0 and first[0][150] < 40.0 and rates[50] < -0.2 and headings[50] > headings[49]
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
