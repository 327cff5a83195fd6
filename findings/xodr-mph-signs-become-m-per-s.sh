#!/usr/bin/env bash
# scenariogeneration with commonroad-scenario-designer: a speed sign of 35 mph becomes a
# limit of 35 m/s (78 mph); the same limit as a road type is right.
#
# Expected: OpenDRIVE signals carry value and unit; whichever way a limit is given,
# CommonRoad's limit is in m/s.
# What happens: for signals only km/h is converted; any other value is taken as m/s.
# <type><speed max="35" unit="mph"> on the same road gives 15.6 m/s. In km/h the
# two paths disagree as well: 120 km/h is 33.33 m/s as a sign and 33.24 m/s as a
# road type (factor 0.277), so a vehicle at the sign's limit violates the road's.
# Why it matters: US and UK maps are delivered in mph. A planner that reads its limit
# through TrafficSignInterpreter drives at more than twice the posted speed, and
# says that it keeps the limit.
#
# Output seen:
#   scenariogeneration 0.16.7
#   commonroad-scenario-designer 0.8.5
#   commonroad-io 2024.3
#   35 mph  as sign     : in the map 35.000, interpreter 35.0, true 15.646 m/s
#   35 mph  as road type: in the map 15.645, interpreter 15.645, true 15.646 m/s
#   120 km/h as sign     : in the map 33.333, interpreter 33.333333333333336, true 33.333 m/s
#   120 km/h as road type: in the map 33.240, interpreter 33.24, true 33.333 m/s
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-scenario-designer==0.8.5 scenariogeneration==0.16.7 commonroad-io==2024.3 numpy==2.4.6 shapely==2.2.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
for name in ['scenariogeneration', 'commonroad-scenario-designer', 'commonroad-io']:
    print(name, version(name))
import os
os.environ["QT_QPA_PLATFORM"] = "offscreen"
from pathlib import Path
from commonroad.scenario.traffic_sign import SupportedTrafficSignCountry
from commonroad.scenario.traffic_sign_interpreter import TrafficSignInterpreter
from crdesigner.map_conversion.map_conversion_interface import opendrive_to_commonroad
from scenariogeneration import xodr

def limit(way, value, unit):
    road = xodr.create_road([xodr.Line(100)], 0, 0, 1, lane_width=3.5)
    if unit == "mph":
        country, kind, reader = "USA", "R2-1", SupportedTrafficSignCountry.USA
    else:
        country, kind, reader = "DEU", "274", SupportedTrafficSignCountry.GERMANY
    if way == "sign":
        road.add_signal(xodr.Signal(s=40, t=-4, country=country, Type=kind, subtype="", value=value, unit=unit))
    else:
        road.add_type(xodr.RoadType.town, 0, country, value, unit)
        reader = SupportedTrafficSignCountry.ZAMUNDA
    drive = xodr.OpenDrive("road")
    drive.add_road(road)
    drive.adjust_roads_and_lanes()
    drive.write_xml("road.xodr")
    network = opendrive_to_commonroad(Path("road.xodr")).lanelet_network
    elements = [float(e.additional_values[0]) for s in network.traffic_signs for e in s.traffic_sign_elements]
    read = TrafficSignInterpreter(reader, network).speed_limit(frozenset([network.lanelets[0].lanelet_id]))
    return elements[0], read

found = {}
for value, unit, factor in ((35, "mph", 0.44704), (120, "km/h", 1 / 3.6)):
    for way in ("sign", "road type"):
        found[unit, way] = limit(way, value, unit)
        print(f"{value} {unit:4s} as {way:9s}: in the map {found[unit, way][0]:.3f}, interpreter {found[unit, way][1]}, true {value * factor:.3f} m/s")
assert found["mph", "sign"] == (35.0, 35.0)
assert abs(found["mph", "road type"][0] - 15.65) < 0.1
assert abs(found["km/h", "sign"][0] - 33.3333) < 1e-3 and abs(found["km/h", "road type"][0] - 33.24) < 1e-6
print("behaviour as stated")
PY
