#!/usr/bin/env bash
# cbfpy: a safety filter that brakes in time if the force is in kilonewtons drives into the standing car at full speed if it is in newtons.
#
# Expected: the filter asks for no more than the barrier does and the limits allow. The unit of the control changes a number and nothing
# else: a car of 1650 kg at 20 m/s, 100 m behind one that stands, with a time gap of 1.8 s and 5 m to be kept and limits of -6 and 3 m/s²,
# brakes with at most 3.9 m/s² and stops 5 m behind it.
# What happens: so it does with the acceleration or the force in kN as its control. With the force in units of 100 N it brakes later and
# with less, in units of 10 N it is 0.03 m/s² and in N 0.0003 m/s² (0.5 N), at every moment up to the crash. By default the barrier is
# relaxed with a penalty of 1e3 on what is missing: a kink in the cost, which is exact if it is steeper than the barrier's multiplier, and
# that grows with the square of the control's unit. In newtons the penalty is paid instead of braking, also where the limits allow all
# that the barrier asks for. Without the relaxation all units agree. Numbers are doubles and the solver is the default one throughout.
# Why it matters: the documentation calls the penalty high, and its own example has a force as its control (with a mass of 1).
#
# Output seen:
#   cbfpy 0.1.0
#   qpax 0.1.4
#   jax 0.10.2
#   at 20 m/s, 45 m behind a car at 10 m/s: the barrier asks for -4.444 m/s²
#     by m/s²: relaxed -4.4444, strict -4.4445
#     by kN: relaxed -4.4444, strict -4.4444
#     by 100 N: relaxed -3.3058, strict -4.4444
#     by 10 N: relaxed -0.0331, strict -4.4444
#     by N: relaxed -0.0003, strict -4.4444
#   at 20 m/s, 100 m behind a car that stands
#     by m/s²: stands 5.1 m behind it, braked with at most 3.91 m/s²
#     by kN: stands 5.0 m behind it, braked with at most 3.91 m/s²
#     by 100 N: stands 5.0 m behind it, braked with at most 3.31 m/s²
#     by 10 N: hits it at 19.87 m/s, braked with at most 0.03 m/s²
#     by N: hits it at 20.00 m/s, braked with at most 0.00 m/s²
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps cbfpy==0.1.0 jax==0.10.2 jaxlib==0.10.2 ml_dtypes==0.6.0 numpy==2.4.6 opt_einsum==3.4.0 packaging==26.4 qpax==0.1.4 scipy==1.17.1
cd "$dir"
export JAX_PLATFORMS=cpu JAX_ENABLE_X64=1 OPENBLAS_NUM_THREADS=1 XLA_FLAGS=--xla_cpu_multi_thread_eigen=false
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import jax.numpy as jnp
from cbfpy import CBF, CBFConfig

for name in ('cbfpy', 'qpax', 'jax'):
    print(name, version(name))
MASS, HEADWAY, REST, STEP = 1650.0, 1.8, 5.0, 0.05
UNITS = {'m/s²': 1.0, 'kN': MASS / 1e3, '100 N': MASS / 100.0, '10 N': MASS / 10.0, 'N': MASS}


class Following(CBFConfig):
    """Speed, speed of the car ahead and gap; the control is a force (or the acceleration) in units of which `size` make 1 m/s²."""

    def __init__(self, size, relaxed):
        self.size = size
        super().__init__(n=3, m=1, u_min=-6.0 * size, u_max=3.0 * size, relax_qp=relaxed)

    def f(self, z):
        return jnp.array([0.0, 0.0, z[1] - z[0]])

    def g(self, z):
        return jnp.array([[1.0 / self.size], [0.0], [0.0]])

    def h_1(self, z):
        return jnp.array([z[2] - HEADWAY * z[0] - REST])

    def alpha(self, h):
        return 0.5 * h


def filtered(unit, relaxed=True):
    """Acceleration that the filter makes of a wish to drive on, as a function of the state."""
    size = UNITS[unit]
    barrier = CBF.from_config(Following(size, relaxed))
    return lambda speed, ahead, gap: float(barrier.safety_filter(jnp.array([speed, ahead, gap]), jnp.zeros(1))[0]) / size


ok = True
speed, ahead, gap = 20.0, 10.0, 45.0
asked = ((ahead - speed) + 0.5 * (gap - HEADWAY * speed - REST)) / HEADWAY
print(f'at {speed:.0f} m/s, {gap:.0f} m behind a car at {ahead:.0f} m/s: the barrier asks for {asked:.3f} m/s²')
seen = {}
for unit in UNITS:
    seen[unit] = relaxed, strict = filtered(unit)(speed, ahead, gap), filtered(unit, False)(speed, ahead, gap)
    print(f'  by {unit}: relaxed {relaxed:.4f}, strict {strict:.4f}')
    ok = ok and abs(strict - asked) < 0.01
ok = ok and abs(seen['kN'][0] - asked) < 0.01 and -0.1 < seen['10 N'][0] < 0.0 and -0.01 < seen['N'][0] <= 0.0
print('at 20 m/s, 100 m behind a car that stands')
for unit in UNITS:
    wish, speed, gap, hardest = filtered(unit), 20.0, 100.0, 0.0
    for _ in range(400):
        push = wish(speed, 0.0, gap)
        hardest = max(hardest, -push)
        new = max(speed + push * STEP, 0.0)
        speed, gap = new, gap - (speed + new) / 2.0 * STEP
        if gap <= 0.0 or speed == 0.0:
            break
    outcome = f'hits it at {speed:.2f} m/s' if gap <= 0.0 else f'stands {gap:.1f} m behind it'
    print(f'  by {unit}: {outcome}, braked with at most {hardest:.2f} m/s²')
    ok = ok and (gap <= 0.0 and speed > 19.0 if unit in ('10 N', 'N') else abs(gap - REST) < 0.2 and speed < 0.1)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
