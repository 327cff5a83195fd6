#!/usr/bin/env bash
# commonroad-io: rotating a scenario by 0.05 rad or less makes it larger.
#
# Expected: translate_rotate is a rigid motion; turning by +0.05 rad and back by
# -0.05 rad returns the same points.
# What happens: for |angle| <= 0.05 the matrix uses cos = 1 and sin = angle, so
# lengths grow by sqrt(1 + angle^2), here 0.125 percent, silently. 0.051 rad is
# exact. A state in map coordinates (UTM) comes back 13 km away; a lanelet that is
# turned by a full circle in steps of 0.05 rad has become 17 percent wider.
# Why it matters: maps, obstacles and planning problems are aligned with
# translate_rotate (small heading corrections are typical); a repaired trajectory
# that is turned back misses its road, and steps at angles below and above 0.05
# do not compose.
#
# Output seen:
#   commonroad-io 2024.3
#   there and back by 0.050 rad: 13361.8 m off
#   there and back by 0.051 rad: 0.000000 m off
#   lanelet of width 3.5 m after 126 turns by 0.05 rad: 4.096 m wide
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-io==2024.3 numpy==2.4.6 scipy==1.17.1 shapely==2.2.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
for name in ['commonroad-io']:
    print(name, version(name))
import numpy as np
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.state import InitialState

zero = np.zeros(2)

def there_and_back(angle):
    state = InitialState(time_step=0, position=np.array([690000.0, 5300000.0]),
                         orientation=0.0, velocity=10.0, yaw_rate=0.0, slip_angle=0.0)
    turned = state.translate_rotate(zero, angle).translate_rotate(zero, -angle)
    return float(np.linalg.norm(turned.position - state.position))

small, large = there_and_back(0.05), there_and_back(0.051)
print(f"there and back by 0.050 rad: {small:.1f} m off")
print(f"there and back by 0.051 rad: {large:.6f} m off")

x = np.linspace(0.0, 100.0, 11)
left, right = np.c_[x, np.full(11, 3.5)], np.c_[x, np.zeros(11)]
lanelet = Lanelet(left, (left + right) / 2, right, 1)
for _ in range(126):
    lanelet.translate_rotate(zero, 0.05)
width = float(np.linalg.norm(lanelet.left_vertices[0] - lanelet.right_vertices[0]))
print(f"lanelet of width 3.5 m after 126 turns by 0.05 rad: {width:.3f} m wide")
assert small > 13000.0 and large < 1e-3
assert width > 4.0
print("behaviour as stated")
PY
