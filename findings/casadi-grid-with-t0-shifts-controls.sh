#!/usr/bin/env bash
# CasADi: adding the start time to an integrator's grid shifts the controls by one
# interval; the first control is ignored and the last one is used.
#
# Expected: with t0 = 0 and the grid [0, 1, 2, 3] the output has the start state as
# its first column, and u_k acts on [t_k, t_k+1], as in any shooting method: with
# u = (1, 2, 3, anything) the result is 0, 1, 3, 6.
# What happens: column k acts on the interval that ENDS at grid point k. The first
# column belongs to the empty interval [0, 0] and is never used; the last, which
# has no interval of its own in the usual reading, drives the last second:
# 0, 2, 5, 105 for (1, 2, 3, 100). Without t0 in the grid the reading is the usual
# one. All four plugins agree, and a Jacobian with respect to the first control is
# structurally or numerically 0.
# Why it matters: simulate a repaired trajectory "with its initial state in the
# output" and the inputs run one step ahead; in shooting the first input is free.
#
# Output seen:
#   casadi 3.8.2
#   rk          grid 1,2,3: [1. 3. 6.]  grid 0,1,2,3: [  0.   2.   5. 105.]  effect of the first control 0
#   collocation grid 1,2,3: [1. 3. 6.]  grid 0,1,2,3: [  0.   2.   5. 105.]  effect of the first control 0
#   cvodes      grid 1,2,3: [1. 3. 6.]  grid 0,1,2,3: [  0.   2.   5. 105.]  effect of the first control 0
#   idas        grid 1,2,3: [1. 3. 6.]  grid 0,1,2,3: [  0.   2.   5. 105.]  effect of the first control 0
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check casadi==3.8.2 numpy==2.4.6
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
for name in ['casadi']:
    print(name, version(name))
import casadi as ca
x, u = ca.SX.sym("x"), ca.SX.sym("u")
dae = {"x": x, "u": u, "ode": u}
controls = ca.DM([[1, 2, 3, 100]])
for plugin in ("rk", "collocation", "cvodes", "idas"):
    without = ca.integrator("F", plugin, dae, 0, [1.0, 2.0, 3.0])(x0=0, u=controls[:, :3])["xf"].full().ravel()
    step = ca.integrator("F", plugin, dae, 0, [0.0, 1.0, 2.0, 3.0])
    with_start = step(x0=0, u=controls)["xf"].full().ravel()
    sym = ca.MX.sym("u", 1, 4)
    slope = ca.Function("J", [sym], [ca.jacobian(step(x0=0, u=sym)["xf"], sym)])(controls).full()
    print(f"{plugin:11s} grid 1,2,3: {without.round(6)}  grid 0,1,2,3: {with_start.round(6)}  effect of the first control {abs(slope[:, 0]).max():.1g}")
    assert abs(without - [1, 3, 6]).max() < 1e-5 and abs(with_start - [0, 2, 5, 105]).max() < 1e-4
    assert abs(slope[:, 0]).max() == 0.0 and abs(slope[3, 3] - 1.0) < 1e-5
print("behaviour as stated")
PY
