#!/usr/bin/env bash
# commonroad-clcs: the elastic band smooths a path that runs east, and pushes one that runs north the wrong way.
#
# Expected: a path and the same path turned on the map are smoothed alike, and the band stays within its
# `max_deviation` of 0.15 m.
# What happens: the lateral offsets that the quadratic program finds are applied along (sin, cos) of the
# heading instead of (-sin, cos): to the left only where the path runs east or west, along the path at 45
# degrees, and to the right where it runs north or south. A weave of 0.5 m of a 20 m period is 0.16 m
# after smoothing eastwards and 0.46 m northwards, with 2.5 times the curvature. Eastwards the result is
# 0.34 m off the given path, since it is cut by Chaikin's rule first, and the bound counts from there.
# Why it matters: reference paths of streets in different directions differ in curvature by 2.5 times, and
# with them the lateral acceleration and the speed that a planner or a judge finds on them.
#
# Output seen:
#   commonroad-clcs 2025.2.0
#   heading   0: weave of 0.50 m becomes 0.16 m, curvature of 0.048 1/m becomes 0.017, 0.34 m off the path
#   heading  45: weave of 0.50 m becomes 0.31 m, curvature of 0.048 1/m becomes 0.031, 0.19 m off the path
#   heading  90: weave of 0.50 m becomes 0.46 m, curvature of 0.048 1/m becomes 0.043, 0.15 m off the path
#   heading 180: weave of 0.50 m becomes 0.16 m, curvature of 0.048 1/m becomes 0.017, 0.34 m off the path
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check --no-compile --no-deps antlr4-python3-runtime==4.9.3 commonroad-clcs==2025.2.0 commonroad-io==2024.3 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 osqp==0.6.7.post3 packaging==26.4 pillow==13.0.0 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==4.0.0 PyYAML==6.0.4 qdldl==0.1.9.post1 rtree==1.4.1 scipy==1.17.1 shapely==2.2.0 six==1.17.0 tqdm==4.70.1
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import math
from importlib.metadata import version

print('commonroad-clcs', version('commonroad-clcs'))
import numpy as np
from commonroad_clcs.config import CLCSParams, ProcessingOption
from commonroad_clcs.ref_path_processing.factory import ProcessorFactory
from commonroad_clcs.util import compute_curvature_from_polyline_python as curvature

x = np.arange(0.0, 101.0)
weaving = np.column_stack([x, 0.5 * np.sin(2.0 * np.pi * x / 20.0)])
inner = slice(10, -10)
before = np.abs(curvature(weaving))[inner].max()
params = CLCSParams()
params.processing_option = ProcessingOption.ELASTIC_BAND
smooth, found = ProcessorFactory.create_processor(params), {}
for heading in (0, 45, 90, 180):
    a = math.radians(heading)
    turn = np.array([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]])
    path = smooth(weaving @ turn.T) @ turn
    weave, bend = np.abs(path[inner, 1]).max(), np.abs(curvature(path))[inner].max()
    off = np.abs(path[:, 1] - np.interp(path[:, 0], *weaving.T)).max()
    found[heading] = weave, bend, off
    print(f'heading {heading:3d}: weave of 0.50 m becomes {weave:.2f} m, curvature of {before:.3f} 1/m '
          f'becomes {bend:.3f}, {off:.2f} m off the path')
ok = found[0][0] < 0.2 and found[90][0] > 0.4 and 0.25 < found[45][0] < 0.35 and found[90][1] > 2.0 * found[0][1]
ok = ok and found[0][2] > 0.3 > params.elastic_band.max_deviation and abs(found[0][0] - found[180][0]) < 0.01
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
