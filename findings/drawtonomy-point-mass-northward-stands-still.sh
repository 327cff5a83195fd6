#!/usr/bin/env bash
# drawtonomy-commonroad: the planning trace of a point mass that drives north says that it stands.
#
# Expected: `v` of a state in a planning trace is what its schema says, the speed along the heading: 10 m/s
# for a vehicle at 10 m/s, whichever way it drives.
# What happens: TraceWriter takes the attribute `velocity` of commonroad-io's states. For a point mass
# (PMState) that is the component along x alone, the other one being `velocity_y`: 7.07 m/s on the
# diagonal, 0 northwards, -10 westwards. The heading, which a PMState works out of both, is right.
# The same drive as KS states has 10 m/s everywhere.
# Why it matters: traces of planners that solve with the PM model, of which CommonRoad has many, are
# shown with speeds that depend on the map's axes; the writer's own check compares positions only.
#
# Output seen:
#   drawtonomy-commonroad 0.3.0, commonroad-io 2024.3
#   heading   0: v 10.00 m/s as PM, 10.00 m/s as KS
#   heading  45: v 7.07 m/s as PM, 10.00 m/s as KS
#   heading  90: v 0.00 m/s as PM, 10.00 m/s as KS
#   heading 180: v -10.00 m/s as PM, 10.00 m/s as KS
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check --no-deps drawtonomy-commonroad==0.3.0 commonroad-io==2024.3 commonroad-vehicle-models==3.0.2 antlr4-python3-runtime==4.9.3 contourpy==1.3.3 cycler==0.12.1 fonttools==4.65.0 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 packaging==26.3 pillow==12.3.0 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==3.0.0 PyYAML==6.0.3 rtree==1.4.1 scipy==1.17.1 shapely==2.2.0 six==1.17.0 tqdm==4.70.1
"$dir/venv/bin/python" -W ignore - <<'PY'
import json
import math
from importlib.metadata import version

import numpy as np
from commonroad.scenario.state import KSState, PMState
from drawtonomy_cr.trace import SCHEMA_PATH, TraceWriter

print(f"drawtonomy-commonroad {version('drawtonomy-commonroad')}, commonroad-io {version('commonroad-io')}")
assert 'Speed along the heading' in json.dumps(json.load(open(SCHEMA_PATH)))
found = {}
for degrees in (0, 45, 90, 180):
    heading = math.radians(degrees)
    way = np.array([math.cos(heading), math.sin(heading)])
    vx, vy = (10.0 * way).tolist()
    drives = (
        [PMState(time_step=k, position=k * way, velocity=vx, velocity_y=vy) for k in range(5)],
        [KSState(time_step=k, position=k * way, velocity=10.0, orientation=heading, steering_angle=0.0) for k in range(5)],
    )
    pm, ks = (TraceWriter(dt=0.1).driven(drive)[1] for drive in drives)
    assert abs(pm['h'] - ks['h']) < 1e-5
    found[degrees] = pm['v'], ks['v']
    print(f'heading {degrees:3d}: v {pm["v"] + 0.0:.2f} m/s as PM, {ks["v"]:.2f} m/s as KS')
ok = all(ks == 10.0 for _, ks in found.values()) and found[0][0] == 10.0 and abs(found[45][0] - 7.0711) < 1e-3
ok = ok and found[90][0] == 0.0 and found[180][0] == -10.0
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
