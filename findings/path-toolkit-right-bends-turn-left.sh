#!/usr/bin/env bash
# commonroad-path-toolkit: by fitted circles every bend turns left, and a lane change of two equal bends is straight.
#
# Expected: the two curvatures of a path, that from its points and compute_circle_fit_curvature() (fitted arcs, for noisy
# points), agree: positive in left bends, negative in right ones; where the fit is bad more arcs are taken (max_rmse).
# What happens: the arcs are found as they should be, but what is made of them is their absolute value: a right bend, and
# both halves of an S, curve to the left. If both bends of an S are exactly alike, as in a lane change that was planned,
# the curvature is 0 from its start to its end, however sharp they are; with noise of 1 mm it is positive in both.
# Why it matters: headings, lateral accelerations and steering are made of the curvature, and limits of speed. By this
# one an evasion with radii of 20 m may be driven at any speed; a path tested in a left bend is right.
#
# Output seen:
#   commonroad-path-toolkit 0.0.1
#   left bend of 50 m: from points +0.020 +0.020, by circles +0.020 +0.020 1/m (arcs found: 1, of 0.020 1/m)
#   right bend of 50 m: from points -0.020 -0.020, by circles +0.020 +0.020 1/m (arcs found: 1, of 0.020 1/m)
#   left, then longer right bend of 50 m: from points +0.020 -0.020, by circles +0.020 +0.020 1/m (arcs found: 2, of 0.020 1/m)
#   lane change of 200 m: from points +0.005 -0.005, by circles +0.000 +0.000 1/m (arcs found: 2, of 0.005 1/m)
#   lane change of 50 m: from points +0.020 -0.020, by circles +0.000 +0.000 1/m (arcs found: 2, of 0.020 1/m)
#   lane change of 20 m: from points +0.050 -0.050, by circles +0.000 +0.000 1/m (arcs found: 2, of 0.050 1/m)
#   lane change of 20 m, with noise: from points +0.052 -0.047, by circles +0.050 +0.050 1/m (arcs found: 2, of 0.050 1/m)
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps commonroad-path-toolkit==0.0.1 numpy==2.4.6
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import numpy as np
from commonroad_path_toolkit import Path2D

print('commonroad-path-toolkit', version('commonroad-path-toolkit'))
SPACING = 0.5


def arc(radius, degrees):
    """Curvatures, one every SPACING metres, of an arc; negative degrees turn right."""
    return np.full(round(radius * np.radians(abs(degrees)) / SPACING), np.sign(degrees) / radius)


def path(*arcs, noise=0.0):
    curvature = np.concatenate(arcs)
    heading = np.r_[0.0, np.cumsum(SPACING * curvature)]
    middle = (heading[1:] + heading[:-1]) / 2
    points = np.r_[[[0.0, 0.0]], np.cumsum(SPACING * np.c_[np.cos(middle), np.sin(middle)], axis=0)]
    return curvature, Path2D(points=points + noise * np.random.default_rng(0).standard_normal(points.shape))


ok = True
drawn = {'left bend of 50 m': (arc(50, 60),), 'right bend of 50 m': (arc(50, -60),),
         'left, then longer right bend of 50 m': (arc(50, 30), arc(50, -60))}
drawn |= {f'lane change of {radius} m': (arc(radius, 34), arc(radius, -34)) for radius in (200, 50, 20)}
drawn['lane change of 20 m, with noise'] = drawn['lane change of 20 m']
for name, arcs in drawn.items():
    noise = 0.001 if 'noise' in name else 0.0
    curvature, made = path(*arcs, noise=noise)
    points, circles = np.asarray(made.curvature_np), np.asarray(made.compute_circle_fit_curvature())
    found = made.find_circle_segments(0, len(circles) - 1)
    at = [len(circles) // 6, -len(circles) // 6]
    print(f'{name}: from points {points[at[0]]:+.3f} {points[at[1]]:+.3f}, by circles {circles[at[0]]:+.3f} {circles[at[1]]:+.3f} 1/m '
          f'(arcs found: {len(found)}, of {found[0][2]:.3f} 1/m)')
    straight = name.startswith('lane change') and not noise
    for k in at:
        ok = ok and np.sign(points[k]) == np.sign(curvature[k])
        ok = ok and (not circles.any() if straight else abs(circles[k] - abs(curvature[k])) < 2e-3)
    ok = ok and all(abs(part[2] - abs(curvature[0])) < 2e-3 for part in found)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
