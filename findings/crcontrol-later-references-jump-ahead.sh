#!/usr/bin/env bash
# commonroad-control: of a reference trajectory that begins at 3 s most points are handed to the controller 30 m too far on.
#
# Expected: the same plan, whether it begins at 0 s or, after replanning, at 3 s, gives a model predictive controller the
# same reference: at 10 m/s 0, 1, 2, ... m from where it begins.
# What happens: between two points of the trajectory the weight of the one is computed from the time since 0 s, that of a
# point's number from the time since the trajectory's start. Weights are then about 31 and -30 instead of numbers from
# 0 to 1, and what is meant to lie between two points lies t_0 times the speed ahead. It also happens with the controller's
# step equal to the plan's, where nothing is to be interpolated: rounded times rarely hit the points of the plan, and
# what hits them is right, so that the reference jumps 30 m forward and back.
# Why it matters: controllers with a horizon and look-ahead take their reference from here; with the first plan
# all is right, with each plan later in the drive it is further off (60 m at 6 s), in headings and speeds too.
#
# Output seen:
#   commonroad-control 0.0.1
#   plan from 0 s, controller's step 0.10 s: errors of the reference [0 0 0 0 0 0 0 0 0 0 0] m
#   plan from 0 s, controller's step 0.05 s: errors of the reference [0 0 0 0 0 0 0 0 0 0 0] m
#   plan from 3 s, controller's step 0.10 s: errors of the reference [0 30 30 30 30 0 30 30 30 30 0] m
#   plan from 3 s, controller's step 0.05 s: errors of the reference [0 30 30 30 30 30 30 30 30 30 0] m
#   plan from 6 s, controller's step 0.10 s: errors of the reference [0 60 60 60 60 0 60 60 60 60 0] m
#   plan from 6 s, controller's step 0.05 s: errors of the reference [0 60 60 60 60 60 60 60 60 60 0] m
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps commonroad-control==0.0.1 commonroad-io==2024.3 casadi==3.8.2 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 antlr4-python3-runtime==4.9.3 PyYAML==6.0.4 packaging==26.4 pillow==13.0.0 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==4.0.0 rtree==1.4.1 scipy==1.17.1 shapely==2.2.0 six==1.17.0 tqdm==4.70.1
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { tail -3 errors >&2; exit 1; }
from importlib.metadata import version

import numpy as np
from commonroad_control.control.reference_trajectory_factory import ReferenceTrajectoryFactory
from commonroad_control.vehicle_dynamics.kinematic_bicycle.kb_sidt_factory import KBSIDTFactory
from commonroad_control.vehicle_dynamics.utils import TrajectoryMode

print('commonroad-control', version('commonroad-control'))
SPEED, STEP, HORIZON = 10.0, 0.1, 10
made = KBSIDTFactory()
states = {k: made.state_from_args(position_x=SPEED * STEP * k, position_y=0.0, velocity=SPEED, heading=0.0, steering_angle=0.0)
          for k in range(61)}
inputs = {k: made.input_from_args(acceleration=0.0, steering_angle_velocity=0.0) for k in range(61)}


def handed_over(start, step):
    """Places of the reference for a controller with some step, at the time at which the plan begins."""
    reference = ReferenceTrajectoryFactory(delta_t_controller=step, sidt_factory=made, mpc_horizon=HORIZON)
    reference.set_reference_trajectory(
        state_ref=made.trajectory_from_points(dict(states), TrajectoryMode.State, t_0=start, delta_t=STEP),
        input_ref=made.trajectory_from_points(dict(inputs), TrajectoryMode.Input, t_0=start, delta_t=STEP), t_0=start)
    points = reference.get_reference_trajectory_at_time(start)[0].points
    return np.array([points[k].position_x for k in range(HORIZON + 1)])


ok = True
for start in (0.0, 3.0, 6.0):
    for step in (0.1, 0.05):
        error = handed_over(start, step) - SPEED * step * np.arange(HORIZON + 1)
        print(f"plan from {start:.0f} s, controller's step {step:.2f} s: errors of the reference "
              f"[{' '.join(f'{abs(e):.0f}' for e in error)}] m")
        ahead = np.abs(error - SPEED * start) < 1e-6
        ok = ok and bool(np.all(ahead | (np.abs(error) < 1e-6))) and ahead.sum() >= 6
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
