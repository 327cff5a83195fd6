#!/usr/bin/env bash
# commonroad-io with joblib: no cache ever hits on a scenario; equal scenarios, even a
# deep copy, have different joblib hashes, and hash() fails.
#
# Expected: joblib.Memory recomputes a function of a scenario only when the scenario
# changes. Scenario defines __eq__ and __hash__, so a dict or lru_cache works too.
# What happens: the network keeps a table keyed by id(polygon), i.e. by memory
# address, and it is part of what is pickled. So each process, each deep copy and
# each reading of the same file gives another joblib hash, and a Memory on disk
# grows by one entry per call. hash(scenario) and hash(planning_problem_set) raise
# TypeError from their own __hash__.
# Why it matters: sweeps over scenarios are cached this way; the cache is filled,
# never read, and nobody is told.
#
# Output seen:
#   commonroad-io 2024.3
#   joblib 1.6.0
#   deep copy / made again: equal (True, True) same joblib hash (False, False)
#   three processes, same scenario, one joblib.Memory: computed 3 times
#   hash(): ["unhashable type: 'list'", "unhashable type: 'dict_items'"]
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-io==2024.3 numpy==2.4.6 scipy==1.17.1 shapely==2.2.0 joblib==1.6.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
for name in ['commonroad-io', 'joblib']:
    print(name, version(name))
import copy, subprocess, sys
import numpy as np
import joblib
from commonroad.planning.planning_problem import PlanningProblemSet

code = """
import sys
import numpy as np
import joblib
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork, MapInformation
from commonroad.scenario.scenario import Scenario
from commonroad.common.util import Time

def make():
    x = np.linspace(0.0, 100.0, 11)
    left, right = np.c_[x, np.full(11, 3.5)], np.c_[x, np.zeros(11)]
    network = LaneletNetwork(MapInformation(date=Time(12, 0, 1, 1, 2026)))
    network.add_lanelet(Lanelet(left, (left + right) / 2, right, 1))
    scenario = Scenario(0.1)
    scenario.add_objects(network)
    return scenario

memory = joblib.Memory("cache", verbose=0)

@memory.cache
def length(scenario):
    print("computed")
    return float(scenario.lanelet_network.lanelets[0].distance[-1])
"""
exec(code)
scenario = make()
twin, other = copy.deepcopy(scenario), make()
equal = (scenario == twin, scenario == other)
same = (joblib.hash(scenario) == joblib.hash(twin), joblib.hash(scenario) == joblib.hash(other))
print("deep copy / made again: equal", equal, "same joblib hash", same)
open("job.py", "w").write(code + "\nlength(make())\n")
runs = "".join(subprocess.run([sys.executable, "-W", "ignore", "job.py"], capture_output=True, text=True, check=True).stdout
               for _ in range(3))
computed = runs.count("computed")
print("three processes, same scenario, one joblib.Memory: computed", computed, "times")
errors = []
for thing in (scenario, PlanningProblemSet()):
    try:
        hash(thing)
    except TypeError as error:
        errors.append(str(error))
print("hash():", errors)
assert equal == (True, True) and same == (False, False) and computed == 3 and len(errors) == 2
print("behaviour as stated")
PY
