#!/usr/bin/env bash
# drivability checker: the multi-body (MB) vehicle built from a planning problem's
# initial state does not move, and heading north it starts sideways.
#
# Expected: an input vector of zeros at 10 m/s takes a vehicle of any model 10 m
# forward in a second; the MB states are those of the vehicle-models package
# (init_mb): velocities in the body frame, tyre deflections of centimetres.
# What happens: (1) the vertical deflection of the axles is load / 2 * stiffness
# instead of load / (2 * stiffness): 4.6e8 m. The simulation returns the initial
# position for ever, without an error. (2) the speed is split by the heading as if
# the body velocities were global ones: at heading 90 degrees the longitudinal
# speed is 0, the lateral speed 10 m/s and the wheels stand still.
# Why it matters: every MB solution given as an input vector, and everything that
# calls convert_initial_state or simulate_trajectory for MB, is judged on a car
# that stands at the start. KS and ST are right.
#
# Output seen:
#   commonroad-drivability-checker 2025.4.0
#   commonroad-vehicle-models 3.0.2
#   KS heading  0: 10.000 m in 1 s at 10 m/s
#   ST heading  0: 10.000 m in 1 s at 10 m/s
#   MB heading  0: 0.000 m in 1 s at 10 m/s
#   KS heading 90: 10.000 m in 1 s at 10 m/s
#   ST heading 90: 10.000 m in 1 s at 10 m/s
#   MB heading 90: 0.000 m in 1 s at 10 m/s
#   heading 90, checker:        longitudinal 0.0 m/s, lateral 10.0 m/s, axle 4.63e+08 m, wheel 0.0 rad/s
#   heading 90, vehicle models: longitudinal 10.0 m/s, lateral 0.0 m/s, axle 0.0185 m, wheel 29.1 rad/s
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-io==2024.3 numpy==2.4.6 scipy==1.17.1 shapely==2.2.0 commonroad-drivability-checker==2025.4.0 commonroad-vehicle-models==3.0.2
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
for name in ['commonroad-drivability-checker', 'commonroad-vehicle-models']:
    print(name, version(name))
import numpy as np
from commonroad.common.solution import VehicleType
from commonroad.scenario.state import InitialState, InputState
from commonroad.scenario.trajectory import Trajectory
from commonroad_dc.feasibility.vehicle_dynamics import VehicleDynamics
from vehiclemodels.init_mb import init_mb

inputs = Trajectory(0, [InputState(time_step=k, acceleration=0.0, steering_angle_speed=0.0) for k in range(10)])
moved = {}
for heading in (0.0, np.pi / 2):
    start = InitialState(time_step=0, position=np.array([0.0, 0.0]), orientation=heading, velocity=10.0,
                         yaw_rate=0.0, slip_angle=0.0, acceleration=0.0)
    for model in ("KS", "ST", "MB"):
        dynamics = getattr(VehicleDynamics, model)(VehicleType.BMW_320i)
        path = dynamics.simulate_trajectory(start, inputs, 0.1)
        moved[model, heading] = float(np.linalg.norm(path.state_list[-1].position - path.state_list[0].position))
        print(f"{model} heading {np.degrees(heading):2.0f}: {moved[model, heading]:.3f} m in 1 s at 10 m/s")
state = dynamics.convert_initial_state(start)
right = init_mb([0.0, 0.0, 0.0, 10.0, np.pi / 2, 0.0, 0.0], dynamics.parameters)
print(f"heading 90, checker:        longitudinal {state.velocity:.1f} m/s, lateral {state.velocity_y:.1f} m/s, "
      f"axle {state.position_z_front:.3g} m, wheel {state.left_front_wheel_angular_speed:.1f} rad/s")
print(f"heading 90, vehicle models: longitudinal {right[3]:.1f} m/s, lateral {right[10]:.1f} m/s, "
      f"axle {right[16]:.3g} m, wheel {right[23]:.1f} rad/s")
assert moved["KS", 0.0] > 9.9 and moved["ST", 0.0] > 9.9 and moved["MB", 0.0] < 1e-6 and moved["MB", np.pi / 2] < 1e-6
assert abs(state.velocity) < 1e-9 and abs(state.velocity_y - 10.0) < 1e-9 and state.position_z_front > 1e8
assert right[3] == 10.0 and right[16] < 0.1
print("behaviour as stated")
PY
