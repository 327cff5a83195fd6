#!/usr/bin/env bash
# irn-engine: in its OpenDRIVE file a road to the north goes east and one to the east goes north; a corner is a straight line.
#
# Expected: the compiler writes streets, each a line in UTM coordinates, as OpenDRIVE. There hdg is counted from east, counterclockwise, so a street
# to the north has 1.571; a line with a corner is two geometries; a pothole at s = 150 m is on the street, behind the corner.
# What happens: hdg is the bearing, from north, clockwise. Every street is mirrored at the diagonal about its own start, so that only those to the
# north-east and south-west are in their place, and streets no longer meet: one that begins where the one to the north ends is 141 m away
# from its end. Of a line only the first piece is used: an L of 100 m by 100 m is 200 m straight on. Potholes go with their street.
# Why it matters: the file is well-formed, and roads have their lengths, widths and starts, so that only a look at the map shows it.
#
# Output seen:
#   irn-engine 0.1.0
#   north: hdg 0.000, ends 100 m east and 0 m north of its start, in the table 0 m east and 100 m north: 141 m off
#   east: hdg 1.571, ends 0 m east and 100 m north of its start, in the table 100 m east and 0 m north: 141 m off
#   north-east: hdg 0.785, ends 100 m east and 100 m north of its start, in the table 100 m east and 100 m north: 0 m off
#   south-east: hdg 2.356, ends -100 m east and 100 m north of its start, in the table 100 m east and -100 m north: 283 m off
#   west: hdg 4.712, ends 0 m east and -100 m north of its start, in the table -100 m east and 0 m north: 141 m off
#   corner: hdg 0.000, ends 200 m east and 0 m north of its start, in the table 100 m east and 100 m north: 141 m off
#   pothole at s = 150 m of the corner: 150 m east and 0 m north, in the table 50 m east and 100 m north
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps PyYAML==6.0.4 certifi==2026.10.19.post1 geopandas==1.2.0 irn-engine==0.1.0 networkx==3.6.1 numpy==2.4.6 packaging==26.4 pandas==3.1.1 pyarrow==26.0.1 pyogrio==0.13.0 pyproj==3.7.2 python-dateutil==4.0.0 scipy==1.17.1 shapely==2.2.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import logging
import xml.etree.ElementTree as ET
from importlib.metadata import version
from math import cos, hypot, sin

import pandas as pd
from irn.m4_compiler.xodr_builder import OpenDriveBuilder
from shapely.geometry import LineString

logging.disable(logging.CRITICAL)
print('irn-engine', version('irn-engine'))
X, Y = 500000.0, 2000000.0
STREETS = {'north': [(0, 0), (0, 100)], 'east': [(0, 0), (100, 0)], 'north-east': [(0, 0), (100, 100)],
           'south-east': [(0, 0), (100, -100)], 'west': [(0, 0), (-100, 0)], 'corner': [(0, 0), (0, 100), (100, 100)]}
lines = {name: LineString([(X + x, Y + y) for x, y in points]) for name, points in STREETS.items()}
table = pd.DataFrame([{'edge_id': name, 'length_m': line.length, 'width_dir_m': 7.0, 'geometry_wkt': line.wkt}
                      for name, line in lines.items()])
potholes = pd.DataFrame([{'edge_id': 'corner', 's': 150.0, 't': 0.0, 'class_name': 'pothole'}])
roads = {road.get('name'): road for road in ET.parse(OpenDriveBuilder().build_xodr(table, potholes, 'network.xodr')).iter('road')}


def place(road, station):
    """Point of a road's reference line, from its start: all geometries of the file are lines."""
    for piece in road.iter('geometry'):
        begin, length = float(piece.get('s')), float(piece.get('length'))
        if station <= begin + length + 0.01:
            heading = float(piece.get('hdg'))
            return (float(piece.get('x')) - X + (station - begin) * cos(heading),
                    float(piece.get('y')) - Y + (station - begin) * sin(heading))
    raise ValueError('beyond the road')


off = {}
for name, line in lines.items():
    x, y = (value + 0.0 for value in map(round, place(roads[name], line.length)))
    east, north = STREETS[name][-1]
    off[name] = hypot(x - east, y - north)
    print(f'{name}: hdg {float(roads[name].find("planView/geometry").get("hdg")):.3f}, ends {x:.0f} m east and {y:.0f} m north of its start, '
          f'in the table {east} m east and {north} m north: {off[name]:.0f} m off')
(pothole,) = roads['corner'].iter('object')
x, y = place(roads['corner'], float(pothole.get('s')))
there = lines['corner'].interpolate(150.0)
print(f'pothole at s = 150 m of the corner: {x:.0f} m east and {y:.0f} m north, '
      f'in the table {there.x - X:.0f} m east and {there.y - Y:.0f} m north')
ok = off['north-east'] == 0.0 and all(distance > 140.0 for name, distance in off.items() if name != 'north-east')
ok = ok and len(list(roads['corner'].iter('geometry'))) == 1 and abs(x - 150.0) < 0.1 and abs(y) < 0.1
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
