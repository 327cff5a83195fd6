#!/usr/bin/env bash
# commonroad-vehicle-models: the single-track model (ST) is unusable in reverse; at
# -2 m/s and a steering angle of 0.0001 rad the car spins within a tenth of a
# second.
#
# Expected: reversing slowly and straight, ST and the kinematic model (KS) agree, as
# they do forward; the parameters allow speeds down to -13.9 m/s.
# What happens: the damping terms are divided by the signed speed, so below -0.1 m/s
# they become excitation (growth rates of 100 per second at -2 m/s). Yaw rate and
# slip reach absurd values and adaptive integrators crawl or give up. There is no
# error in the model, and the drivability checker refuses
# each such step for its friction circle.
# Why it matters: evasive or parking repairs that cross zero speed look infeasible
# in ST; a controller that overshoots a stop by 0.1 m/s blows up in simulation.
#
# Output seen:
#   commonroad-vehicle-models 3.0.2
#   numpy 2.4.6
#   allowed speeds -13.9 to 50.8
#    2.00 m/s for at most 1.0 s: largest ST yaw rate 7.76e-05 rad/s, KS heading at its end 7.8e-05 rad
#    0.50 m/s for at most 1.0 s: largest ST yaw rate 1.94e-05 rad/s, KS heading at its end 1.9e-05 rad
#   -0.05 m/s for at most 1.0 s: largest ST yaw rate 0 rad/s, KS heading at its end -1.9e-06 rad
#   -0.50 m/s for at most 0.1 s: largest ST yaw rate 104 rad/s, KS heading at its end -7e-07 rad
#   -2.00 m/s for at most 0.1 s: largest ST yaw rate 3.77 rad/s, KS heading at its end -7.8e-06 rad
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-vehicle-models==3.0.2 numpy==2.4.6 scipy==1.17.1
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
for name in ['commonroad-vehicle-models', 'numpy']:
    print(name, version(name))
import numpy as np
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.vehicle_dynamics_ks import vehicle_dynamics_ks
from vehiclemodels.vehicle_dynamics_st import vehicle_dynamics_st

p = parameters_vehicle2()
print("allowed speeds", p.longitudinal.v_min, "to", p.longitudinal.v_max)

def runge_kutta(model, x, h):
    def f(z):
        return np.array(model(list(z), [0.0, 0.0], p))
    a = f(x)
    b = f(x + h / 2 * a)
    c = f(x + h / 2 * b)
    d = f(x + h * c)
    return x + h / 6 * (a + 2 * b + 2 * c + d)

rate = {}
for speed in (2.0, 0.5, -0.05, -0.5, -2.0):
    duration = 0.1 if speed <= -0.5 else 1.0
    x, y, step = np.array([0.0, 0.0, 1e-4, speed, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 1e-4, speed, 0.0]), 1e-4
    largest = 0.0
    for _ in range(round(duration / step)):
        x, y = runge_kutta(vehicle_dynamics_st, x, step), runge_kutta(vehicle_dynamics_ks, y, step)
        largest = max(largest, abs(float(x[5])))
        if largest > 100.0:
            break
    rate[speed] = largest
    print(f"{speed:5.2f} m/s for at most {duration} s: largest ST yaw rate {largest:.3g} rad/s, KS heading at its end {y[4]:.2g} rad")
assert rate[2.0] < 1e-4 and rate[0.5] < 1e-4 and rate[-0.05] < 1e-4
assert rate[-0.5] > 1.0 and rate[-2.0] > 1.0
print("behaviour as stated")
PY
