#!/usr/bin/env bash
# commonroad-io: TrafficSignInterpreter.speed_limit keeps its first answer for good.
#
# Expected: the interpreter reads the lanelet network it was given, as it is now.
# What happens: the method is memoised per interpreter and lanelet set, without
# any invalidation. A sign that is added, changed or removed afterwards makes no
# difference: "no limit" stays "no limit" under a new 30 km/h sign, and a removed
# sign goes on limiting. A second interpreter on the same network disagrees with
# the first. (required_speed is memoised the same way.)
# Why it matters: what-if studies edit a map and ask the same interpreter again;
# a planner that holds one keeps speeding.
#
# Output seen:
#   commonroad-io 2024.3
#   limits of lanelets 1 and 2 at first:          (None, 13.9)
#   sign added at 1, removed at 2, same reader:   (None, 13.9)
#   sign added at 1, removed at 2, new reader:    (8.3, None)
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
from commonroad.scenario.traffic_sign import (SupportedTrafficSignCountry, TrafficSign,
                                              TrafficSignElement, TrafficSignIDGermany)
from commonroad.scenario.traffic_sign_interpreter import TrafficSignInterpreter

def lanelet(number, start, end, low=0.0, **more):
    x = np.linspace(start, end, 11)
    left, right = np.c_[x, np.full(11, low + 3.5)], np.c_[x, np.full(11, low)]
    return Lanelet(left, (left + right) / 2, right, number, **more)

network = LaneletNetwork()
network.add_lanelet(lanelet(1, 0.0, 100.0))
network.add_lanelet(lanelet(2, 0.0, 100.0, 3.5))
germany = SupportedTrafficSignCountry.GERMANY

def sign(number, limit):
    return TrafficSign(number, [TrafficSignElement(TrafficSignIDGermany.MAX_SPEED, [limit])],
                       {1, 2}, np.array([0.0, 0.0]))

network.add_traffic_sign(sign(10, "13.9"), {2})
first = TrafficSignInterpreter(germany, network)
one, two = frozenset([1]), frozenset([2])
before = first.speed_limit(one), first.speed_limit(two)
network.add_traffic_sign(sign(11, "8.3"), {1})
network.remove_traffic_sign(10)
after = first.speed_limit(one), first.speed_limit(two)
fresh = TrafficSignInterpreter(germany, network)
truth = fresh.speed_limit(one), fresh.speed_limit(two)
print("limits of lanelets 1 and 2 at first:         ", before)
print("sign added at 1, removed at 2, same reader:  ", after)
print("sign added at 1, removed at 2, new reader:   ", truth)
assert before == after == (None, 13.9) and truth == (8.3, None)
print("behaviour as stated")
PY
