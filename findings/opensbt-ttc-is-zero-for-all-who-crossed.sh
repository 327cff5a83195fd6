#!/usr/bin/env bash
# OpenSBT: the least time to collision of whoever crosses, at any time, is 0, and of whoever is driven into from behind 9e18 s.
#
# Expected: FitnessMinTTC is small where the two come to one place at one time: for a pedestrian hit while he crosses, for a crash into a car
# ahead, into one that stands, or head-on; and it is large for one who crosses 20 s earlier or later, or who walks away from the road.
# What happens: it is 0 (to a step) for all who cross, hit or not, before or after, and for one who walks away from the road beside it: the point is
# where the lines through both motions meet, behind them as well as ahead, and the time is the ego's to it, whenever the other one
# is there (the two branches of the tolerance of 0.5 s are the same). For motions along one line, head-on or from behind, and for all
# who stand, it is sys.maxsize, crash or not.
# Why it matters: a search that minimises it converges to scenes without danger, and passes by all rear-end crashes.
#
# Output seen:
#   opensbt 0.1.4
#   pedestrian, hit at 20 s: TTC 0 s, nearest 0.0 m
#   pedestrian who crosses at 2 s: TTC 7.58e-15 s, nearest 25.1 m
#   pedestrian who crosses at 38 s: TTC 7.58e-15 s, nearest 25.1 m
#   pedestrian who walks away from 10 m beside the road: TTC 0.0476 s, nearest 38.0 m
#   pedestrian who stands in the way: TTC 9.22e+18 s, nearest 0.0 m
#   car ahead at 10 m/s, driven into: TTC 9.22e+18 s, nearest 0.0 m
#   oncoming car on the same lane: TTC 9.22e+18 s, nearest 0.0 m
#   car that drives away ahead: TTC 9.22e+18 s, nearest 50.0 m
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps numpy==1.24.4 opensbt==0.1.4 pymoo==0.6.0.1 scipy==1.10.1
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import sys
from importlib.metadata import version

import numpy as np
from opensbt.evaluation.fitness import FitnessMinTTC
from opensbt.simulation.simulator import SimulationOutput

print('opensbt', version('opensbt'))
TIMES = np.arange(0.0, 40.0, 0.1)
EGO = np.column_stack([15.0 * TIMES, 0.0 * TIMES])


def ttc(start, velocity):
    """Minimal time to collision of an ego at 15 m/s, from the origin eastwards, with another one, and their least distance."""
    other = np.array(start) + np.outer(TIMES, velocity)
    speeds = {'ego': np.full(TIMES.size, 15.0), 'other': np.full(TIMES.size, np.hypot(*velocity))}
    output = SimulationOutput(times=TIMES.tolist(), location={'ego': EGO.tolist(), 'other': other.tolist()}, speed=speeds, otherParams={})
    return FitnessMinTTC().eval(output), np.hypot(*(EGO - other).T).min()


# the ego is at x = 300 after 20 s
SCENES = {'pedestrian, hit at 20 s': ((300.0, -28.0), (0.0, 1.4)),
          'pedestrian who crosses at 2 s': ((300.0, -2.8), (0.0, 1.4)),
          'pedestrian who crosses at 38 s': ((300.0, -53.2), (0.0, 1.4)),
          'pedestrian who walks away from 10 m beside the road': ((300.0, 10.0), (0.1, 1.4)),
          'pedestrian who stands in the way': ((300.0, 0.0), (0.0, 0.0)),
          'car ahead at 10 m/s, driven into': ((50.0, 0.0), (10.0, 0.0)),
          'oncoming car on the same lane': ((300.0, 0.0), (-15.0, 0.0)),
          'car that drives away ahead': ((50.0, 0.0), (25.0, 0.0))}
seen = {}
for name, scene in SCENES.items():
    seen[name] = ttc(*scene)
    print('{}: TTC {:.3g} s, nearest {:.1f} m'.format(name, *seen[name]))
values = {name: value for name, (value, _) in seen.items()}
ok = all(values[name] < 0.1 for name in SCENES if name.startswith('pedestrian') and 'stands' not in name)
ok = ok and all(values[name] == sys.maxsize for name in SCENES if name.startswith(('car', 'oncoming')) or 'stands' in name)
ok = ok and seen['pedestrian who crosses at 2 s'][1] > 20.0
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
