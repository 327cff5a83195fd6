#!/usr/bin/env bash
# irn-engine: a camera that is pitched down is taken to look up: a pothole 8 m ahead is put at 15 m, one 12 m ahead is beyond 30 m and dropped.
#
# Expected: the ground point of a pixel for a camera 1.5 m above the road with a downward pitch of -2.5 degrees (the default and the
# documentation's figure): a camera that looks down sees the road nearer for the same row of the picture than one that looks level.
# What happens: the rotation by -2.5 degrees lifts the rays. Pixels made by a pinhole camera that does look down by 2.5 degrees from points 5 to
# 20 m ahead come back at 7.2 m for 5 m, 15.2 m for 8 m and 24.3 m for 10 m; from 11 m on they are refused as out of range. The
# standard deviation along the road for the point at 8 m is 1.4 m. With the pitch written as +2.5 all are right. The package's own inverse
# turns the same way, so its round trip is exact.
# Why it matters: within the range that is kept distances are too long by 45 % to 143 %, and nothing is said.
#
# Output seen:
#   irn-engine 0.1.0
#   pitch -2.5 degrees, the default: 5 m ahead at 7.24 m, 6 m ahead at 9.43 m, 8 m ahead at 15.24 m, 10 m ahead at 24.31 m, 11 m ahead refused, 12 m ahead refused, 20 m ahead refused
#   pitch 2.5 degrees: 5 m ahead at 5.00 m, 6 m ahead at 6.00 m, 8 m ahead at 8.00 m, 10 m ahead at 10.00 m, 11 m ahead at 11.00 m, 12 m ahead at 12.00 m, 20 m ahead at 20.00 m
#   8 m ahead by default: standard deviation 1.37 m along the road
#   there and back by its own inverse, 10 m ahead: 10.00 m, in row 809 of 1080; the camera that looks down has it in row 686
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps PyYAML==6.0.4 certifi==2026.10.19.post1 geopandas==1.2.0 irn-engine==0.1.0 networkx==3.6.1 numpy==2.4.6 packaging==26.4 pandas==3.1.1 pyarrow==26.0.1 pyogrio==0.13.0 pyproj==3.7.2 python-dateutil==4.0.0 scipy==1.17.1 shapely==2.2.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
from math import atan2, radians, tan

from irn.m3_fusion.camera_model import CameraCalibration, GroundPlaneProjector

print('irn-engine', version('irn-engine'))
HEIGHT, FOCAL, ROW, COLUMN, DOWN = 1.5, 1380.0, 540.0, 960.0, radians(2.5)
DISTANCES = (5, 6, 8, 10, 11, 12, 20)


def row(distance):
    """Row of the picture of a point of the road straight ahead, for a pinhole camera that looks down by 2.5 degrees."""
    return ROW + FOCAL * tan(atan2(HEIGHT, distance) - DOWN)


def projector(pitch):
    return GroundPlaneProjector(CameraCalibration(fx=FOCAL, fy=FOCAL, cx=COLUMN, cy=ROW, height_m=HEIGHT, pitch_deg=pitch))


seen = {}
for pitch, words in ((-2.5, ', the default'), (2.5, '')):
    found = projector(pitch).project_ground_points([COLUMN] * len(DISTANCES), [row(distance) for distance in DISTANCES])
    seen[pitch] = [float(x) if valid else None for x, valid in zip(found.x_forward, found.valid_mask)]
    print(f'pitch {pitch:g} degrees{words}: ' + ', '.join(f'{distance} m ahead refused' if x is None else f'{distance} m ahead at {x:.2f} m'
                                                       for distance, x in zip(DISTANCES, seen[pitch])))
default = GroundPlaneProjector(CameraCalibration())
deviation = float(default.project_ground_points([COLUMN], [row(8)]).cov_xx[0]) ** 0.5
print(f'8 m ahead by default: standard deviation {deviation:.2f} m along the road')
columns, rows = default.ground_to_pixel(10.0, 0.0)
back = float(default.project_ground_points(columns, rows).x_forward[0])
print(f'there and back by its own inverse, 10 m ahead: {back:.2f} m, in row {rows[0]:.0f} of 1080; '
      f'the camera that looks down has it in row {row(10):.0f}')
ok = all(abs(x - distance) < 1e-6 for x, distance in zip(seen[2.5], DISTANCES))
ok = ok and seen[-2.5][4:] == [None] * 3 and 15.0 < seen[-2.5][2] < 15.5 and 24.0 < seen[-2.5][3] < 24.6 and abs(back - 10.0) < 1e-6
ok = ok and CameraCalibration().pitch_deg == -2.5
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
