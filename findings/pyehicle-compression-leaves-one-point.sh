#!/usr/bin/env bash
# pyehicle: the compression makes one point of a drive of 12 km, 1.5 km beside the road; at 10 Hz the sampling rate is 0.
#
# Expected: spatio_temporal_compress reduces the points and keeps the shape of a trajectory; its page counts on 200 points of 1000 with
# the default radius of 100 m, and on 0.1 Hz instead of 1 Hz.
# What happens: a cluster grows from neighbour to neighbour without an end, so that fixes which are each less than 100 m from the next are all one
# cluster: at 20 m/s and 1 Hz a loop of 12 km is its centre, which no road comes near. A time window of 300 or of 2 s changes
# nothing, since it is asked of neighbours only; a radius of 10 m merges nothing. In between there is no compression.
# The sampling rate of a polars table is cut to whole seconds before the mean, that of the same table in pandas is not: 10 Hz are
# 0 s, a fix every 2.5 s is one every 2 s.
# Why it matters: it is the first step of the package's own chain before map matching, where the drive is then a single fix.
#
# Output seen:
#   pyehicle 0.1.0
#   pandas 3.1.1
#   polars 2.1.0
#   12 km in 600 fixes, radius 100 m (default): 1 points are left, up to 1500 m from the nearest fix
#   12 km in 600 fixes, and within 300 s: 1 points are left, up to 1500 m from the nearest fix
#   12 km in 600 fixes, and within 2 s: 1 points are left, up to 1500 m from the nearest fix
#   12 km in 600 fixes, radius 25 m: 1 points are left, up to 1500 m from the nearest fix
#   12 km in 600 fixes, radius 10 m: 600 points are left, up to 0 m from the nearest fix
#   a fix every 0.1 s: 0.1 s in pandas, 0.0 s in polars
#   a fix every 0.5 s: 0.5 s in pandas, 0.0 s in polars
#   a fix every 1.0 s: 1.0 s in pandas, 1.0 s in polars
#   a fix every 2.5 s: 2.5 s in pandas, 2.0 s in polars
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps branca==0.8.2 certifi==2026.10.19.post1 charset-normalizer==3.5.3 cloudpickle==3.1.3 contourpy==1.3.3 cycler==0.12.1 folium==0.20.0 fonttools==4.68.0 geopandas==1.2.0 idna==3.20 igraph==1.0.0 Jinja2==3.1.6 joblib==1.6.0 kiwisolver==1.5.1 leuvenmapmatching==1.1.4 llvmlite==0.50.0 MarkupSafe==3.0.4 matplotlib==3.8.4 narwhals==2.29.0 networkx==3.6.1 numba==0.68.1 numpy==2.4.6 osmium==4.3.2 osmnx==2.1.1 packaging==26.4 pandas==3.1.1 pillow==13.0.0 polars==2.1.0 polars-runtime-32==2.1.0 protobuf==7.36.2 pyehicle==0.1.0 pyogrio==0.13.0 pyparsing==3.3.3 pyproj==3.7.2 pyrosm==0.25.0 python-dateutil==4.0.0 python-rapidjson==1.25 requests==2.34.2 rtree==1.4.1 scikit-learn==1.9.1 scipy==1.17.1 shapely==2.2.0 texttable==1.7.2 threadpoolctl==3.8.0 tqdm==4.70.1 tzdata==2026.6 urllib3==2.8.0 xyzservices==2026.9.1 
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import numpy as np
import pandas as pd
import polars as pl
from pyehicle.preprocessing import get_sampling_rate, spatio_temporal_compress
from pyproj import Geod

for name in ('pyehicle', 'pandas', 'polars'):
    print(name, version(name))
EARTH, HOME, SIDE, SPEED = Geod(ellps='WGS84'), (11.0, 48.0), 3000.0, 20.0


def square(step):
    """Fixes of a car at 20 m/s once round a square of 3 km sides about a place, one every step seconds."""
    along = np.arange(0.0, 4.0 * SIDE, SPEED * step)
    corner, rest = np.divmod(along, SIDE)
    local = SIDE * np.array([-0.5 - 0.5j, 0.5 - 0.5j, 0.5 + 0.5j, -0.5 + 0.5j])[corner.astype(int)] + rest * 1j**corner
    longitude, latitude, _ = EARTH.fwd(np.full(len(along), HOME[0]), np.full(len(along), HOME[1]), np.degrees(np.angle(1j * local.conj())), np.abs(local))
    times = pd.Timestamp('2024-05-01 12:00:00') + pd.to_timedelta(np.round(step * np.arange(len(along)), 3), unit='s')
    return pd.DataFrame({'time': times, 'lat': latitude, 'lon': longitude})


def off(left, fixes):
    """Largest distance of a point that is left to the nearest fix, in metres."""
    return max(float(EARTH.inv(np.full(len(fixes), row.lon), np.full(len(fixes), row.lat), fixes.lon, fixes.lat)[2].min()) for row in left.itertuples())


fixes, ok = square(1.0), True
for name, given, number in (
    ('radius 100 m (default)', {}, 1), ('and within 300 s', {'time_threshold_s': 300}, 1), ('and within 2 s', {'time_threshold_s': 2}, 1),
    ('radius 25 m', {'spatial_radius_km': 0.025}, 1), ('radius 10 m', {'spatial_radius_km': 0.01}, len(fixes))):
    left = spatio_temporal_compress(fixes, **given)
    distance = off(left, fixes)
    print(f'12 km in {len(fixes)} fixes, {name}: {len(left)} points are left, up to {distance:.0f} m from the nearest fix')
    ok = ok and len(left) == number and (abs(distance - 1500.0) < 5.0 if number == 1 else distance < 0.1)
for step, seen in ((0.1, 0.0), (0.5, 0.0), (1.0, 1.0), (2.5, 2.0)):
    table = square(step)
    rates = get_sampling_rate(table), get_sampling_rate(pl.from_pandas(table))
    print(f'a fix every {step} s: {rates[0]} s in pandas, {rates[1]} s in polars')
    ok = ok and rates == (step, seen)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
