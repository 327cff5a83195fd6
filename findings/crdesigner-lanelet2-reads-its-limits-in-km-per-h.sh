#!/usr/bin/env bash
# CommonRoad scenario designer with Lanelet2: a limit of 30 km/h becomes 8.3 km/h, and a road in UTM coordinates is a quarter shorter and narrower.
#
# Expected: a CommonRoad map, whose limits are in m/s, written by commonroad_to_lanelet and read by Lanelet2, whose limits without a unit are
# in km/h, has the same limits, lengths and widths.
# What happens: the number is written as it is, so that 30, 50 and 100 km/h are 8.3, 13.9 and 27.8 km/h for Lanelet2's rules; the designer itself
# reads its file back as m/s, and notices nothing. Positions are taken for those of Web Mercator if the file has no geo
# transformation, also where it says its latitude: at a northing of 5335 km a road of 100 m is 73 m long and 2.55 m wide instead of 3.50,
# and lies in the south of France instead of Munich. With a geo transformation it is right.
# Why it matters: travel times grow by 3.6 and routes avoid roads with a sign; lorries do not fit into lanes of 2.55 m.
#
# Output seen:
#   commonroad-scenario-designer 0.8.5
#   commonroad-io 2024.3
#   lanelet2 1.2.3
#   no sign: 50.0 km/h for Lanelet2 (the urban default, so the unit is km/h)
#   sign of 30 km/h (8.33 m/s): 8.3 km/h for Lanelet2, 8.33 m/s read back by the designer
#   sign of 50 km/h (13.89 m/s): 13.9 km/h for Lanelet2, 13.89 m/s read back by the designer
#   sign of 100 km/h (27.78 m/s): 27.8 km/h for Lanelet2, 27.78 m/s read back by the designer
#   road of 100 m by 3.50 m at the origin: 100.1 m by 3.48 m at latitude 0.00
#   road of 100 m by 3.50 m in UTM coordinates: 73.1 m by 2.55 m at latitude 43.15
#   road of 100 m by 3.50 m in UTM coordinates, with latitude and longitude: 73.1 m by 2.55 m at latitude 43.15
#   road of 100 m by 3.50 m in UTM coordinates, with geo transformation: 100.0 m by 3.50 m at latitude 48.14
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps PyQt6==6.11.0 PyQt6_sip==13.13.0 PyYAML==6.0.4 antlr4-python3-runtime==4.9.3 certifi==2026.10.19.post1 charset-normalizer==3.5.3 commonroad-clcs==2025.2.0 commonroad-io==2024.3 commonroad-scenario-designer==0.8.5 commonroad-sumo==2025.1.4 commonroad-vehicle-models==3.0.2 cycler==0.12.1 fonttools==4.68.0 idna==3.20 iso3166==2.1.1 kdtree==0.16 lanelet2==1.2.3 kiwisolver==1.5.1 libsumo==1.28.0 lxml==6.1.3 matplotlib==3.11.2 mgrs==1.6.0 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 ordered-set==4.1.0 osqp==0.6.7.post3 packaging==26.4 pandas==2.3.3 pillow==13.0.0 protobuf==3.20.2 pyclothoids==0.1.5 pymetis==2025.2.2 pyparsing==3.3.3 pyproj==3.7.2 python-dateutil==4.0.0 pytz==2026.6 qdldl==0.1.9.post1 requests==2.34.2 rich==15.0.0 scipy==1.17.1 shapely==2.2.0 similaritymeasures==1.5.0 sumolib==1.28.0 tqdm==4.70.1 traci==1.28.0 typing_extensions==4.16.0 urllib3==2.8.0 PyQt6-Qt6==6.11.2 commonroad-drivability-checker==2025.4.0 Polygon3==3.0.9.1 mercantile==1.2.1 PyGeodesy==23.12.29 rtree==1.4.1 six==1.17.0 utm==0.7.0 click==8.5.1 sumo-data==1.28.0 contourpy==1.3.3
cd "$dir"
QT_QPA_PLATFORM=offscreen "$dir/venv/bin/python" -W ignore - <<'PY'
import logging
import xml.etree.ElementTree as ET
from contextlib import redirect_stdout
from importlib.metadata import version
from io import StringIO
from pathlib import Path

import lanelet2
import numpy as np
from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile
from commonroad.planning.planning_problem import PlanningProblemSet
from commonroad.scenario.lanelet import Lanelet, LaneletType
from commonroad.scenario.scenario import GeoTransformation, Location, Scenario, ScenarioID, Tag
from commonroad.scenario.traffic_sign import TrafficSign, TrafficSignElement, TrafficSignIDGermany
from crdesigner.map_conversion.map_conversion_interface import commonroad_to_lanelet, lanelet_to_commonroad

for name in ('commonroad-scenario-designer', 'commonroad-io', 'lanelet2'):
    print(name, version(name))
logging.disable(logging.CRITICAL)
UTM, MUNICH = (690000.0, 5335000.0), {'geo_name_id': 2867714, 'gps_latitude': 48.14, 'gps_longitude': 11.55}
RULES = lanelet2.traffic_rules.create(lanelet2.traffic_rules.Locations.Germany, lanelet2.traffic_rules.Participants.Vehicle)


def through(limit=None, at=(0.0, 0.0), location=None):
    """Length, width and limit for Lanelet2, latitude, and limit for the designer, of a road of 100 m by 3.5 m with a limit in m/s."""
    scenario, x = Scenario(0.1, ScenarioID.from_benchmark_id('DEU_Road-1_1_T-1', '2020a')), np.linspace(0.0, 100.0, 21)
    right, centre, left = (np.column_stack([x, np.full(21, y)]) + at for y in (-1.75, 0.0, 1.75))
    scenario.add_objects(Lanelet(left, centre, right, 1, lanelet_type={LaneletType.URBAN}))
    if limit is not None:
        element = TrafficSignElement(TrafficSignIDGermany.MAX_SPEED, [f'{limit:.6f}'])
        scenario.add_objects(TrafficSign(50, [element], {1}, np.array(at) + [0.0, -3.0]), {1})
    with redirect_stdout(StringIO()):
        writer = CommonRoadFileWriter(scenario, PlanningProblemSet(), 'author', 'affiliation', 'source', {Tag.URBAN}, location, decimal_precision=10)
        writer.write_to_file('road.xml', OverwriteExistingFile.ALWAYS)
        commonroad_to_lanelet(Path('road.xml'), 'road.osm')
        back = lanelet_to_commonroad('road.osm').lanelet_network.traffic_signs
    node = next(ET.parse('road.osm').iter('node'))
    latitude, longitude = float(node.get('lat')), float(node.get('lon'))
    read = next(iter(lanelet2.io.load('road.osm', lanelet2.projection.UtmProjector(lanelet2.io.Origin(latitude, longitude))).laneletLayer))
    width = lanelet2.geometry.distance(lanelet2.geometry.to2D(read.leftBound[0]), lanelet2.geometry.to2D(read.rightBound[0]))
    again = float(back[0].traffic_sign_elements[0].additional_values[0]) if back else None
    return lanelet2.geometry.length2d(read), width, RULES.speedLimit(read).speedLimit, latitude, again


ok = True
length, width, urban, _, _ = through()
print(f'no sign: {urban:.1f} km/h for Lanelet2 (the urban default, so the unit is km/h)')
ok = ok and urban == 50.0
for kmh in (30.0, 50.0, 100.0):
    _, _, limit, _, again = through(kmh / 3.6)
    print(f'sign of {kmh:.0f} km/h ({kmh / 3.6:.2f} m/s): {limit:.1f} km/h for Lanelet2, {again:.2f} m/s read back by the designer')
    ok = ok and abs(limit - kmh / 3.6) < 0.01 and abs(again - kmh / 3.6) < 0.01
CASES = {
    'at the origin': ((0.0, 0.0), None, 100.0), 'in UTM coordinates': (UTM, None, 73.1), 'in UTM coordinates, with latitude and longitude': (UTM, Location(**MUNICH), 73.1),
    'in UTM coordinates, with geo transformation': (UTM, Location(**MUNICH, geo_transformation=GeoTransformation('+proj=utm +zone=32 +ellps=WGS84')), 100.0)}
for name, (at, location, expected) in CASES.items():
    length, width, _, latitude, _ = through(at=at, location=location)
    print(f'road of 100 m by 3.50 m {name}: {length:.1f} m by {width:.2f} m at latitude {latitude:.2f}')
    ok = ok and abs(length - expected) < 0.3 and abs(width - 3.5 * expected / 100.0) < 0.03
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
