#!/usr/bin/env bash
# pathplanning: the optimal Reeds-Shepp path to a place 3.1 m ahead and 0.6 m to the side is 9.2 m long, the one back 3.5 m.
#
# Expected: a car that may reverse drives the shortest path there and back: both lengths are one, for every pair of poses.
# What happens: of 3000 pairs within 8 m, with 5 m of radius, the two differ in a quarter, by up to 2.7 times; the longer one is no optimum,
# since the other one reversed is shorter. Both are drivable and end on the goal, and mirrored pairs agree, so that tests of ends
# and symmetry pass. Two paths with one sequence of turns count as one if the sum of the differences of their pieces, with
# signs, is at most 0.01: not only a copy is dropped, but whatever goes further forward than the one found first.
# Why it matters: calc_optimal_path is the heuristic and the shot to the goal of planners for parking; an overestimate prunes, and
# the path that it shoots manoeuvres back and forth over 9 m where a short one would do.
#
# Output seen:
#   pathplanning 0.2.0
#   to (3.1, 0.6, 0.0): 9.18 m (R+2.92 L-1.66 R-1.66 L+2.92), back 3.49 m (L+0.08 R-1.66 L-1.66 R+0.08)
#   to (3.1, -0.6, 0.0): 9.18 m (L+2.92 R-1.66 L-1.66 R+2.92), back 3.49 m (R+0.08 L-1.66 R-1.66 L+0.08)
#   to (-3.1, 0.6, 0.0): 3.49 m (R+0.08 L-1.66 R-1.66 L+0.08), back 9.18 m (L+2.92 R-1.66 L-1.66 R+2.92)
#   to (3.1, 1.5, 0.0): 11.08 m (R+3.23 L-2.31 R-2.31 L+3.23), back 5.82 m (L+0.60 R-2.31 L-2.31 R+0.60)
#   3000 pairs: 785 differ by more than 1 %, 119 by more than half, up to 2.73 times; mirrored pairs differ by at most 0e+00 m
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps numpy==2.4.6 pathplanning==0.2.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import numpy as np
from pathplanning.geometry.reeds_shepp import calc_optimal_path

print('pathplanning', version('pathplanning'))
CURVATURE, HERE = 0.2, (0.0, 0.0, 0.0)


def length(start, goal):
    """Length of the optimal path, after a look at whether it ends on the goal."""
    path = calc_optimal_path(*start, *goal, CURVATURE)
    assert np.hypot(path.x[-1] - goal[0], path.y[-1] - goal[1]) < 1e-6
    return path.L


def way(start, goal):
    """Words of turns and lengths of the optimal path."""
    path = calc_optimal_path(*start, *goal, CURVATURE)
    return ' '.join(f'{word}{piece:+.2f}' for word, piece in zip(path.ctypes, path.lengths))


for goal in ((3.1, 0.6, 0.0), (3.1, -0.6, 0.0), (-3.1, 0.6, 0.0), (3.1, 1.5, 0.0)):
    print(f'to {goal}: {length(HERE, goal):.2f} m ({way(HERE, goal)}), back {length(goal, HERE):.2f} m ({way(goal, HERE)})')
draw = np.random.default_rng(0)
goals = np.column_stack([draw.uniform(-8.0, 8.0, (3000, 2)), draw.uniform(-np.pi, np.pi, 3000)])
there, back, mirrored = (np.array([length(*pair) for pair in pairs]) for pairs in (
    [(HERE, goal) for goal in goals], [(goal, HERE) for goal in goals], [(HERE, goal * (1.0, -1.0, -1.0)) for goal in goals]))
factor = np.maximum(there, back) / np.minimum(there, back)
print(f'3000 pairs: {np.sum(factor > 1.01)} differ by more than 1 %, {np.sum(factor > 1.5)} by more than half, up to {factor.max():.2f} times; '
      f'mirrored pairs differ by at most {np.abs(there - mirrored).max():.0e} m')
ok = abs(length(HERE, (3.1, 0.6, 0.0)) - 9.18) < 0.01 and abs(length((3.1, 0.6, 0.0), HERE) - 3.49) < 0.01
ok = ok and 600 < np.sum(factor > 1.01) < 1200 and np.abs(there - mirrored).max() < 1e-6
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
