#!/usr/bin/env bash
# autopysta: drivers of the Laval-Leclercq model follow at the distance of a jam, 6.67 m from front to front, at every speed.
#
# Expected: the model is Newell's with a bounded acceleration, so behind a car at constant speed it keeps Newell's spacing in the end:
# 1/k + v/(w k) with the wave speed w and the jam density k, 26.7 m at 15 m/s. Its own method equil_spcg says the same.
# What happens: at 5, 15 and 24 m/s the car ends 6.67 m behind the front of the one ahead, with a car's length of 4.5 m that is 2.2 m of
# space at 24 m/s, with steps of 0.1 s as of 1 s; only in a jam is it right. Newell's model in the same simulation keeps the spacing
# that equil_spcg gives.
# Why it matters: the capacity of a lane comes out as 3.6 vehicles per second at 24 m/s instead of 0.6.
#
# Output seen:
#   autopysta 0.0.40.1
#   newell behind 5 m/s, step of 0.1 s: ends at 5.0 m/s with 13.33 m, equil_spcg 13.33 m, formula 13.33 m; at most 25.0 m/s, hardest braking 200 m/s²
#   newell behind 15 m/s, step of 0.1 s: ends at 15.0 m/s with 26.67 m, equil_spcg 26.67 m, formula 26.67 m; at most 25.0 m/s, hardest braking 100 m/s²
#   newell behind 24 m/s, step of 0.1 s: ends at 24.0 m/s with 38.67 m, equil_spcg 38.67 m, formula 38.67 m; at most 25.0 m/s, hardest braking 10 m/s²
#   laval behind 5 m/s, step of 0.1 s: ends at 5.0 m/s with 6.67 m, equil_spcg 13.33 m, formula 13.33 m; at most 34.4 m/s, hardest braking 148 m/s²
#   laval behind 15 m/s, step of 0.1 s: ends at 15.0 m/s with 6.67 m, equil_spcg 26.67 m, formula 26.67 m; at most 34.4 m/s, hardest braking 133 m/s²
#   laval behind 24 m/s, step of 0.1 s: ends at 24.0 m/s with 6.67 m, equil_spcg 38.67 m, formula 38.67 m; at most 34.4 m/s, hardest braking 72 m/s²
#   laval behind 5 m/s, step of 1.0 s: ends at 5.0 m/s with 6.67 m, equil_spcg 13.33 m, formula 13.33 m; at most 34.4 m/s, hardest braking 17 m/s²
#   laval behind 15 m/s, step of 1.0 s: ends at 15.0 m/s with 6.67 m, equil_spcg 26.67 m, formula 26.67 m; at most 34.4 m/s, hardest braking 13 m/s²
#   laval behind 24 m/s, step of 1.0 s: ends at 24.0 m/s with 6.67 m, equil_spcg 38.67 m, formula 38.67 m; at most 34.4 m/s, hardest braking 7 m/s²
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps autopysta==0.0.40.1 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 kiwisolver==1.5.1 matplotlib==3.11.2 numpy==1.26.4 packaging==26.4 pillow==13.0.0 pyparsing==3.3.3 python-dateutil==4.0.0
cd "$dir"
cat > drive.py <<'PY'
import json
import os
import sys

import autopysta

# One drive to a process: the clock of the simulation is a global one.
name, speed, step = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
autopysta.Clock.set_dt(step)
follower = getattr(autopysta, name)()
steady = autopysta.p_idm()
steady.v0 = speed
idm = autopysta.idm(steady)
cars = [autopysta.Vehicle(idm, 600.0, speed, 1), autopysta.Vehicle(follower, 400.0, speed, 1)]
nobody_else = autopysta.FixedDemandCreator(follower, 0.0001, 1)
road, stay = autopysta.Geometry(20000.0, 1), autopysta.no_lch()
simulation = autopysta.Simulation(stay, 300.0, road, [nobody_else], cars, step)
results = simulation.run()
drives = results.get_all_trajectories()
ahead, ours = (next(drive for drive in drives if drive.get_point_at(0).X() == place) for place in (600.0, 400.0))
last = min(len(ahead), len(ours)) - 1
speeds = [ours.get_point_at(index).V() for index in range(last + 1)]
braking = max(before - after for before, after in zip(speeds, speeds[1:])) / step
parameters = autopysta.p_laval() if name == 'laval' else autopysta.p_newell()
print('\n' + json.dumps({
    'spacing': ahead.get_point_at(last).X() - ours.get_point_at(last).X(), 'speed': speeds[-1], 'most': max(speeds), 'braking': braking,
    'equilibrium': follower.equil_spcg(speed, speed), 'expected': 1.0 / parameters.kj + speed / (parameters.w * parameters.kj)}))
sys.stdout.flush()
os._exit(0)
PY
"$dir/venv/bin/python" -W ignore - <<'PY'
import json
import subprocess
import sys
from importlib.metadata import version

print('autopysta', version('autopysta'))
ok = True
for name, step in (('newell', 0.1), ('laval', 0.1), ('laval', 1.0)):
    for speed in (5.0, 15.0, 24.0):
        command = [sys.executable, '-W', 'ignore', 'drive.py', name, str(speed), str(step)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        seen = json.loads(done.stdout.splitlines()[-1])
        print(f'{name} behind {speed:.0f} m/s, step of {step} s: ends at {seen["speed"]:.1f} m/s with {seen["spacing"]:.2f} m, '
              f'equil_spcg {seen["equilibrium"]:.2f} m, formula {seen["expected"]:.2f} m; at most {seen["most"]:.1f} m/s, '
              f'hardest braking {seen["braking"]:.0f} m/s²')
        ok = ok and abs(seen['equilibrium'] - seen['expected']) < 0.01 and abs(seen['speed'] - speed) < 0.01
        ok = ok and abs(seen['spacing'] - (seen['expected'] if name == 'newell' else 6.67)) < 0.1
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
