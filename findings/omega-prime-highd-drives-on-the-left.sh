#!/usr/bin/env bash
# omega-prime: a highD motorway becomes one with left-hand traffic on which cars drive inside the lorries ahead of them.
#
# Expected: highD gives the upper left corner of each vehicle's box, in a picture whose y axis points down. Converted to
# OSI (centres, y to the left of x), a car 6 m behind a lorry is 6 m behind it, and overtakes it on its left.
# What happens: only length, width and direction are translated. The corner is taken for the centre, which moves each
# vehicle by half of its own length: eastbound, the car that follows a lorry at 6 m is 0.75 m inside of it, westbound it
# has 12.75 m. The y axis is left as it is, and the motorway is its mirror image: the eastbound lanes lie north of
# the westbound ones, and cars overtake on the right.
# Why it matters: gaps, headways, times to collision and rules (no overtaking on the right, keep right) are computed
# from such recordings. Each is wrong by the difference in length, with a sign that hangs on the direction.
#
# Output seen:
#   omega-prime 0.3.7
#   eastbound, 6 m behind a lorry: -0.75 m (the bodies overlap)
#   westbound, 6 m behind a lorry: 12.75 m
#   the car in the left lane passes the lorry on its right
#   the eastbound lanes lie north of the westbound ones, as with left-hand traffic
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps Jinja2==3.1.6 MarkupSafe==3.0.4 StrEnum==0.5.0 altair==6.3.0 annotated-doc==0.0.7 annotated-types==0.8.0 attrs==26.1.0 betterosi==0.9.0 certifi==2026.10.19.post1 cloudpickle==3.1.3 cycler==0.12.1 filelock==4.3.1 fonttools==4.68.0 joblib==1.6.0 jsonschema-specifications==2025.9.1 jsonschema==4.26.0 kiwisolver==1.5.1 loguru==0.7.3 lxd_io==0.4.10 lxml==6.1.3 lz4==4.4.5 matplotlib==3.11.2 mcap==1.6.0 mypy_extensions==1.2.0 narwhals==2.29.0 networkx==3.6.1 numpy==2.4.6 omega-prime==0.3.7 packaging==26.4 pandas==3.1.1 pandera==0.35.0 pillow==13.0.0 polars-runtime-32==1.44.2 polars-st==0.11.0 polars==1.44.2 protobuf-py-ext==0.6.0 protobuf-py==0.6.0 pyarrow==26.0.1 pydantic==2.14.4 pydantic_core==2.50.5 pyogrio==0.13.0 pyparsing==3.3.3 pyproj==3.7.2 python-dateutil==4.0.0 pyxodr-omega-prime==0.1.5 referencing==0.37.0 rich==15.0.0 rpds-py==2026.9.1 scipy==1.17.1 shapely==2.2.0 shellingham==1.5.4 tqdm==4.70.1 typeguard==4.6.1 typer==0.29.2 typing-inspect==0.9.0 typing-inspection==0.4.5 typing_extensions==4.16.0 zstandard==0.25.0 contourpy==1.3.3 markdown-it-py==4.3.0 mdurl==0.1.2 Pygments==2.21.0 shellingham==1.5.4 tzdata==2026.6
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { tail -3 errors >&2; exit 1; }
from importlib.metadata import version
from pathlib import Path

from loguru import logger
from omega_prime.converters.lxd import LxdConverter
from PIL import Image

logger.remove()
print('omega-prime', version('omega-prime'))
data = Path('highD-dataset-v1.0/data')
data.mkdir(parents=True)
(data.parent / 'maps').mkdir()
Image.new('RGB', (20, 10)).save(data / '01_highway.png')
(data / '01_recordingMeta.csv').write_text('id,frameRate,locationId,speedLimit,duration,upperLaneMarkings,lowerLaneMarkings\n'
                                           '1,25,2,-1.00,1.00,8.51;12.59;16.43,21.00;24.96;28.80\n')
GAP, CAR, LORRY, SPEED = 6.0, (4.5, 1.8), (18.0, 2.5), 20.0
behind = CAR[0] / 2 + GAP + LORRY[0] / 2
EAST, WEST = 2, 1
vehicles = {1: ('Car', CAR, EAST, 100.0, 26.9), 2: ('Truck', LORRY, EAST, 100.0 + behind, 26.9), 3: ('Car', CAR, EAST, 100.0 + behind, 22.9),
            4: ('Car', CAR, WEST, 300.0, 10.5), 5: ('Truck', LORRY, WEST, 300.0 - behind, 10.5)}
meta, rows = ['id,width,height,initialFrame,finalFrame,numFrames,class,drivingDirection,numLaneChanges'], []
for number, (kind, (length, width), way, x, y) in vehicles.items():
    meta.append(f'{number},{length},{width},1,25,25,{kind},{way},0')
    speed = SPEED if way == EAST else -SPEED
    rows += [f'{frame},{number},{x + speed * 0.04 * frame - length / 2:.2f},{y - width / 2:.2f},{length},{width},{speed:.2f},0.00,0.00,0.00'
             for frame in range(1, 26)]
(data / '01_tracksMeta.csv').write_text('\n'.join(meta) + '\n')
(data / '01_tracks.csv').write_text('frame,id,x,y,width,height,xVelocity,yVelocity,xAcceleration,yAcceleration\n' + '\n'.join(rows) + '\n')

converter = LxdConverter('highD-dataset-v1.0', 'out')
table = converter.to_omega_prime_recording(converter.get_source_recordings()[0]).df
first = {row['idx']: row for row in table.filter(table['frame'] == table['frame'].min()).iter_rows(named=True)}


def gap(follower, leader):
    """Between the bodies, along the road; negative if one is inside of the other."""
    return abs(first[leader]['x'] - first[follower]['x']) - (first[leader]['length'] + first[follower]['length']) / 2


east, west = gap(1, 2), gap(4, 5)
touching = first[1]['polygon'].intersects(first[2]['polygon'])
print(f'eastbound, {GAP:.0f} m behind a lorry: {east:.2f} m' + (' (the bodies overlap)' if touching else ''))
print(f'westbound, {GAP:.0f} m behind a lorry: {west:.2f} m')
right = first[3]['y'] < first[2]['y']
print('the car in the left lane passes the lorry on its', 'right' if right else 'left')
north = first[1]['y'] > first[4]['y']
print('the eastbound lanes lie', 'north' if north else 'south', 'of the westbound ones, as with',
      'left-hand' if north else 'right-hand', 'traffic')
ok = abs(east + 0.75) < 0.01 and abs(west - 12.75) < 0.01 and touching and right and north
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
