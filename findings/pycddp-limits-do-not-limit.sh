#!/usr/bin/env bash
# pycddp: the default solver, control-limited DDP, plans with any acceleration whatever the control limits, and calls it optimal.
#
# Expected: a car that is to go from 20 m/s to rest within 3 s, with a ControlConstraint of +-3 m/s² and +-0.3 rad, ends at 11 m/s by all of
# the four solvers; solve() without an argument is CLDDP, the one that is named after control limits.
# What happens: LogDDP, IPDDP and MSIPDDP keep to 3 m/s² and end at 11 m/s. CLDDP brakes with 6.67 m/s² throughout and stands.
# It reports OptimalSolutionFound, a primal infeasibility of 0, and its plan is the same to the last bit as without any
# constraint, whatever name the constraint is added under. compute_violation of the same constraint says 3.67.
# Why: the C++ solver asks its constraint of the name ControlConstraint for its type, and one that comes from Python is wrapped in another.
# The documentation shows "Torque-limited CLDDP" from Python.
# Why it matters: it is the default, and the only number that would tell, the infeasibility, is 0.
#
# Output seen:
#   pycddp 0.5.2
#   CLDDP (default): OptimalSolutionFound, brakes with up to 6.67 m/s², ends at 0.0 m/s, infeasibility 0, violation 3.67
#   the same without the constraint and with it under other names: True
#   LogDDP: AcceptableSolutionFound, brakes with up to 3.00 m/s², ends at 11.0 m/s, infeasibility 0, violation 0.00
#   IPDDP: OptimalSolutionFound, brakes with up to 3.00 m/s², ends at 11.0 m/s, infeasibility 2e-15, violation 0.00
#   MSIPDDP: AcceptableSolutionFound, brakes with up to 3.00 m/s², ends at 11.0 m/s, infeasibility 2e-15, violation 0.00
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps numpy==2.4.6 pycddp==0.5.2
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import numpy as np
import pycddp

print('pycddp', version('pycddp'))
STEPS, DT = 30, 0.1
START, GOAL = np.array([0.0, 0.0, 0.0, 20.0]), np.zeros(4)
LIMITS = pycddp.ControlConstraint(np.array([-3.0, -0.3]), np.array([3.0, 0.3]))


def plan(solver=None, name=None):
    """A bicycle that is to stand after 3 s, its place being free, and what the solver says of it."""
    options = pycddp.CDDPOptions()
    options.max_iterations, options.verbose, options.print_solver_header = 300, False, False
    car = pycddp.Bicycle(DT, 2.7, 'euler')
    problem = pycddp.CDDP(START, GOAL, STEPS, DT, options)
    problem.set_dynamical_system(car)
    problem.set_objective(pycddp.QuadraticObjective(np.zeros((4, 4)), np.diag([0.1, 1.0]), np.diag([0.0, 0.0, 0.0, 100.0]), GOAL, [], DT))
    if name is not None:
        problem.add_constraint(name, LIMITS)
    states = [START]
    for _ in range(STEPS):
        states.append(np.asarray(car.get_discrete_dynamics(states[-1], np.zeros(2), 0.0)))
    problem.set_initial_trajectory(states, [np.zeros(2)] * STEPS)
    result = problem.solve() if solver is None else problem.solve(solver)
    controls = np.array(result.control_trajectory)
    return result, controls, max(LIMITS.compute_violation(START, control) for control in controls)


def tell(name, result, controls, violation):
    """One line about a plan."""
    print(f'{name}: {result.status_message}, brakes with up to {-controls[:, 0].min():.2f} m/s², ends at '
          f'{abs(result.state_trajectory[-1][3]):.1f} m/s, infeasibility {result.final_primal_infeasibility:.0g}, violation {violation:.2f}')


limited, controls, violation = plan(name='ControlConstraint')
tell('CLDDP (default)', limited, controls, violation)
same = all(np.array_equal(controls, plan(name=name)[1]) for name in (None, 'ControlBounds', 'limits'))
print(f'the same without the constraint and with it under other names: {same}')
ok = same and limited.solver_name == 'CLDDP' and limited.status_message == 'OptimalSolutionFound' and violation > 3.5
ok = ok and limited.final_primal_infeasibility == 0.0 and abs(limited.state_trajectory[-1][3]) < 0.1
for solver in (pycddp.SolverType.LogDDP, pycddp.SolverType.IPDDP, pycddp.SolverType.MSIPDDP):
    result, controls, violation = plan(solver, 'ControlConstraint')
    tell(solver.name, result, controls, violation)
    ok = ok and violation < 0.01 and 10.9 < result.state_trajectory[-1][3] < 11.5
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
