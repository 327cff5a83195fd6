#!/usr/bin/env bash
# SlipX: in reverse its bicycle and double-track cars drive straight on, however they steer.
#
# Expected: with the wheels turned by 0.1 rad a car of 0.32 m wheelbase turns by 0.314 rad for every metre, forward and, with the
# other sign of the yaw rate, in reverse; the three tiers are one car, and agree at small slip.
# What happens: forward all do. In reverse the kinematic tier keeps its circle, the dynamic bicycle and the double-track model
# turn by less than 0.005 rad for every metre, at 0.3 as at 3 m/s, and with steps ten times as fine. The slip angles of
# all wheels are those of rolling backwards, half a turn, so that all tyres slide at their limit.
# Why it matters: a planner that backs out of a dead end by the kinematic tier drives straight into the wall by the two that
# are there to be closer to the car; tiers are to be exchanged by one argument.
#
# Output seen:
#   slipx 0.2.0
#   by geometry 0.314 rad for every metre
#   L0_Kinematic: at +1.0 m/s +0.313 rad/m, at -0.3 m/s -0.313 rad/m, at -1.0 m/s -0.313 rad/m, at -3.0 m/s -0.313 rad/m
#   L1_Bicycle: at +1.0 m/s +0.313 rad/m, at -0.3 m/s +0.000 rad/m, at -1.0 m/s +0.000 rad/m, at -3.0 m/s +0.000 rad/m
#   L2_DoubleTrack: at +1.0 m/s +0.312 rad/m, at -0.3 m/s -0.001 rad/m, at -1.0 m/s +0.001 rad/m, at -3.0 m/s +0.000 rad/m
#   L1_Bicycle, steps of 0.1 ms: at -1.0 m/s +0.000 rad/m
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps attrs==26.1.0 jsonschema==4.26.0 jsonschema-specifications==2025.9.1 numpy==2.4.6 PyYAML==6.0.4 referencing==0.37.0 rpds-py==2026.9.1 slipx==0.2.0 typing_extensions==4.16.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import numpy as np
import slipx

print('slipx', version('slipx'))
PARAMETERS, STEER = slipx.load_reference_car().params, 0.1
TIERS = (slipx.Tier.L0_Kinematic, slipx.Tier.L1_Bicycle, slipx.Tier.L2_DoubleTrack)


def turned(tier, speed, step=1e-3, duration=10.0):
    """Angle turned by per metre driven, with the steering and the speed held, in the second half of the time."""
    model, state, kept = slipx.VehicleModel.create(tier, PARAMETERS), slipx.VehicleState(), []
    state.vel_body.x = speed
    for _ in range(int(duration / step)):
        push = 20.0 * (speed - state.vel_body.x)
        model.step(state, slipx.DriveInput(steer_cmd=STEER, accel_cmd=max(-3.0, min(3.0, push))), step)
        kept.append((state.pos.x, state.pos.y, state.yaw))
    kept = np.array(kept[len(kept) // 2:])
    driven = np.hypot(*np.diff(kept[:, :2], axis=0).T).sum()
    return (np.unwrap(kept[:, 2])[-1] - kept[0, 2]) / driven


length = PARAMETERS.wheelbase
print(f'by geometry {np.tan(STEER) / length:.3f} rad for every metre')
seen = {}
for tier in TIERS:
    for speed in (1.0, -0.3, -1.0, -3.0):
        seen[tier, speed] = turned(tier, speed)
    print(f'{tier.name}: ' + ', '.join(f'at {speed:+.1f} m/s {seen[tier, speed]:+.3f} rad/m' for speed in (1.0, -0.3, -1.0, -3.0)))
finer = turned(slipx.Tier.L1_Bicycle, -1.0, step=1e-4)
print(f'L1_Bicycle, steps of 0.1 ms: at -1.0 m/s {finer:+.3f} rad/m')
kinematic, others = TIERS[0], TIERS[1:]
ok = all(abs(seen[tier, 1.0] - 0.313) < 0.01 for tier in TIERS) and abs(finer) < 0.005
ok = ok and all(abs(seen[kinematic, speed] + 0.313) < 0.01 for speed in (-0.3, -1.0, -3.0))
ok = ok and all(abs(seen[tier, speed]) < 0.005 for tier in others for speed in (-0.3, -1.0, -3.0))
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
