#!/usr/bin/env bash
# commonroad-io: Trajectory.resample_continuous_time_state_list turns a westbound car
# through east, and returns more states than asked for.
#
# Expected: "the resulting number of states" is num_resampled_states, and a heading
# that goes from 3.1 to -3.1 rad (0.08 rad apart) is interpolated across pi.
# What happens: headings are interpolated as plain numbers, so half-way the car
# faces the opposite way (0.0 rad), although velocity and position go on west.
# N + 1 states come back, for some step sizes N + 2 (arange with a float end); the
# surplus state is a repeat of the last sample (held), so the vehicle stops dead
# there without its velocity showing it.
# Why it matters: bringing recordings (0.04 s) to the scenario's step puts a
# sideways or backwards rectangle into the collision check for one step.
#
# Output seen:
#   commonroad-io 2024.3
#   heading per 0.1 s: [3.1, 0.0, -3.1, -3.1] for 3.1, -3.1 per 0.2 s
#   N = 2: 4 states, the last x are [-1.0, -2.0, -2.0] at 10 m/s
#   N + 1 states for 52 of 60 lengths, e.g. N = [1, 3, 4, 5, 6]
#   N + 2 states for 8 of 60 lengths, e.g. N = [2, 11, 12, 14, 23]
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
from commonroad.scenario.state import KSState
from commonroad.scenario.trajectory import Trajectory

def recording(headings, dt):
    return [KSState(time_step=k, position=np.array([-10.0 * k * dt, 0.0]), orientation=h, velocity=10.0, steering_angle=0.0)
            for k, h in enumerate(headings)]

states = recording([3.1, -3.1, -3.1, -3.1], 0.2)
got = Trajectory.resample_continuous_time_state_list(states, np.arange(4) * 0.2, 0.1, 2)
print("heading per 0.1 s:", [round(float(s.orientation), 3) for s in got.state_list], "for 3.1, -3.1 per 0.2 s")
assert len(got.state_list) > 2 and abs(got.state_list[1].orientation) < 1e-9

counts = {}
for n in range(1, 61):
    end = np.array([0.0, n * 0.1])
    if not 0 + n * 0.1 <= end[-1]:
        continue
    two = recording([3.1, 3.1], n * 0.1)
    got = Trajectory.resample_continuous_time_state_list(two, end, 0.1, n)
    counts.setdefault(len(got.state_list) - n, []).append(n)
    if len(got.state_list) == n + 2 and "shown" not in globals():
        shown = [float(s.position[0]) for s in got.state_list[-3:]]
        print(f"N = {n}: {n + 2} states, the last x are", [round(x, 3) for x in shown], "at 10 m/s")
        assert abs(shown[-1] - shown[-2]) < 1e-9
for more, which in sorted(counts.items()):
    print(f"N + {more} states for {len(which)} of 60 lengths, e.g. N = {which[:5]}")
assert sorted(counts) == [1, 2]
print("behaviour as stated")
PY
