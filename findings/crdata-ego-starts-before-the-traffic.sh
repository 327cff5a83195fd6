#!/usr/bin/env bash
# commonroad-dataset-converter: in every scenario but the first the ego starts up to minutes before the traffic is there.
#
# Expected: a recording is cut into scenarios of 150 steps, and a car of each is replaced by a planning problem that begins
# when and where this car did, among the others.
# What happens: the planning problem begins at step 0 (and its goal may be reached from step 0 on), the obstacles keep the
# frame numbers of the whole recording. In the second scenario of a highD recording the lorry that was 30 m ahead of the
# car appears at step 151, 6 s later, at the place where it was at the start. An ego that drives as the car did is by then
# 90 m past that place, and has met nobody. In the third it is 12 s. With --obstacles-start-at-zero both begin at step 0.
# Why it matters: nothing is wrong with the file and planners solve it: on an empty road. Later scenarios of a
# recording come out ever easier, in all data sets of the tool that are cut this way.
#
# Output seen:
#   commonroad-dataset-converter 2025.1.0
#   scenario 1: planning problem from step 0, lorry from step 1 on, at the start 30 m ahead of the ego
#   scenario 2: planning problem from step 0, lorry from step 151 on, at the start not there; 30 m ahead of the ego's start at step 151
#   scenario 3: planning problem from step 0, lorry from step 301 on, at the start not there; 30 m ahead of the ego's start at step 301
#   with --obstacles-start-at-zero: lorry from steps 0, 0, 0 on
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps commonroad-dataset-converter==2025.1.0 commonroad-io==2024.3 commonroad-route-planner==2025.1.0 commonroad-clcs==2025.2.0 annotated-types==0.8.0 certifi==2026.10.19.post1 click==8.1.0 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 markdown-it-py==4.3.0 matplotlib==3.10.3 mdurl==0.1.2 networkx==3.5 numpy==1.26.4 omegaconf==2.4.0 packaging==26.4 pandas==2.2.3 pillow==12.0.0 protobuf==3.20.2 pydantic==2.14.4 pydantic_core==2.50.5 Pygments==2.21.0 pyparsing==3.3.3 pyproj==3.7.2 python-dateutil==2.9.0.post0 pytz==2025.2 PyYAML==6.0.4 rich==15.0.0 rtree==1.4.1 ruamel.yaml==0.18.15 scipy==1.13.1 shapely==2.2.0 shellingham==1.5.4 six==1.17.0 tqdm==4.70.1 typer==0.12.5 typing_extensions==4.16.0 typing-inspection==0.4.5 tzdata==2026.6 antlr4-python3-runtime==4.9.3 qdldl==0.1.9.post1 osqp==0.6.7.post3
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { tail -3 errors >&2; exit 1; }
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
from commonroad.common.file_reader import CommonRoadFileReader

print('commonroad-dataset-converter', version('commonroad-dataset-converter'))
FRAMES, SPEED, DT, AHEAD = 450, 20.0, 0.04, 30.0
data = Path('data')
data.mkdir()
(data / '01_recordingMeta.csv').write_text(
    'id,frameRate,locationId,speedLimit,upperLaneMarkings,lowerLaneMarkings\n'
    '1,25,2,-1.00,8.51;12.59;16.43,21.00;24.96;28.80\n')
kinds = {1: ('Car', 4.5, 0.0), 2: ('Truck', 10.0, AHEAD)}
(data / '01_tracksMeta.csv').write_text('id,width,height,initialFrame,finalFrame,numFrames,class,drivingDirection,numLaneChanges\n' + ''.join(
    f'{number},{length},2.0,1,{FRAMES},{FRAMES},{kind},2,0\n' for number, (kind, length, _) in kinds.items()))
(data / '01_tracks.csv').write_text('frame,id,x,y,width,height,xVelocity,yVelocity,xAcceleration,yAcceleration\n' + ''.join(
    f'{frame},{number},{begin + SPEED * DT * frame - length / 2:.2f},22.00,{length},2.0,{SPEED:.2f},0.00,0.00,0.00\n'
    for number, (_, length, begin) in kinds.items() for frame in range(1, FRAMES + 1)))


def converted(*options):
    """For each scenario: the planning problem and the lorry."""
    subprocess.run([sys.executable, '-W', 'ignore', '-m', 'crdata.main', '--routability-check', 'nocheck', *options,
                    'data', 'made' + str(len(options)), 'highd'], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    made = []
    for file in Path('made' + str(len(options))).glob('*.xml'):
        scenario, problems = CommonRoadFileReader(str(file)).open()
        made.append((next(iter(problems.planning_problem_dict.values())), scenario.dynamic_obstacles[0]))
    return sorted(made, key=lambda both: both[0].initial_state.position[0])


ok = True
for number, (problem, lorry) in enumerate(converted(), 1):
    start, seen = problem.initial_state, lorry.initial_state
    there = lorry.state_at_time(0) or lorry.state_at_time(1)
    gap = seen.position[0] - start.position[0]
    print(f'scenario {number}: planning problem from step {start.time_step}, lorry from step {seen.time_step} on, at the start '
          + (f'{gap:.0f} m ahead of the ego' if there else
             f"not there; {gap:.0f} m ahead of the ego's start at step {seen.time_step}"))
    ok = ok and start.time_step == 0 and seen.time_step == 150 * (number - 1) + 1 and abs(gap - AHEAD) < 0.1
together = [lorry.initial_state.time_step for _, lorry in converted('--obstacles-start-at-zero')]
print('with --obstacles-start-at-zero: lorry from steps', ', '.join(map(str, together)), 'on')
ok = ok and together == [0, 0, 0]
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
