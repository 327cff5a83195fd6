#!/usr/bin/env bash
# immrax: at a northing of 5400 km the car's reachable set drives with 5 to 15 m/s and stays where it is.
#
# Expected: bounds by interval analysis and mixed monotone embedding hold the car, wherever on the map it starts; for a car at
# 10 m/s that accelerates by +-1 m/s² they are 36.9 and 63.1 m after 5 s.
# What happens: so they are for a start at 0. From 690 km, an easting in UTM, the set ends 0.5 m before the farthest car, from
# 2000 km it begins 8.6 m beyond the nearest one, and from 5400 km, a northing in the middle of Europe, all of it is where it
# began, while its speeds are right. Numbers have 24 bits, the default of JAX, nothing is rounded outwards, and
# by steps of 0.01 s the car moves by less than half of the last bit.
# Why it matters: an over-approximation is used in place of a test. Here it is an empty road ahead of a car at 36 km/h, in the
# coordinates in which maps come, and no message says so.
#
# Output seen:
#   immrax 0.3.8
#   jax 0.10.2
#   exactly: from 36.90 to 63.10 m
#   from 0 m: from 36.90 to 63.10 m, at 4.90 to 15.10 m/s
#   from 690000 m: from 34.38 to 62.62 m, at 4.90 to 15.10 m/s
#   from 2000000 m: from 45.50 to 62.62 m, at 4.90 to 15.10 m/s
#   from 5400000 m: from 0.00 to 0.00 m, at 4.90 to 15.10 m/s
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps contourpy==1.3.3 cvxopt==1.3.3 cycler==0.12.1 diffrax==0.7.2 equinox==0.13.8 fonttools==4.68.0 immrax==0.3.8 immutabledict==4.3.1 jax==0.10.2 jaxlib==0.10.2 jaxtyping==0.3.11 kiwisolver==1.5.1 lineax==0.1.1 linrax==0.3.0 matplotlib==3.9.4 ml_dtypes==0.6.0 numpy==2.4.6 opt_einsum==3.4.0 optimistix==0.1.0 packaging==26.4 pillow==13.0.0 pycddlib==2.1.8.post1 pyparsing==3.3.3 pypoman==1.1.1 python-dateutil==4.0.0 scipy==1.17.1 shapely==2.0.7 tabulate==0.9.0 typing_extensions==4.16.0 tzdata==2026.6 wadler_lindig==0.1.8
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import logging
from importlib.metadata import version

import immrax
import jax.numpy as jnp
import numpy as np

logging.disable(logging.CRITICAL)
for name in ('immrax', 'jax'):
    print(name, version(name))
DURATION, SPEED, LIMIT, SPREAD = 5.0, 10.0, 1.0, 0.1


class Car(immrax.System):
    """A point that moves along a line, with place and speed as its state and the acceleration as its input."""

    def __init__(self):
        self.evolution, self.xlen = 'continuous', 2

    def f(self, t, x, u):
        return jnp.array([x[1], u[0]])


def reached(origin):
    """Bounds of place, from where the car starts, and of speed at the end, by the package's default solver and step."""
    start = immrax.interval(jnp.array([origin - SPREAD, SPEED - SPREAD]), jnp.array([origin + SPREAD, SPEED + SPREAD]))
    push = immrax.interval(jnp.array([-LIMIT]), jnp.array([LIMIT]))
    path = immrax.natemb(Car()).compute_trajectory(0.0, DURATION, immrax.i2ut(start), (lambda t, x: push,))
    states = np.asarray(path.ys, float)
    low, slow, high, fast = states[np.isfinite(states).all(axis=1)][-1]
    return low - origin, high - origin, slow, fast


true = [sign * (SPREAD + SPREAD * DURATION + LIMIT * DURATION**2 / 2.0) + SPEED * DURATION for sign in (-1.0, 1.0)]
print(f'exactly: from {true[0]:.2f} to {true[1]:.2f} m')
seen = {}
for origin in (0.0, 690000.0, 2000000.0, 5400000.0):
    low, high, slow, fast = seen[origin] = reached(origin)
    print(f'from {origin:.0f} m: from {low:.2f} to {high:.2f} m, at {slow:.2f} to {fast:.2f} m/s')
ok = abs(seen[0.0][0] - true[0]) < 0.01 and abs(seen[0.0][1] - true[1]) < 0.01
ok = ok and seen[690000.0][1] < true[1] - 0.3 and seen[2000000.0][0] > true[0] + 5.0 and seen[5400000.0][:2] == (0.0, 0.0)
ok = ok and all(abs(slow - 4.9) < 0.01 and abs(fast - 15.1) < 0.01 for _, _, slow, fast in seen.values())
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
