#!/usr/bin/env bash
# autopysta: with steps longer than the reaction time, Gipps' model accelerates for ever, through a car that stands, to 156 m/s.
#
# Expected: Gipps' driver at 20 m/s, 600 m behind a car that stands, speeds up, stops behind it with some 6 m from front to front, and has
# never more than the 33 m/s wished for, with steps of 0.4 s as with steps of 1 s; if a step longer than the reaction time is not
# possible, an error, as there is one for a duration that is no multiple of the step.
# What happens: for steps up to the reaction time (0.8 s by default) it is so. With a step of 1 s the car keeps its first acceleration of
# 1.34 m/s² all the time, drives through the one that stands and has 156 m/s after 101 s; without anybody ahead it has the same 156 m/s.
# A step of 0.5 s with a reaction time of 0.4 s does the same, one of 0.1 s with 0.05 s, too. Nothing is refused or warned of.
# Why it matters: 1 s is the step the library's own Newell model asks for in one variant, and a simulation of both kinds of drivers takes
# one step for all; on a road of 200 m a car that only accelerates looks plausible.
#
# Output seen:
#   autopysta 0.0.40.1
#   step of 0.1 s, reaction in 0.80 s, behind a car that stands: at most 31.6 m/s, at the end 0.0 m/s and 6.1 m behind it
#   step of 0.4 s, reaction in 0.80 s, behind a car that stands: at most 31.5 m/s, at the end 0.0 m/s and 6.3 m behind it
#   step of 0.8 s, reaction in 0.80 s, behind a car that stands: at most 31.4 m/s, at the end 0.0 m/s and 5.2 m behind it
#   step of 1.0 s, reaction in 0.80 s, behind a car that stands: at most 155.7 m/s, at the end 155.7 m/s and -8207.0 m behind it
#   step of 1.0 s, reaction in 1.00 s, behind a car that stands: at most 31.5 m/s, at the end 0.0 m/s and 4.4 m behind it
#   step of 0.5 s, reaction in 0.40 s, behind a car that stands: at most 155.1 m/s, at the end 155.1 m/s and -8163.4 m behind it
#   step of 0.1 s, reaction in 0.05 s, behind a car that stands: at most 154.5 m/s, at the end 154.5 m/s and -8128.6 m behind it
#   step of 0.4 s, reaction in 0.80 s, alone: at most 33.3 m/s
#   step of 1.0 s, reaction in 0.80 s, alone: at most 155.7 m/s
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
step, reaction, alone = float(sys.argv[1]), float(sys.argv[2]), sys.argv[3] == 'True'
autopysta.Clock.set_dt(step)
driver = autopysta.p_gipps()
driver.tau = reaction
gipps = autopysta.gipps(driver)
cars = [autopysta.Vehicle(gipps, 400.0, 20.0, 1)]
if not alone:
    standing = autopysta.p_idm()
    standing.v0 = 1e-3
    idm = autopysta.idm(standing)
    cars.insert(0, autopysta.Vehicle(idm, 1000.0, 0.0, 1))
nobody_else = autopysta.FixedDemandCreator(gipps, 0.0001, 1)
road, stay = autopysta.Geometry(20000.0, 1), autopysta.no_lch()
simulation = autopysta.Simulation(stay, 100.0, road, [nobody_else], cars, step)
results = simulation.run()
drives = results.get_all_trajectories()
ours = next(drive for drive in drives if drive.get_point_at(0).X() == 400.0)
points = [ours.get_point_at(index) for index in range(len(ours))]
print('\n' + json.dumps([max(point.V() for point in points), points[-1].V(), 1000.0 - points[-1].X()]))
sys.stdout.flush()
os._exit(0)
PY
"$dir/venv/bin/python" -W ignore - <<'PY'
import json
import subprocess
import sys
from importlib.metadata import version

print('autopysta', version('autopysta'))


def drive(step, reaction, alone=False):
    """Largest and last speed and the last distance to the car at 1000 m of Gipps' driver in 100 s."""
    command = [sys.executable, '-W', 'ignore', 'drive.py', str(step), str(reaction), str(alone)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


behind = {}
for step, reaction in ((0.1, 0.8), (0.4, 0.8), (0.8, 0.8), (1.0, 0.8), (1.0, 1.0), (0.5, 0.4), (0.1, 0.05)):
    behind[step, reaction] = most, last, gap = drive(step, reaction)
    print(f'step of {step} s, reaction in {reaction:.2f} s, behind a car that stands: at most {most:.1f} m/s, at the end {last:.1f} m/s '
          f'and {gap:.1f} m behind it')
free = {}
for step in (0.4, 1.0):
    free[step] = drive(step, 0.8, alone=True)
    print(f'step of {step} s, reaction in 0.80 s, alone: at most {free[step][0]:.1f} m/s')
ok = all((most < 33.4 and last < 0.1 and 3.0 < gap < 8.0) if step <= reaction else (last > 150.0 and gap < -8000.0)
         for (step, reaction), (most, last, gap) in behind.items())
ok = ok and free[0.4][0] < 33.4 and free[1.0][0] > 150.0
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
