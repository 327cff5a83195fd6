#!/usr/bin/env bash
# py123d: on the third level of a ramp a car is on the first, and on every slope it is further down.
#
# Expected: Polyline3D projects "a point onto the 3D polyline" to a distance along it; interpolated at that distance, a point of the
# line comes back.
# What happens: projecting is done in the plane and gives a distance on the map, interpolating is done in space. On 400 m of a
# 12 % slope the points come back up to 2.8 m behind themselves. On a car park's helix of three turns the points of the upper
# levels come back 6 m lower, on the level below all others; on one turn nothing is wrong but 6 cm.
# Why it matters: lanes of all data sets that the package unifies are such lines; matching a car to its lane and placing it there
# again moves it, the more the longer the lane, and by levels where roads lie above each other.
#
# Output seen:
#   py123d 0.7.0
#   straight, 12 %: 402.9 m long, its points come back up to 2.83 m away, 0.34 m lower or higher
#   one turn: 75.4 m long, its points come back up to 0.06 m away, 0.00 m lower or higher
#   three turns: 226.3 m long, its points come back up to 6.00 m away, 6.00 m lower or higher
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps py123d==0.7.0 numpy==2.2.6 pyquaternion==0.9.9 scipy==1.17.1 shapely==2.2.0 typing_extensions==4.16.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import numpy as np
from py123d.geometry import Point3D
from py123d.geometry.polyline import Polyline3D

print('py123d', version('py123d'))


def helix(turns):
    """A ramp of 12 m radius that rises by 3 m for every turn, in pieces of 5 degrees."""
    angle = np.linspace(0.0, 2.0 * np.pi * turns, 72 * turns + 1)
    return np.column_stack([12.0 * np.cos(angle), 12.0 * np.sin(angle), 3.0 * angle / (2.0 * np.pi)])


x = np.linspace(0.0, 400.0, 81)
RAMPS = {'straight, 12 %': np.column_stack([x, 0.0 * x, 0.12 * x]), 'one turn': helix(1), 'three turns': helix(3)}
seen = {}
for name, points in RAMPS.items():
    line = Polyline3D.from_array(points)
    moved = []
    for k in range(5, len(points) - 1):
        back = line.interpolate(float(line.project(Point3D(*points[k])))).array
        moved.append((np.linalg.norm(back - points[k]), back[2] - points[k][2]))
    far, high = np.abs(np.array(moved)).max(axis=0)
    seen[name] = far, high
    print(f'{name}: {line.length:.1f} m long, its points come back up to {far:.2f} m away, {high:.2f} m lower or higher')
ok = abs(seen['straight, 12 %'][0] - 2.83) < 0.02 and seen['one turn'][0] < 0.2
ok = ok and all(abs(value - 6.0) < 0.1 for value in seen['three turns'])
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
