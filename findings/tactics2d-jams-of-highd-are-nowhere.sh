#!/usr/bin/env bash
# tactics2d: a car of highD that stands in a jam is nowhere, and one that changes to the left moves to the right by its velocity.
#
# Expected: the centre of a vehicle is half of its length and width from the corner that highD gives, also when it stands.
# The y axis of highD points down; places, headings and velocities are turned round together.
# What happens: the way from the corner to the centre is turned by the direction of the velocity, vy / vx, and 0 / 0 is not
# a number: in every frame with both at 0 the place is NaN, without a word. Places and headings are turned round, velocities
# and accelerations are not: a car that goes to the left lane has a heading and places that go left and a velocity that
# goes right, and its place a second later by its velocity is 2 m beside where it is.
# Why it matters: jams are where highD is used for braking and stop-and-go; distances to a NaN are no distances,
# and comparisons with them false: no collision is found with the end of the jam.
#
# Output seen:
#   tactics2d 0.1.9
#   braking to a stop: 76 of 150 frames at rest, 76 of them without a place, 0 others
#   changing to the left lane: heading +2.9 degrees, moves +1.00 m in a second, velocity (20, -1) m/s
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps certifi==2026.10.19.post1 contourpy==1.3.3 cramjam==2.14.0 crc32c==2.9.post0 cycler==0.12.1 defusedxml==0.7.1 fastparquet==2026.5.0 fonttools==4.68.0 fsspec==2026.9.0 geopandas==1.1.4 joblib==1.5.3 kiwisolver==1.5.1 matplotlib==3.10.3 numpy==2.2.6 orjson==3.13.0 packaging==26.4 pandas==2.3.3 pillow==12.0.0 polars==1.44.1 polars-runtime-32==1.44.1 protobuf==5.29.5 pyarrow==26.0.1 pyclothoids==0.2.0 pyogrio==0.13.0 pyparsing==3.3.3 pyproj==3.7.1 python-dateutil==3.0.0 pytz==2026.6 scikit-learn==1.6.1 scipy==1.15.3 shapely==2.0.7 six==1.17.0 tabulate==0.9.0 tactics2d==0.1.9 tfrecord==1.14.6 threadpoolctl==3.6.0 tzdata==2026.6 
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { tail -3 errors >&2; exit 1; }
from importlib.metadata import version
from pathlib import Path

import numpy as np
from tactics2d.dataset_parser import LevelXParser

print('tactics2d', version('tactics2d'))
FRAMES, DT, CORNER = 150, 0.04, (100.0, 26.0)
Path('01_recordingMeta.csv').write_text('id,frameRate,locationId,upperLaneMarkings,lowerLaneMarkings\n1,25,2,8.51;12.59;16.43,21.00;24.96;28.80\n')
Path('01_tracksMeta.csv').write_text('id,width,height,initialFrame,finalFrame,numFrames,class,drivingDirection\n' + ''.join(
    f'{number},4.5,1.8,1,{FRAMES},{FRAMES},Car,2\n' for number in (1, 2)))
rows, true = [], {1: [], 2: []}
for number in (1, 2):
    x, y = CORNER
    for frame in range(1, FRAMES + 1):
        vx, vy = (max(0.0, 12.0 - 4.0 * DT * frame), 0.0) if number == 1 else (20.0, -1.0)
        x, y = x + vx * DT, y + vy * DT
        rows.append(f'{frame},{number},{x:.2f},{y:.2f},4.5,1.8,{vx:.2f},{vy:.2f},0.00,0.00')
        true[number].append(vx)
Path('01_tracks.csv').write_text('frame,id,x,y,width,height,xVelocity,yVelocity,xAcceleration,yAcceleration\n' + '\n'.join(rows) + '\n')
cars, _ = LevelXParser('highD').parse_trajectory('01', '.')
states = {number: [cars[number].trajectory.get_state(frame) for frame in sorted(cars[number].trajectory.history_states)] for number in (1, 2)}
nowhere = np.array([bool(np.isnan(state.x)) for state in states[1]])
stands = np.array([round(vx, 2) == 0.0 for vx in true[1]])
print(f'braking to a stop: {stands.sum()} of {FRAMES} frames at rest, {nowhere.sum()} of them without a place, {int((nowhere & ~stands).sum())} others')
now, later = states[2][50], states[2][75]
print(f'changing to the left lane: heading {np.degrees(now.heading):+.1f} degrees, moves {later.y - now.y:+.2f} m in a second, velocity ({now.vx:.0f}, {now.vy:+.0f}) m/s')
ok = bool(np.all(nowhere == stands)) and stands.sum() > 50 and now.heading > 0.0 and later.y - now.y > 0.9 and now.vy == -1.0
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
