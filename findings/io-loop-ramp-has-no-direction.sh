#!/usr/bin/env bash
# commonroad-io: orientation_by_position fails on the centre line of a lanelet that
# turns by more than half a circle (AssertionError without a word).
#
# Expected: "lanelet orientation closest to a given position", for any position on
# the lanelet.
# What happens: an assertion asks that the point lie ahead of the first and behind
# the last segment, as seen along those two straight lines. On a loop ramp (three
# quarters of a circle in one lanelet) this is false
# for most points of the lanelet's own centre line, its first point included.
# find_most_likely_lanelet_by_state needs it
# where two lanelets overlap and dies with the same bare AssertionError; for a
# state beside the road it raises IndexError where its docstring promises an
# empty list.
# Why it matters: motorway interchanges and roundabouts are where reference
# lanes are looked up by heading.
#
# Output seen:
#   commonroad-io 2024.3
#   ramp of  60 degrees: direction known at 120 of 121 points of its centre line
#   ramp of  90 degrees: direction known at 120 of 121 points of its centre line
#   ramp of 180 degrees: direction known at 120 of 121 points of its centre line
#   ramp of 270 degrees: direction known at  43 of 121 points of its centre line
#   most likely lanelet at the entry: AssertionError - beside the road: IndexError
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
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.state import KSState

def ramp(total, number=1, radius=40.0, n=121):
    angle = np.linspace(0.0, total, n)
    centre = radius * np.c_[np.sin(angle), 1.0 - np.cos(angle)]
    normal = np.c_[-np.sin(angle), np.cos(angle)]
    return Lanelet(centre + 1.75 * normal, centre, centre - 1.75 * normal, number), angle

share = {}
for degrees in (60, 90, 180, 270):
    lanelet, angle = ramp(np.radians(degrees))
    good = 0
    for point in lanelet.center_vertices:
        try:
            lanelet.orientation_by_position(point)
            good += 1
        except AssertionError:
            pass
    share[degrees] = good / len(angle)
    print(f"ramp of {degrees:3d} degrees: direction known at {good:3d} of {len(angle)} points of its centre line")
network = LaneletNetwork()
network.add_lanelet(ramp(np.radians(270), 1)[0])
network.add_lanelet(ramp(np.radians(80), 2)[0])

def ask(position):
    state = KSState(time_step=0, position=np.array(position), orientation=0.0, velocity=5.0, steering_angle=0.0)
    try:
        return network.find_most_likely_lanelet_by_state([state])
    except (AssertionError, IndexError) as error:
        return type(error).__name__

answers = ask([10.0, 1.3]), ask([500.0, 500.0])
print("most likely lanelet at the entry:", answers[0], "- beside the road:", answers[1])
assert share[60] > 0.99 and share[180] > 0.99 and share[270] < 0.5
assert answers == ("AssertionError", "IndexError")
print("behaviour as stated")
PY
