#!/usr/bin/env bash
# commonroad-clcs: adaptive resampling works for left bends; of right ones it makes NaN curvature.
#
# Expected: resample_polyline_adaptive puts more points where the curvature is high; of a mirrored
# path it gives the mirrored points.
# What happens: the densest spacing is tied to the largest *signed* curvature. On a path that only
# turns right that is 0 (or the negative curvature of the gentlest part), so that the spacing stays at its
# smallest wherever the path bends, at all right bends alike, and the end point comes twice. Both curvature
# functions of the package answer NaN there.
# Why it matters: reference paths (ResamplingOption.ADAPTIVE) of right turns carry NaN into speed limits and
# Frenet conversions; the same planner works on the mirrored junction.
#
# Output seen:
#   commonroad-clcs 2025.2.0
#   left: 128 points, 0.298 to 5.000 m apart, NaN curvatures (C++, Python): [0, 0]
#   right: 170 points, 0.000 to 5.000 m apart, NaN curvatures (C++, Python): [2, 3]
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-clcs==2025.2.0 commonroad-io==2024.3 numpy==2.4.6 scipy==1.17.1 shapely==2.2.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
print('commonroad-clcs', version('commonroad-clcs'))
import numpy as np
from commonroad_clcs.util import (compute_curvature_from_polyline, compute_curvature_from_polyline_python,
                                  resample_polyline_adaptive)

# straight for 40 m, a clothoid of 40 m, then a bend of radius 20 m; a point every 0.5 m
s = np.arange(0.0, 120.01, 0.5)
curvature = np.clip((s - 40.0) / 40.0, 0.0, 1.0) / 20.0
heading = np.concatenate([[0.0], np.cumsum(0.25 * (curvature[1:] + curvature[:-1]))])
middle = 0.5 * (heading[1:] + heading[:-1])
left = np.concatenate([np.zeros((1, 2)), np.cumsum(0.5 * np.column_stack([np.cos(middle), np.sin(middle)]), axis=0)])

seen = {}
for name, path in (('left', left), ('right', left * [1.0, -1.0])):
    points = resample_polyline_adaptive(path, min_ds=0.5, max_ds=5.0)
    apart = np.hypot(*np.diff(points, axis=0).T)
    bends = [np.abs(np.asarray(f(points))) for f in (compute_curvature_from_polyline, compute_curvature_from_polyline_python)]
    seen[name] = len(points), apart.min(), [int(np.isnan(b).sum()) for b in bends]
    print(f'{name}: {len(points)} points, {apart.min():.3f} to {apart.max():.3f} m apart, '
          f'NaN curvatures (C++, Python): {seen[name][2]}')
ok = (seen['left'][0] != seen['right'][0] and seen['left'][1] > 0.1 and seen['right'][1] < 1e-9
      and seen['left'][2] == [0, 0] and min(seen['right'][2]) > 0)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
