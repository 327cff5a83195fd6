#!/usr/bin/env bash
# ProxQP: a corridor that is closed (lower bound above upper bound at one step) is
# "solved" if the reference runs through its middle.
#
# Expected: no point satisfies lb <= x <= ub when lb > ub, so the problem is primal
# infeasible whatever the cost; quadprog, DAQP, Clarabel, PIQP and HiGHS say so.
# What happens: the residual adds the excess over the upper bound and the shortfall
# below the lower bound with opposite signs; midway between crossed bounds they
# cancel to zero. A cost that pulls to the corridor's centre lands exactly there:
# status PROXQP_SOLVED, primal residual 1e-6, found = True, x outside both bounds.
# With another reference the same corridor is rightly refused.
# Why it matters: lateral repairs track the middle of the free space between
# obstacles. When the obstacles close the gap, the answer "feasible" leads through
# both.
#
# Output seen:
#   qpsolvers 4.13.0
#   proxsuite 0.8.0
#   daqp 0.11.0
#   quadprog 0.1.13
#   clarabel 0.11.1
#   piqp 0.6.4
#   highspy 1.15.1
#   corridor closed at the fourth step (0.6 <= d <= 0.4), following its centre line: found {'proxqp': True, 'quadprog': False, 'daqp': False, 'clarabel': False, 'piqp': False, 'highs': False}
#   corridor closed at the fourth step (0.6 <= d <= 0.4), following its lower edge: found {'proxqp': False, 'quadprog': False, 'daqp': False, 'clarabel': False, 'piqp': False, 'highs': False}
#   proxsuite itself: PROXQP_SOLVED d = [0.  0.5 0.5 0.5 2. ] primal residual 9.99998999939855e-07
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check qpsolvers==4.13.0 proxsuite==0.8.0 daqp==0.11.0 quadprog==0.1.13 clarabel==0.11.1 piqp==0.6.4 highspy==1.15.1 numpy==2.4.6 scipy==1.17.1
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
for name in ['qpsolvers', 'proxsuite', 'daqp', 'quadprog', 'clarabel', 'piqp', 'highspy']:
    print(name, version(name))
import numpy as np
import proxsuite
from qpsolvers import Problem, solve_problem

low = np.array([-2.0, -1.0, -0.5, 0.6, 1.0])
high = np.array([2.0, 2.0, 1.5, 0.4, 3.0])
middle = (low + high) / 2
solvers = ("proxqp", "quadprog", "daqp", "clarabel", "piqp", "highs")
answers = {}
for name, target in (("centre line", middle), ("lower edge", low)):
    answers[name] = {s: bool(solve_problem(Problem(np.eye(5), -target, None, None, None, None, low, high), s).found)
                     for s in solvers}
    print(f"corridor closed at the fourth step (0.6 <= d <= 0.4), following its {name}: found", answers[name])
qp = proxsuite.proxqp.dense.QP(5, 0, 5)
qp.init(np.eye(5), -middle, None, None, np.eye(5), low, high)
qp.solve()
print("proxsuite itself:", qp.results.info.status.name, "d =", qp.results.x.round(4), "primal residual", qp.results.info.pri_res)
assert answers["centre line"] == {s: s == "proxqp" for s in solvers}
assert not any(answers["lower edge"].values())
assert qp.results.info.status.name == "PROXQP_SOLVED" and 0.4 < qp.results.x[3] < 0.6
print("behaviour as stated")
PY
