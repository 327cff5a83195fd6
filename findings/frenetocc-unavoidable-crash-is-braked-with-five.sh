#!/usr/bin/env bash
# frenetix-occlusion: a crash that no brake avoids asks for 4.92 m/s² and has the brake threat number 0.43, like one that 5 m/s² avoid.
#
# Expected: the brake threat number is the deceleration needed over the possible one: 1 is the border of what can be avoided. From 20 m/s, 5 m
# behind a car that stands, 40 m/s² are needed, with 11.5 m/s² possible a number of 3.5; 30 m behind it, 6.7 m/s² and 0.58.
# What happens: for all gaps below 40 m the answer is 4.92 m/s² and 0.43. The deceleration is searched by halving between 0 and 5, and if
# all tries collide the last one is the answer, as if it had avoided the crash; no number is ever above 0.43 for this car.
# At the other end it is too small: 95 m behind the car, 5 s of trajectory end before the crash of the braking car, and 0.39 m/s²
# pass as enough where 2.1 are needed.
# Why it matters: a limit on the number, of 0.8 or 1, passes every trajectory, the worst with the same number as the harmless.
#
# Output seen:
#   frenetix-occlusion 2024.1.3
#   gap of 5 m, 40.0 m/s² needed, 3.48 of the possible: time to collision 0.3 s, answer 4.92 m/s², threat number 0.43
#   gap of 10 m, 20.0 m/s² needed, 1.74 of the possible: time to collision 0.5 s, answer 4.92 m/s², threat number 0.43
#   gap of 20 m, 10.0 m/s² needed, 0.87 of the possible: time to collision 1.0 s, answer 4.92 m/s², threat number 0.43
#   gap of 30 m, 6.7 m/s² needed, 0.58 of the possible: time to collision 1.5 s, answer 4.92 m/s², threat number 0.43
#   gap of 39 m, 5.1 m/s² needed, 0.45 of the possible: time to collision 2.0 s, answer 4.92 m/s², threat number 0.43
#   gap of 50 m, 4.0 m/s² needed, 0.35 of the possible: time to collision 2.5 s, answer 4.30 m/s², threat number 0.37
#   gap of 80 m, 2.5 m/s² needed, 0.22 of the possible: time to collision 4.0 s, answer 1.64 m/s², threat number 0.14
#   gap of 95 m, 2.1 m/s² needed, 0.18 of the possible: time to collision 4.8 s, answer 0.39 m/s², threat number 0.03
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps commonroad-drivability-checker==2025.4.0 commonroad-io==2023.4 commonroad-vehicle-models==3.0.2 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 frenetix-occlusion==2024.1.3 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 networkx==3.6.1 numpy==1.26.4 omegaconf==2.4.0 packaging==26.4 pillow==13.0.0 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==4.0.0 PyYAML==6.0.4 rtree==1.4.1 scipy==1.13.1 shapely==2.0.7 tqdm==4.70.1 tzdata==2026.6
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
from types import SimpleNamespace

import numpy as np
from commonroad.geometry.shape import Rectangle
from commonroad.scenario.obstacle import ObstacleType
from frenetix_occlusion.metrics.be import BE
from frenetix_occlusion.metrics.dce import DCE
from frenetix_occlusion.metrics.ttc import TTC

print('frenetix-occlusion', version('frenetix-occlusion'))
LENGTH, REAR, SPEED, DT = 4.5, 1.4, 20.0, 0.1
CAR = SimpleNamespace(length=LENGTH, width=1.8, wb_rear_axle=REAR, a_max=11.5)
TIMES = np.arange(51) * DT


def evaluate(gap):
    """Time to collision, deceleration and brake threat number at 20 m/s with a gap to a car that stands."""
    zeros = 0.0 * TIMES
    trajectory = SimpleNamespace(cartesian=SimpleNamespace(x=SPEED * TIMES - REAR, y=zeros, theta=zeros, v=zeros + SPEED, a=zeros))
    standing = {'pos_list': np.column_stack([zeros + gap + LENGTH, zeros]), 'orientation_list': zeros, 'v_list': zeros}
    agent = SimpleNamespace(shape=Rectangle(LENGTH, 1.8), obstacle_type=ObstacleType.CAR)
    agents = SimpleNamespace(dt=DT, predictions={1: standing}, agent_by_prediction_id=lambda _: agent, visualization=None)
    results = {}
    results['dce'] = DCE(CAR, agents).evaluate(trajectory, results)
    results['ttc'] = TTC(agents).evaluate(trajectory, results)
    answer = BE(CAR, agents).evaluate(trajectory, results)[1]
    return results['ttc'][1], answer['required_constant_deceleration'], answer['break_threat_number']


seen = {}
for gap in (5.0, 10.0, 20.0, 30.0, 39.0, 50.0, 80.0, 95.0):
    seen[gap] = evaluate(gap)
    needed = SPEED**2 / (2.0 * gap)
    print('gap of {:.0f} m, {:.1f} m/s² needed, {:.2f} of the possible: time to collision {:.1f} s, answer {:.2f} m/s², threat number {:.2f}'
          .format(gap, needed, needed / CAR.a_max, *seen[gap]))
ok = len({seen[gap][1:] for gap in (5.0, 10.0, 20.0, 30.0, 39.0)}) == 1 and abs(seen[5.0][2] - 0.43) < 0.01
ok = ok and abs(seen[50.0][1] - 4.0) < 0.5 and seen[95.0][1] < 0.5
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
