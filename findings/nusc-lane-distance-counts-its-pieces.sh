#!/usr/bin/env bash
# nuscenes-devkit: the distance along a lane grows with the number of its pieces: in 20 of them 42 m are 59.5 m.
#
# Expected: project_pose_to_lane returns the closest pose of a lane and its distance from the lane's start, to within the
# resolution that is asked for; with it get_curvature_at_distance_along_lane finds the curvature there.
# What happens: each piece (a path of arc, line or arc) is sampled by itself, more closely than asked for and with both ends,
# and the number of the closest sample is multiplied by the resolution as asked for. A lane of 42 m in one piece is
# right. In 20 pieces of 2.1 m a car at 20 m is at 28.5 m with the default resolution and at 56 m with 2 m, and the end
# is at 59.5 m. Where the bend begins at 30 m, a car at 25 m is in the bend; at its end the look-up raises ValueError.
# Why it matters: gaps and speeds along a lane come out up to some times too large, most where the map is cut into short
# paths, and the right way to a better answer, a coarser lane, makes it worse.
#
# Output seen:
#   nuscenes-devkit 1.2.0
#   1 pieces, 42 m: 20 m are 20.0 m (20 m by 2 m, 20.00 m by 0.01 m), 10 m from there 10.0 m, the end is at 42.0 m
#   10 pieces, 42 m: 20 m are 23.5 m (36 m by 2 m, 20.04 m by 0.01 m), 10 m from there 12.0 m, the end is at 49.5 m
#   20 pieces, 42 m: 20 m are 28.5 m (56 m by 2 m, 20.09 m by 0.01 m), 10 m from there 14.0 m, the end is at 59.5 m
#   40 pieces, 42 m: 20 m are 37.5 m (74 m by 2 m, 20.19 m by 0.01 m), 10 m from there 19.5 m, the end is at 79.5 m
#   at 25 m of a lane that is straight up to 30 m: curvature 0 by its distance, 0.04 by the one that is found
#   curvature where the lane ends: ValueError: min() arg is an empty sequence
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps nuscenes-devkit==1.2.0 cachetools==8.0.2 cloudpickle==3.1.3 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 joblib==1.6.0 kiwisolver==1.5.1 matplotlib==3.11.2 narwhals==2.29.0 numpy==1.26.4 opencv-python-headless==4.11.0.86 packaging==26.4 pillow==13.0.0 pyparsing==3.3.3 pyquaternion==0.9.9 python-dateutil==4.0.0 scikit-learn==1.9.1 scipy==1.17.1 six==1.17.0 threadpoolctl==3.8.0 tqdm==4.70.1
cd "$dir"
MPLCONFIGDIR="$dir" "$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

from nuscenes.map_expansion.arcline_path_utils import (
    get_curvature_at_distance_along_lane,
    length_of_lane,
    pose_at_length,
    project_pose_to_lane,
)

print('nuscenes-devkit', version('nuscenes-devkit'))
LENGTH, RADIUS = 42.0, 25.0


def lane(pieces, straight=LENGTH):
    """A lane to the east, of equal pieces, that bends to the left where `straight` ends."""
    paths, pose, each = [], (0.0, 0.0, 0.0), LENGTH / pieces
    for i in range(pieces):
        middle = each if (i + 0.5) * each < straight else 0.0
        path = {'start_pose': pose, 'shape': 'RSL', 'radius': RADIUS, 'segment_length': [0.0, middle, each - middle]}
        pose = path['end_pose'] = pose_at_length(path, each)
        paths.append(path)
    return paths


def found(paths, at, resolution=0.5):
    return project_pose_to_lane((at, 1.0, 0.0), paths, resolution_meters=resolution)[1]


ok = True
for pieces in (1, 10, 20, 40):
    paths = lane(pieces)
    at, ahead, end = (found(paths, x) for x in (20.0, 30.0, LENGTH))
    coarse, fine = found(paths, 20.0, 2.0), found(paths, 20.0, 0.01)
    print(f'{pieces} pieces, {length_of_lane(paths):.0f} m: 20 m are {at} m ({coarse:.0f} m by 2 m, {fine:.2f} m by 0.01 m), '
          f'10 m from there {ahead - at:.1f} m, the end is at {end} m')
    right = abs(at - 20.0) <= 0.5 and abs(coarse - 20.0) <= 2.0 and abs(end - LENGTH) <= 0.5
    ok = ok and right == (pieces == 1) and abs(fine - 20.0) < 0.3
    ok = ok and (pieces < 20 or (at > 28.0 and coarse > 50.0 and end > 59.0))
paths = lane(20, straight=30.0)
before, there = (get_curvature_at_distance_along_lane(d, paths) for d in (25.0, found(paths, 25.0)))
print(f'at 25 m of a lane that is straight up to 30 m: curvature {before} by its distance, {there} by the one that is found')
try:
    answer = get_curvature_at_distance_along_lane(found(lane(20), LENGTH), lane(20))
except ValueError as error:
    answer = f'ValueError: {error}'
print('curvature where the lane ends:', answer)
ok = ok and before == 0 and there == 1 / RADIUS and str(answer).startswith('ValueError')
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
