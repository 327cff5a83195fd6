#!/usr/bin/env bash
# freneticlib: its lateral acceleration is the longitudinal one: 0.75 m/s² on a straight road as in a bend, where v²/R is 2.45 m/s².
#
# Expected: the bicycle executor drives a road and reports features to search for dangerous roads by: on a straight road the lateral
# acceleration is 0, in a bend of 80 m at 14 m/s it comes to 2.45 m/s², four times as much at twice the speed; a car that never brakes
# has brake control 0; target_speed is in km/h, as its comment says, so 50 gives 14 m/s.
# What happens: `lat_acceleration` is the longitudinal acceleration times the cosine of the change of heading in one step, so it is 0.75 m/s²,
# the pull-away of the first seconds, on every road, and its median is 0 in a bend that is driven at constant speed. `lat_jerk` and
# `lat_cost` are derived from it: 0.57 on the straight road and in the bend. `brake_control` is the throttle, and a target of 50 is driven
# at 50 m/s, where the car fails to stay even on a straight road. The distance from the centre line is right.
# Why it matters: a search for the roads with the largest lateral acceleration or jerk ranks them by how the car pulls away.
#
# Output seen:
#   freneticlib 1.0
#   straight: at 14.0 m/s, v² times curvature 0.00 m/s², lateral acceleration at most 0.75, median 0.00, lateral cost 0.568, brake at most 0.75, 0.00 m off the line
#   left bend of 80 m: at 14.0 m/s, v² times curvature 2.45 m/s², lateral acceleration at most 0.75, median 0.00, lateral cost 0.568, brake at most 0.75, 0.02 m off the line
#   right bend of 80 m: at 14.0 m/s, v² times curvature 2.45 m/s², lateral acceleration at most 0.75, median 0.00, lateral cost 0.568, brake at most 0.75, 0.02 m off the line
#   target speed 50 on a straight road of 4 km: 50.0 m/s, FAIL; target speed 13.9: 13.9 m/s, PASS
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 freneticlib==1.0 kiwisolver==1.5.1 matplotlib==3.11.2 numpy==2.4.6 packaging==26.4 pandas==3.1.1 pillow==13.0.0 pyparsing==3.3.3 python-dateutil==4.0.0 scipy==1.17.1 shapely==2.2.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

from freneticlib.core.objective import MaxObjective
from freneticlib.executors.bicycle.bicycleexecutor import BicycleExecutor
from freneticlib.representations.kappa_representation import FixStepKappaRepresentation

print('freneticlib', version('freneticlib'))
RADIUS, SPEED = 80.0, 14.0
STRAIGHT, LEFT, RIGHT = [0.0] * 48, [1.0 / RADIUS] * 48, [-1.0 / RADIUS] * 48


def drive(road, feature, aggregate='max', target=SPEED):
    """A feature and the outcome of driving a road of curvatures every 10 m."""
    objective = MaxObjective(feature=feature, per_simulation_aggregator=aggregate)
    executor = BicycleExecutor(representation=FixStepKappaRepresentation(length=len(road)), objective=objective, target_speed=target)
    report = executor.execute_test({'test': list(road), 'method': 'given'})
    return float(report[feature]), str(report['outcome'])


seen = {}
for words, road in (('straight', STRAIGHT), ('left bend of 80 m', LEFT), ('right bend of 80 m', RIGHT)):
    values = [drive(road, 'speed', 'median')[0], drive(road, 'lat_acceleration')[0], drive(road, 'lat_acceleration', 'median')[0],
              drive(road, 'lat_cost')[0], drive(road, 'brake_control')[0], drive(road, 'distance_from_center')[0]]
    seen[words] = values
    curvature = abs(road[-1])
    print('{}: at {:.1f} m/s, v² times curvature {:.2f} m/s², lateral acceleration at most {:.2f}, median {:.2f}, lateral cost {:.3f}, '
          'brake at most {:.2f}, {:.2f} m off the line'.format(words, values[0], values[0] ** 2 * curvature, *values[1:]))
LONG = [0.0] * 400
fast, outcome = drive(LONG, 'speed', target=50)
slow, right = drive(LONG, 'speed', target=50 / 3.6)
print(f'target speed 50 on a straight road of 4 km: {fast:.1f} m/s, {outcome}; target speed {50 / 3.6:.1f}: {slow:.1f} m/s, {right}')
costs = [values[3] for values in seen.values()]
ok = all(abs(values[1] - 0.75) < 1e-6 and values[2] < 0.01 and abs(values[4] - 0.75) < 1e-6 for values in seen.values())
ok = ok and max(costs) - min(costs) < 0.001 and min(costs) > 0.5 and fast > 49.0 and (outcome, right) == ('FAIL', 'PASS')
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
