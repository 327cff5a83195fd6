#!/usr/bin/env bash
# tactics2d: cars of NGSIM point east whichever way they drive, and a time range of 10 s takes 1000 s.
#
# Expected: a car that moves north-west has that heading, its box lies along its path and its velocity points there, as
# with the parsers for other data sets; a time range in milliseconds, as documented, selects by time.
# What happens: NGSIM has no heading, and none is made of the places: it is 0 for all cars at all times. On a road to the
# north-west the boxes stand at 45 degrees to the road, 4.5 m wide in a lane of 3.7 m, and the velocity (made from
# speed and heading) points to the east. The time range is compared with frame numbers, a tenth of a second each: of
# 20 s of data the range 0 to 5 s gives all 20 s, and 10 to 15 s nothing.
# Why it matters: all collision checks, lanes matched by heading and learned policies see cars that drive
# sideways through their neighbours. I-80 and US-101 run neither east nor west.
#
# Output seen:
#   tactics2d 0.1.9
#   the car moves to 135 degrees; its heading is 0 degrees, its velocity points to 0 degrees
#   it is 1.8 m wide; its box takes 4.5 m across the road
#   0 to 5 s of 20 s: 20 s
#   10 to 15 s of 20 s: 0 s
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps certifi==2026.10.19.post1 contourpy==1.3.3 cramjam==2.14.0 crc32c==2.9.post0 cycler==0.12.1 defusedxml==0.7.1 fastparquet==2026.5.0 fonttools==4.68.0 fsspec==2026.9.0 geopandas==1.1.4 joblib==1.5.3 kiwisolver==1.5.1 matplotlib==3.10.3 numpy==2.2.6 orjson==3.13.0 packaging==26.4 pandas==2.3.3 pillow==12.0.0 polars==1.44.1 polars-runtime-32==1.44.1 protobuf==5.29.5 pyarrow==26.0.1 pyclothoids==0.2.0 pyogrio==0.13.0 pyparsing==3.3.3 pyproj==3.7.1 python-dateutil==3.0.0 pytz==2026.6 scikit-learn==1.6.1 scipy==1.15.3 shapely==2.0.7 six==1.17.0 tabulate==0.9.0 tactics2d==0.1.9 tfrecord==1.14.6 threadpoolctl==3.6.0 tzdata==2026.6 
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { tail -3 errors >&2; exit 1; }
from importlib.metadata import version

import numpy as np
from tactics2d.dataset_parser import NGSIMParser

print('tactics2d', version('tactics2d'))
FEET, SPEED, LENGTH, WIDTH = 0.3048, 15.0, 15.0, 6.0
along = np.array([-1.0, 1.0]) / np.sqrt(2.0)
columns = ('Vehicle_ID,Frame_ID,Total_Frames,Global_Time,Local_X,Local_Y,Global_X,Global_Y,v_Length,v_Width,v_Class,v_Vel,v_Acc,'
           'Lane_ID,Preceding,Following,Space_Headway,Time_Headway')
with open('trajectories.csv', 'w') as file:
    print(columns, file=file)
    for frame in range(1, 201):
        s = SPEED * 0.1 * frame
        x, y = [6042842.0, 2133117.0] + s * along / FEET
        print(f'1,{frame},200,{1113433136100 + 100 * frame},16.5,{s / FEET:.3f},{x:.3f},{y:.3f},{LENGTH},{WIDTH},2,{SPEED / FEET:.2f},0.0,2,0,0,0,0', file=file)


def parsed(**options):
    cars, span = NGSIMParser().parse_trajectory('trajectories.csv', '.', **options)
    return (cars[1] if cars else None), span


car, _ = parsed()
frames = sorted(car.trajectory.history_states)
state, later = car.trajectory.get_state(frames[50]), car.trajectory.get_state(frames[60])
motion = np.degrees(np.arctan2(later.y - state.y, later.x - state.x))
across = np.array(car.get_pose(frames[50]).coords) @ np.array([along[1], -along[0]])
velocity = np.degrees(np.arctan2(state.velocity[1], state.velocity[0]))
print(f'the car moves to {motion:.0f} degrees; its heading is {np.degrees(state.heading):.0f} degrees, its velocity points to {velocity:.0f} degrees')
print(f'it is {WIDTH * FEET:.1f} m wide; its box takes {np.ptp(across):.1f} m across the road')
ok = abs(motion - 135.0) < 0.1 and state.heading == 0.0 and velocity == 0.0 and np.ptp(across) > 4.0
for first, last, expected in ((0, 5000, 200), (10000, 15000, 0)):
    car, _ = parsed(time_range=(first, last))
    count = len(car.trajectory.history_states) if car else 0
    print(f'{first / 1000:.0f} to {last / 1000:.0f} s of 20 s: {count / 10:.0f} s')
    ok = ok and count == expected
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
