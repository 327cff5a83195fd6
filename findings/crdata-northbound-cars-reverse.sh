#!/usr/bin/env bash
# commonroad-dataset-converter: from INTERACTION recordings cars that drive north come out in reverse, and all are 2.5 times too fast.
#
# Expected: a car whose track says vx, vy and psi has the speed vx cos(psi) + vy sin(psi) in the scenario, whichever way it
# drives, and covers that distance in each second of it: the recordings have a row every 100 ms.
# What happens: the sign of vy is turned round, as is right for data whose y axis points down (highD), but not here. What
# comes out is v cos(2 psi): 10 m/s eastwards and westwards, 0 on the diagonal, -10 m/s northwards and southwards. The
# scenario's time step is 0.04 s instead of 0.1 s, whatever the timestamps say, so that the places move at 25 m/s.
# Why it matters: speed and motion of the same obstacle contradict each other in all that comes from this data set:
# times to collision, predictions and initial states of planning problems are made from the one or the other.
#
# Output seen:
#   commonroad-dataset-converter 2025.1.0
#   time step 0.04 s
#   heading   0: velocity  10.0 m/s, the place moves at 25.0 m/s
#   heading  45: velocity   0.0 m/s, the place moves at 25.0 m/s
#   heading  90: velocity -10.0 m/s, the place moves at 25.0 m/s
#   heading 135: velocity   0.0 m/s, the place moves at 25.0 m/s
#   heading 180: velocity  10.0 m/s, the place moves at 25.0 m/s
#   heading 270: velocity -10.0 m/s, the place moves at 25.0 m/s
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps commonroad-dataset-converter==2025.1.0 commonroad-io==2024.3 commonroad-route-planner==2025.1.0 commonroad-clcs==2025.2.0 annotated-types==0.8.0 certifi==2026.10.19.post1 click==8.1.0 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 markdown-it-py==4.3.0 matplotlib==3.10.3 mdurl==0.1.2 networkx==3.5 numpy==1.26.4 omegaconf==2.4.0 packaging==26.4 pandas==2.2.3 pillow==12.0.0 protobuf==3.20.2 pydantic==2.14.4 pydantic_core==2.50.5 Pygments==2.21.0 pyparsing==3.3.3 pyproj==3.7.2 python-dateutil==2.9.0.post0 pytz==2025.2 PyYAML==6.0.4 rich==15.0.0 rtree==1.4.1 ruamel.yaml==0.18.15 scipy==1.13.1 shapely==2.2.0 shellingham==1.5.4 six==1.17.0 tqdm==4.70.1 typer==0.12.5 typing_extensions==4.16.0 typing-inspection==0.4.5 tzdata==2026.6 antlr4-python3-runtime==4.9.3 qdldl==0.1.9.post1 osqp==0.6.7.post3
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { tail -3 errors >&2; exit 1; }
import contextlib
import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np

print('commonroad-dataset-converter', version('commonroad-dataset-converter'))
SPEED, HEADINGS = 10.0, (0, 45, 90, 135, 180, 270)
tracks = Path('data/INTERACTION-Dataset-DR-v1_0/recorded_trackfiles/DR_DEU_Roundabout_OF')
tracks.mkdir(parents=True)
rows = ['track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy,psi_rad,length,width']
for number, degrees in enumerate(HEADINGS, 1):
    along = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    for frame in range(1, 41):
        x, y = [1000.0, 1000.0] + SPEED * 0.1 * frame * along
        vx, vy = SPEED * along
        rows.append(f'{number},{frame},{100 * frame},car,{x:.3f},{y:.3f},{vx:.3f},{vy:.3f},{np.radians(degrees):.3f},4.5,1.8')
(tracks / 'vehicle_tracks_000.csv').write_text('\n'.join(rows) + '\n')
subprocess.run([sys.executable, '-W', 'ignore', '-m', 'crdata.main', '--keep-ego', '--routability-check', 'nocheck',
                'data', 'made', 'interaction'], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

from commonroad.common.file_reader import CommonRoadFileReader

with open(os.devnull, 'w') as nowhere, contextlib.redirect_stdout(nowhere):
    scenario, _ = CommonRoadFileReader(str(next(Path('made').glob('*.xml')))).open()
print(f'time step {scenario.dt} s')
ok = scenario.dt == 0.04
for degrees, obstacle in zip(HEADINGS, sorted(scenario.dynamic_obstacles, key=lambda o: o.obstacle_id)):
    states = obstacle.prediction.trajectory.state_list
    velocity = states[0].velocity
    moved = np.linalg.norm(states[-1].position - states[0].position) / (scenario.dt * (len(states) - 1))
    print(f'heading {degrees:3d}: velocity {round(velocity, 1) + 0.0:5.1f} m/s, the place moves at {moved:.1f} m/s')
    ok = ok and abs(velocity - SPEED * np.cos(2.0 * np.radians(degrees))) < 0.05 and abs(moved - 25.0) < 0.05
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
