#!/usr/bin/env bash
# vehicle-dynamics-sim: the Stanley controller steers away from its path.
#
# Expected: a car 1 m to the left of a straight path, parallel to it, is steered to the right and comes to the path; the
# controller is made for that, and is stable for every positive gain.
# What happens: the lateral error is computed to the right and steered by to the left. The car of the example drives away
# from the path, 1.37 m after half a second, 13 m after 3.5 s and by then at more than 40 degrees to it; from the right of it
# likewise. Only a car that is exactly on its path keeps it, which on a straight one it does; with a negative
# gain it comes back to it.
# Why it matters: with starts on the path the error is that of the tracking alone, grows slowly and looks like a gain
# that is too small. The larger the gain, the faster it goes.
#
# Output seen:
#   vehicle-dynamics-sim 0.1.2
#   +1 m beside the path, gain +1: 1.00 1.37 2.08 3.16 4.74 6.92 9.74 13.11 m
#   -1 m beside the path, gain +1: -1.00 -1.37 -2.08 -3.16 -4.74 -6.92 -9.74 -13.11 m
#   +0 m beside the path, gain +1: 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 m
#   +1 m beside the path, gain +2: 1.00 1.80 3.65 6.65 10.52 14.90 19.52 24.29 m
#   +1 m beside the path, gain -1: 1.00 0.70 0.39 0.21 0.11 0.05 0.03 0.01 m
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps vehicle-dynamics-sim==0.1.2 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 kiwisolver==1.5.1 matplotlib==3.11.2 numpy==2.4.6 packaging==26.4 pandas==3.1.1 pillow==13.0.0 pyparsing==3.3.3 python-dateutil==4.0.0 scipy==1.17.1 six==1.17.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import numpy as np
from vdsim.controllers.pid_speed import SpeedPIDController
from vdsim.controllers.stanley import StanleyController
from vdsim.models.tires.linear import LinearTireParams
from vdsim.models.vehicle.dof2 import DOF2, VehicleConfig2DOF, VehiclePhysicalParams2DOF
from vdsim.simulation import ClosedLoopRunner
from vdsim.trajectories.library import StraightTrajectory

print('vehicle-dynamics-sim', version('vehicle-dynamics-sim'))
SPEED, STEP = 10.0, 0.002
tyre = LinearTireParams(Cx=80000.0, Cy=80000.0)
car = DOF2(VehicleConfig2DOF(VehiclePhysicalParams2DOF(g=9.81, m=1500.0, lf=1.4, lr=1.4, r=0.3, iz=2500.0), tyre, tyre, tyre, tyre))


def driven(beside, gain):
    """Distances from a straight path, to the left, every half second."""
    loop = ClosedLoopRunner(car, SpeedPIDController(), StanleyController(k=gain), StraightTrajectory(v_ref=SPEED))
    result = loop.run(np.array([0.0, SPEED, beside, 0.0, 0.0, 0.0]), np.arange(0.0, 3.6, STEP), method='euler')
    return np.asarray(result.vehicle.x)[::250, 2]


ok = True
for beside, gain in ((1.0, 1.0), (-1.0, 1.0), (0.0, 1.0), (1.0, 2.0), (1.0, -1.0)):
    y = driven(beside, gain)
    print(f'{beside:+.0f} m beside the path, gain {gain:+.0f}: ' + ' '.join(f'{d + 0.0:.2f}' for d in y) + ' m')
    ok = ok and (abs(y[-1]) > 5.0 if beside and gain > 0.0 else abs(y[-1]) < 0.3)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
