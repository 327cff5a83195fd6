#!/usr/bin/env bash
# CasADi: a QP by fatrop reports success with seven times the least cost; the cost that it returns is never the cost.
#
# Expected: a braking problem (20 m/s to about 5 m/s within 60 m and 5 s, least squared acceleration) has the least
# cost 45.07 by every plugin, with or without the stages of the problem named, and `f` is the cost of `x`.
# What happens: with the stages named ("manual") or found ("auto") qpsol's fatrop returns SOLVER_RET_SUCCESS and a
# trajectory that keeps all rows and costs 332; the gradient of the Lagrangian is 93 there. With the rows of the
# dynamics times -1 the same call fails. Without stages x is right. In all cases f is 250, the
# constant of the objective. nlpsol's fatrop solves the same problem, with the same stages, right.
# Why it matters: fatrop is chosen for trajectories with stages. Success and kept constraints are no evidence, and
# who takes the cheapest of several starts or of several solvers by f compares constants.
#
# Output seen:
#   casadi 3.8.2
#   qpsol, highs: success True, f 45.07, cost of x 45.07, constraints off by 4e-14, gradient of the Lagrangian 6e-06
#   nlpsol, fatrop, stages named: success True, f 45.07, cost of x 45.07, constraints off by 6e-07, gradient of the Lagrangian 2.7e-15
#   qpsol, fatrop: success True, f 250.00, cost of x 45.07, constraints off by 6e-07, gradient of the Lagrangian 5.3e-15
#   qpsol, fatrop, stages found: success True, f 250.00, cost of x 332.22, constraints off by 7e-15, gradient of the Lagrangian 93
#   qpsol, fatrop, stages named: success True, f 250.00, cost of x 332.22, constraints off by 7e-15, gradient of the Lagrangian 93
#   qpsol, fatrop, stages named, rows times -1: success False, f 250.00, cost of x 250.00, constraints off by 2e+01, gradient of the Lagrangian 1e+02
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps casadi==3.8.2 numpy==2.4.6
cd "$dir"
"$dir/venv/bin/python" -W ignore - > all <<'PY' || { tail -3 all >&2; exit 1; }
from importlib.metadata import version

import casadi
import numpy as np

print('> casadi', version('casadi'))
N, DT, INF = 20, 0.25, np.inf


def braking(sign=1.0):
    """Stages (s, v), a; rows of the dynamics; a wish for 5 m/s at the end."""
    x = [casadi.MX.sym(f'x{k}', 2) for k in range(N + 1)]
    a = [casadi.MX.sym(f'a{k}') for k in range(N)]
    variables = casadi.vertcat(*[part for k in range(N) for part in (x[k], a[k])], x[N])
    rows = [sign * (x[k + 1] - casadi.vertcat(x[k][0] + DT * x[k][1] + DT**2 / 2 * a[k], x[k][1] + DT * a[k])) for k in range(N)]
    cost = sum(DT * b**2 for b in a) + 10 * (x[N][1] - 5.0) ** 2
    return {'x': variables, 'f': cost, 'g': casadi.vertcat(*rows)}


low = np.array([0.0, 20.0] + [-8.0] + [-INF, 0.0, -8.0] * (N - 1) + [-INF, 0.0])
high = np.array([0.0, 20.0] + [3.0] + [60.0, 30.0, 3.0] * (N - 1) + [60.0, 30.0])
stages = dict(structure_detection='manual', N=N, nx=[2] * (N + 1), nu=[1] * N + [0], ng=[0] * (N + 1))
ways = {'qpsol, highs': (casadi.qpsol, 'highs', {}, 1.0),
        'nlpsol, fatrop, stages named': (casadi.nlpsol, 'fatrop', stages | {'fatrop.print_level': 0}, 1.0),
        'qpsol, fatrop': (casadi.qpsol, 'fatrop', {}, 1.0),
        'qpsol, fatrop, stages found': (casadi.qpsol, 'fatrop', {'structure_detection': 'auto'}, 1.0),
        'qpsol, fatrop, stages named': (casadi.qpsol, 'fatrop', stages, 1.0),
        'qpsol, fatrop, stages named, rows times -1': (casadi.qpsol, 'fatrop', stages, -1.0)}
found = {}
for name, (make, plugin, options, sign) in ways.items():
    problem = braking(sign)
    solver = make('solver', plugin, problem, {'print_time': False, 'error_on_fail': False} | options)
    answer = solver(x0=0, lbx=low, ubx=high, lbg=0, ubg=0)
    x = np.array(answer['x']).ravel()
    look = casadi.Function('look', [problem['x']], [problem['f'], problem['g'], casadi.gradient(problem['f'], problem['x']),
                                                    casadi.jacobian(problem['g'], problem['x'])])
    cost, rows, gradient, jacobian = (np.array(value) for value in look(x))
    slope = gradient.ravel() + np.array(answer['lam_x']).ravel() + jacobian.T @ np.array(answer['lam_g']).ravel()
    off = max(np.abs(rows).max(), (low - x).max(), (x - high).max())
    success = solver.stats()['success']
    found[name] = success, float(answer['f']), float(cost[0, 0]), float(np.abs(slope).max()), float(off)
    print(f'> {name}: success {success}, f {found[name][1]:.2f}, cost of x {found[name][2]:.2f}, '
          f'constraints off by {off:.1g}, gradient of the Lagrangian {found[name][3]:.2g}')
best = found['qpsol, highs'][2]
ok = abs(best - 45.069) < 0.01
ok = ok and all(found[name][0] and abs(found[name][2] - best) < 0.01
                for name in ('nlpsol, fatrop, stages named', 'qpsol, fatrop'))
for name in ('qpsol, fatrop, stages found', 'qpsol, fatrop, stages named'):
    success, f, cost, slope, off = found[name]
    ok = ok and success and cost > 5.0 * best and off < 1e-5 and slope > 10.0
ok = ok and not found['qpsol, fatrop, stages named, rows times -1'][0]
ok = ok and all(abs(found[name][1] - 250.0) < 1e-9 for name in ways if name.startswith('qpsol, fatrop'))
print('> behaviour as stated' if ok else '> behaviour has changed')
raise SystemExit(not ok)
PY
sed -n 's/^> //p' all
