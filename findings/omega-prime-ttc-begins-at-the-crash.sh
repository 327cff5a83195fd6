#!/usr/bin/env bash
# omega-prime: towards a standing car there is no TTC until it is hit, and none at all if the braking suffices.
#
# Expected: a car at 20 m/s, 55 m (between the bodies) behind one that stands, has a TTC of 2.75 s and less from then
# on. If it brakes by 8 m/s² at last and stops 2 m short, the smallest TTC is 0.71 s.
# What happens: TTC and headway are computed only for moments at which the body of the one is, within 2 s before or
# after, where the body of the other is. A car that stands is in no place where the ego is before both
# touch: the first TTC is that of the crash, 0.2 s (from centre to centre), and a conflict that is resolved
# by braking leaves no row. Behind a moving car TTCs begin when the gap in time is below 2 s, with the same centres.
# Why it matters: near misses are what a TTC is looked for in recorded traffic: the end of a queue, a
# stopped bus, a car that waits to turn. They count as no conflict; only crashes and following are found.
#
# Output seen:
#   omega-prime 0.3.7
#   runs into a standing car: TTC from 2.8 s on, the first 0.20 s; between the bodies 2.75 s at the start, 0.05 s at least, contact at 2.8 s
#   stops behind a standing car: no TTC at all; between the bodies 2.75 s at the start, 0.71 s at least, 2.0 m left
#   closes in on a slower car: TTC from 1.3 s on, the first 4.70 s; between the bodies 5.00 s at the start, 0.10 s at least, contact at 5.0 s
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps Jinja2==3.1.6 MarkupSafe==3.0.4 StrEnum==0.5.0 altair==6.3.0 annotated-doc==0.0.7 annotated-types==0.8.0 attrs==26.1.0 betterosi==0.9.0 certifi==2026.10.19.post1 cloudpickle==3.1.3 cycler==0.12.1 filelock==4.3.1 fonttools==4.68.0 joblib==1.6.0 jsonschema-specifications==2025.9.1 jsonschema==4.26.0 kiwisolver==1.5.1 loguru==0.7.3 lxd_io==0.4.10 lxml==6.1.3 lz4==4.4.5 matplotlib==3.11.2 mcap==1.6.0 mypy_extensions==1.2.0 narwhals==2.29.0 networkx==3.6.1 numpy==2.4.6 omega-prime==0.3.7 packaging==26.4 pandas==3.1.1 pandera==0.35.0 pillow==13.0.0 polars-runtime-32==1.44.2 polars-st==0.11.0 polars==1.44.2 protobuf-py-ext==0.6.0 protobuf-py==0.6.0 pyarrow==26.0.1 pydantic==2.14.4 pydantic_core==2.50.5 pyogrio==0.13.0 pyparsing==3.3.3 pyproj==3.7.2 python-dateutil==4.0.0 pyxodr-omega-prime==0.1.5 referencing==0.37.0 rich==15.0.0 rpds-py==2026.9.1 scipy==1.17.1 shapely==2.2.0 shellingham==1.5.4 tqdm==4.70.1 typeguard==4.6.1 typer==0.29.2 typing-inspect==0.9.0 typing-inspection==0.4.5 typing_extensions==4.16.0 zstandard==0.25.0 contourpy==1.3.3 markdown-it-py==4.3.0 mdurl==0.1.2 Pygments==2.21.0 shellingham==1.5.4 tzdata==2026.6
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { tail -3 errors >&2; exit 1; }
from importlib.metadata import version

import numpy as np
import omega_prime
import pandas as pd
from omega_prime.metrics import (MetricManager, curvilinear_projection, distance_traveled, timegaps_and_min_timegaps,
                                 ttc_and_thw, vel)

print('omega-prime', version('omega-prime'))
DT, LENGTH = 0.1, 5.0
time = DT * np.arange(80)


def driven(velocity):
    """Places and speeds of a car that begins at 0."""
    return np.r_[0.0, np.cumsum((velocity[1:] + velocity[:-1]) / 2 * DT)], velocity


def recorded(number, places, speeds):
    still = dict.fromkeys(('y', 'z', 'vel_y', 'vel_z', 'acc_x', 'acc_y', 'acc_z', 'roll', 'pitch', 'yaw'), 0.0)
    return [still | dict(total_nanos=round(t * 1e9), idx=number, x=float(x), vel_x=float(v), length=LENGTH, width=2.0,
                         height=1.5, type=2, role=-1, subtype=-1) for t, x, v in zip(time, places, speeds)]


metrics = MetricManager(metrics=[vel, distance_traveled, timegaps_and_min_timegaps, curvilinear_projection, ttc_and_thw])
stands = np.full(80, 60.0), np.zeros(80)
scenes = {'runs into a standing car': (driven(np.full(80, 20.0)), stands),
          'stops behind a standing car': (driven(np.clip(20.0 - 8.0 * (time - 1.4), 0.0, 20.0)), stands),
          'closes in on a slower car': (driven(np.full(80, 20.0)), (30.0 + 15.0 * time, np.full(80, 15.0)))}
found = {}
for name, (ego, other) in scenes.items():
    recording = omega_prime.Recording(df=pd.DataFrame(recorded(0, *ego) + recorded(1, *other)), validate=False)
    table = metrics.compute(recording, ego_id=0)[1]['ttc_and_thw'].to_pandas().dropna(subset='TTC').sort_values('total_nanos_ego')
    gap, closing = other[0] - ego[0] - LENGTH, ego[1] - other[1]
    close = (gap > 0.0) & (closing > 0.0)
    ttc = gap[close] / closing[close]
    said = 'no TTC at all' if table.empty else (f'TTC from {table.total_nanos_ego.iloc[0] / 1e9:.1f} s on, the first {table.TTC.iloc[0]:.2f} s')
    touched = time[np.flatnonzero(gap <= 0.0)[:1]]
    print(f'{name}: {said}; between the bodies {ttc[0]:.2f} s at the start, {ttc.min():.2f} s at least, '
          + (f'contact at {touched[0]:.1f} s' if len(touched) else f'{gap.min():.1f} m left'))
    found[name] = table, ttc, touched
table, ttc, touched = found['stops behind a standing car']
ok = table.empty and ttc.min() < 0.8 and not len(touched)
table, ttc, touched = found['runs into a standing car']
ok = ok and table.total_nanos_ego.iloc[0] / 1e9 >= touched[0] - 1e-6 and ttc[0] > 2.7
table, ttc, touched = found['closes in on a slower car']
ok = ok and not table.empty and abs(table.TTC.iloc[0] - (30.0 - 5.0 * table.total_nanos_ego.iloc[0] / 1e9) / 5.0) < 0.01
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
