#!/usr/bin/env bash
# fiss-planner: FISS brakes from 13.9 to 3.4 m/s where driving on costs a fifteenth, and finds that in the mirror image.
#
# Expected: FISS looks at a part of the samples only and comes, as the package says, to near-optimal trajectories; what it
# misses of the exhaustive search (FOP) is small, and left and right are alike.
# What happens: slower cars ahead on the ego's lane and on its left, the right one free: FOP and FISS+ change to the right and
# keep 13.4 m/s, FISS goes to the left behind the slowest one, at 15 times the cost. With left and right exchanged it finds
# the optimum. Of 431 random scenes on three lanes 15 % cost FISS a tenth more or worse, up to 17 times, FISS+ 1 %.
# Why it matters: which of two equal lanes is free decides whether the car brakes hard in light traffic, and its plan has
# nothing to show that a better one was among the samples.
#
# Output seen:
#   fiss-planner 1.0.0
#   three cars, fop: cost 6.0, to -3.50 m and 13.4 m/s, a -0.17
#   three cars, fiss: cost 88.1, to +3.15 m and 3.4 m/s, a -3.17
#   three cars, fiss_plus: cost 5.8, to -3.52 m and 13.4 m/s, a -0.16
#   their mirror image, fop: cost 6.0, to +3.50 m and 13.4 m/s, a -0.17
#   their mirror image, fiss: cost 6.0, to +3.50 m and 13.4 m/s, a -0.17
#   their mirror image, fiss_plus: cost 5.8, to +3.52 m and 13.4 m/s, a -0.16
#   fiss: 431 scenes, 15% more than a tenth dearer, the worst 17.2 times
#   fiss_plus: 431 scenes, 1% more than a tenth dearer, the worst 2.7 times
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps fiss-planner==1.0.0 numpy==2.4.6
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import fiss_planner as fp
import numpy as np

print('fiss-planner', version('fiss-planner'))
x = np.arange(0.0, 300.0, 2.0)
road = fp.ReferenceLine(x, np.zeros_like(x))
lanes = fp.Corridor.parallel_lanes(0.0, road.length, 3.5, 1, 1)


def planned(kind, speed, wanted, cars, beside=0.0):
    """The plan of a planner on the middle one of three lanes, among cars (place, lane to the left, speed)."""
    traffic = [fp.predict_constant_velocity(k, s, 3.5 * lane, 0.0, v, 4.5, 1.9, 6.0, 0.1) for k, (s, lane, v) in enumerate(cars)]
    start = fp.FrenetState(s=10.0, s_d=speed, d=beside)
    return fp.make_planner(fp.make_config(kind)).plan(start, road, lanes, traffic, target_speed=wanted)


rows = {}
among = ((26.4, 1, 2.9), (67.4, 0, 0.7), (61.0, -1, 8.0))
for name, side in (('three cars', 1), ('their mirror image', -1)):
    for kind in ('fop', 'fiss', 'fiss_plus'):
        plan = planned(kind, 13.9, 13.4, [(s, side * lane, v) for s, lane, v in among]).trajectory
        rows[side, kind] = plan.total_cost(), plan.s_d[-1]
        print(f'{name}, {kind}: cost {plan.total_cost():.1f}, to {plan.d[-1]:+.2f} m and {plan.s_d[-1]:.1f} m/s, a {min(plan.s_dd):.2f}')
random = np.random.default_rng(0)
ratios = {'fiss': [], 'fiss_plus': []}
for _ in range(500):
    cars = [(random.uniform(20.0, 80.0), random.integers(-1, 2), random.uniform(0.0, 10.0)) for _ in range(random.integers(1, 6))]
    scene = random.uniform(3.0, 20.0), random.uniform(5.0, 20.0), cars, random.uniform(-0.5, 0.5)
    best = planned('fop', *scene)
    if best.success:
        for kind, values in ratios.items():
            values.append(planned(kind, *scene).trajectory.total_cost() / best.trajectory.total_cost())
for kind, values in ratios.items():
    print(f'{kind}: {len(values)} scenes, {np.mean(np.array(values) > 1.1):.0%} more than a tenth dearer, the worst {max(values):.1f} times')
cost = {key: value[0] for key, value in rows.items()}
ok = cost[1, 'fiss'] > 10.0 * cost[1, 'fop'] and rows[1, 'fiss'][1] < 4.0 and abs(cost[1, 'fop'] - cost[-1, 'fop']) < 1e-6
ok = ok and abs(cost[-1, 'fiss'] - cost[-1, 'fop']) < 1e-6 and cost[1, 'fiss_plus'] < cost[1, 'fop']
ok = ok and np.mean(np.array(ratios['fiss']) > 1.1) > 0.1 and max(ratios['fiss']) > 10.0 and min(ratios['fiss']) > 1.0 - 1e-9
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
