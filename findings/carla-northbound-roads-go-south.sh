#!/usr/bin/env bash
# CARLA: an OpenDRIVE road that goes north goes south on the globe, a German one in UTM coordinates lies in the Gulf of Guinea.
#
# Expected: Map.transform_to_geolocation gives the place that the map's geoReference, read by PROJ, gives for the OpenDRIVE coordinates. Loading
# turns y over (the simulator's frame is left-handed, a road north has a falling y), so the way to the globe has to turn it back.
# What happens: it does not: along a road from south to north the latitude falls. Eastwards it is right but for 2.3 m in a kilometre,
# as on a sphere. tmerc and lcc give the same numbers, so only lat_0 and lon_0 are read. A geoReference of UTM is not
# one: coordinates count from 42 N 2 E, which only a line on the console says.
# geolocation_to_transform is the exact inverse, so that there and back is right to the last digit.
# Why it matters: recorded positions of one map match a map service or another tool's map in a mirror only, and no round trip tells.
#
# Output seen:
#   carla 0.9.16, pyproj 3.7.2
#   tmerc, 1000 m to the north: -999.4 m north and -0.0 m east on the globe
#   tmerc, 1000 m to the east: -0.1 m north and +1002.3 m east on the globe
#   lcc, 1000 m to the east: +1002.3 m east; the same as tmerc: True
#   utm, at its origin: 42.000 N 2.000 E, at 49 N 8 E: -6.764 N 5.860 E
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps carla==0.9.16 certifi==2026.10.19.post1 pyproj==3.7.2
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import carla
import pyproj

print(f"carla {version('carla')}, pyproj {version('pyproj')}")
TMERC, LCC = '+proj=tmerc +lat_0=49 +lon_0=8 +k=1 +datum=WGS84', '+proj=lcc +lat_1=48 +lat_2=50 +lat_0=49 +lon_0=8 +datum=WGS84'
UTM = '+proj=utm +zone=32 +datum=WGS84'
LANES = ''.join(f'<{side}><lane id="{number}" type="{kind}" level="false">{width}</lane></{side}>' for side, number, kind, width in (
    ('center', 0, 'none', ''), ('right', -1, 'driving', '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>')))


def road(projection, x, y, heading):
    """A straight road of a little over 1000 m."""
    return carla.Map('road', f'''<?xml version="1.0"?><OpenDRIVE><header revMajor="1" revMinor="4" name="" version="1">
<geoReference><![CDATA[{projection}]]></geoReference></header><road name="" length="1010" id="1" junction="-1"><link/><planView>
<geometry s="0" x="{x}" y="{y}" hdg="{heading}" length="1010"><line/></geometry></planView><elevationProfile/><lateralProfile/>
<lanes><laneSection s="0">{LANES}</laneSection></lanes></road></OpenDRIVE>''')


def ends(projection, x, y, heading):
    """Steps in metres, northwards and eastwards, from the begin to the end of the lane, on the globe, and the begin's place."""
    world, geod, places = road(projection, x, y, heading), pyproj.Geod(ellps='WGS84'), []
    for along in (0.0, 1000.0):
        place = world.get_waypoint_xodr(1, -1, along).transform.location
        globe = world.transform_to_geolocation(place)
        back = world.geolocation_to_transform(globe)
        assert place.distance(back) < 0.1, (place, back)
        places.append((globe.latitude, globe.longitude))
    (lat, lon), (lat_end, lon_end) = places
    north = geod.inv(lon, lat, lon, lat_end)[2] * (1 if lat_end > lat else -1)
    east = geod.inv(lon, lat, lon_end, lat)[2] * (1 if lon_end > lon else -1)
    return north, east, lat, lon


north, east = ends(TMERC, 0.0, 0.0, 1.5707963267948966), ends(TMERC, 0.0, 0.0, 0.0)
print(f'tmerc, 1000 m to the north: {north[0]:+.1f} m north and {north[1]:+.1f} m east on the globe')
print(f'tmerc, 1000 m to the east: {east[0]:+.1f} m north and {east[1]:+.1f} m east on the globe')
conic = ends(LCC, 0.0, 0.0, 0.0)
print(f'lcc, 1000 m to the east: {conic[1]:+.1f} m east; the same as tmerc: {conic == east}')
x, y = pyproj.Proj(UTM)(8.0, 49.0)
utm = ends(UTM, 0.0, 0.0, 0.0), ends(UTM, x, y, 0.0)
print('utm, at its origin: {2:.3f} N {3:.3f} E'.format(*utm[0]) + ', at 49 N 8 E: {2:.3f} N {3:.3f} E'.format(*utm[1]))
ok = -1001.0 < north[0] < -998.0 and 1001.5 < east[1] < 1003.5 and conic == east
ok = ok and abs(utm[0][2] - 42.0) < 0.01 and abs(utm[0][3] - 2.0) < 0.01 and abs(utm[1][2] - 49.0) > 10.0
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
