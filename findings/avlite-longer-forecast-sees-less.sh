#!/usr/bin/env bash
# AVLite: an oncoming car that will swing out into the ego's lane is in the way, until the forecast goes on to its return.
#
# Expected: what is told of a car's way for longer can only add to the space that it needs: the docstring sweeps the forecast's polyline.
# What happens: an oncoming car in the next lane passes an obstacle on the ego's lane, out and back within 4 s. With 3 to 5 s of forecast,
# which end while it is out, the collision check finds a hit; with 6 s or 8 s none, and 1 m and more of clearance. Swept is the
# hull of the box now and the box at the last step, whatever lies between; its last heading is the present one.
# Why it matters: lattice and velocity planners check all they plan with this; a better predictor makes it blind.
#
# Output seen:
#   avlite 0.6.6
#   forecast of 1 s, nearest 3.5 m beside the line: hit False, clearance 1.19 m
#   forecast of 2 s, nearest 3.3 m beside the line: hit False, clearance 0.98 m
#   forecast of 3 s, nearest 1.8 m beside the line: hit True, clearance 0.00 m
#   forecast of 4 s, nearest 0.0 m beside the line: hit True, clearance 0.00 m
#   forecast of 5 s, nearest 0.0 m beside the line: hit True, clearance 0.00 m
#   forecast of 6 s, nearest 0.0 m beside the line: hit False, clearance 0.98 m
#   forecast of 8 s, nearest 0.0 m beside the line: hit False, clearance 1.20 m
#   forecast of 8 s without the swing: hit False, clearance 1.20 m
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps annotated-types==0.8.0 avlite==0.6.6 networkx==3.6.1 numpy==2.4.6 pydantic==2.14.4 pydantic_core==2.50.5 PyYAML==6.0.4 scipy==1.17.1 shapely==2.2.0 typing_extensions==4.16.0 typing-inspection==0.4.5
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import numpy as np
from avlite.c10_perception.c11_perception_model import AgentState, EgoState, PerceptionModel, SingleTrajectory
from avlite.c50_common.c54_trajectory_tracker import TrajectoryTracker
from avlite.c50_common.c55_collision_checking import check_collision_2d

print('avlite', version('avlite'))
DT = 0.2


def check(seconds, out=3.5):
    """Hit, clearance and nearest forecast place for an oncoming car of the next lane that swings out at 4 s, forecast for a while."""
    times = np.arange(1, round(seconds / DT) + 1) * DT
    way = np.column_stack([130.0 - 10.0 * times, 3.5 - out * np.exp(-(((times - 4.0) / 1.2) ** 2))])
    oncoming = AgentState(x=130.0, y=3.5, theta=np.pi, velocity=10.0, agent_id=1)
    scene = PerceptionModel(agent_vehicles=[oncoming], ego_vehicle=EgoState(x=0.0, velocity=15.0),
                            prediction=SingleTrajectory(trajectories={1: way}, predict_delta_t=DT))
    line = [(float(place), 0.0) for place in np.arange(0.0, 125.0, 2.5)]
    hit, _, _, clearance = check_collision_2d(scene, TrajectoryTracker(path=line, velocity=[15.0] * len(line)))
    return hit, clearance, way[:, 1].min()


seen = {}
for seconds in (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0):
    seen[seconds] = check(seconds)
    print('forecast of {:.0f} s, nearest {:.1f} m beside the line: hit {}, clearance {:.2f} m'.format(
        seconds, seen[seconds][2], seen[seconds][0], seen[seconds][1]))
straight = check(8.0, out=0.0)
print(f'forecast of 8 s without the swing: hit {straight[0]}, clearance {straight[1]:.2f} m')
ok = seen[4.0][0] and not seen[6.0][0] and not seen[8.0][0] and seen[6.0][1] > 0.9 and not straight[0]
ok = ok and abs(seen[8.0][1] - straight[1]) < 0.01
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
