#!/usr/bin/env bash
# commonroad-scenario-designer with lanelet2: roads of left-hand traffic get their bounds exchanged, and in Lanelet2 they run the wrong way.
#
# Expected: of a straight OpenDRIVE road to the east with two lanes left of its line and one right of it, rule="LHT"
# turns the directions round: two lanes run east, one west. As a CommonRoad scenario every lanelet has its left bound at
# the left of its direction, and written as a Lanelet2 map it runs as it did.
# What happens: the lanelets' centre lines run the right way, but left_vertices lie at the right of them and
# right_vertices at the left: a lanelet's left neighbour (adj_left is right) lies behind its right bound. In a Lanelet2 map
# the sides of the bounds give the direction: lanelet2 reads the designer's own export of the LHT road as that of the RHT
# road, all lanes against their traffic, and so does the designer on its own way back. Nothing is said.
# Why it matters: maps of left-hand countries on the way OpenDRIVE, CommonRoad, Lanelet2. What uses centre lines is right, what uses
# bounds (offset to the left, left lane change, road boundary) is mirrored, and the planner that reads Lanelet2 drives head on.
#
# Output seen:
#   commonroad-scenario-designer 0.8.5
#   commonroad-io 2024.3
#   lanelet2 1.2.3
#   RHT, CommonRoad: east at -1.75 m (left bound at its left), west at +1.75 m (left bound at its left), west at +5.25 m (left bound at its left)
#   RHT, then Lanelet2 read by lanelet2: east at -1.75 m, west at +1.75 m, west at +5.25 m
#   RHT, and back by the designer: east at -1.75 m, west at +1.75 m, west at +5.25 m
#   LHT, CommonRoad: west at -1.75 m (left bound at its right), east at +1.75 m (left bound at its right), east at +5.25 m (left bound at its right)
#   LHT, then Lanelet2 read by lanelet2: east at -1.75 m, west at +1.75 m, west at +5.25 m
#   LHT, and back by the designer: east at -1.75 m, west at +1.75 m, west at +5.25 m
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps PyQt6==6.11.0 PyQt6_sip==13.13.0 PyYAML==6.0.4 antlr4-python3-runtime==4.9.3 certifi==2026.10.19.post1 charset-normalizer==3.5.3 commonroad-clcs==2025.2.0 commonroad-io==2024.3 commonroad-scenario-designer==0.8.5 commonroad-sumo==2025.1.4 commonroad-vehicle-models==3.0.2 cycler==0.12.1 fonttools==4.68.0 idna==3.20 iso3166==2.1.1 kdtree==0.16 kiwisolver==1.5.1 libsumo==1.28.0 lxml==6.1.3 matplotlib==3.11.2 mgrs==1.6.0 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 ordered-set==4.1.0 osqp==0.6.7.post3 packaging==26.4 pandas==2.3.3 pillow==13.0.0 protobuf==3.20.2 pyclothoids==0.1.5 pymetis==2025.2.2 pyparsing==3.3.3 pyproj==3.7.2 python-dateutil==4.0.0 pytz==2026.6 pyxodr==0.1.3 qdldl==0.1.9.post1 requests==2.34.2 rich==15.0.0 scipy==1.17.1 shapely==2.2.0 similaritymeasures==1.5.0 sumolib==1.28.0 tqdm==4.70.1 traci==1.28.0 typing_extensions==4.16.0 urllib3==2.8.0 PyQt6-Qt6==6.11.2 commonroad-drivability-checker==2025.4.0 Polygon3==3.0.9.1 mercantile==1.2.1 PyGeodesy==23.12.29 rtree==1.4.1 six==1.17.0 utm==0.7.0 click==8.5.1 sumo-data==1.28.0 contourpy==1.3.3 lanelet2==1.2.3
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { grep -v nanobind errors | tail -3 >&2; exit 1; }
from importlib.metadata import version
from pathlib import Path

import lanelet2
from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile
from commonroad.planning.planning_problem import PlanningProblemSet
from crdesigner.map_conversion.map_conversion_interface import (
    commonroad_to_lanelet,
    lanelet_to_commonroad,
    opendrive_to_commonroad,
)
from lanelet2.projection import UtmProjector

for name in ('commonroad-scenario-designer', 'commonroad-io', 'lanelet2'):
    print(name, version(name))


def road(rule):
    lanes = {lane: f'<lane id="{lane}" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>' for lane in (2, 1, -1)}
    return f'''<?xml version="1.0" encoding="UTF-8"?>
<OpenDRIVE><header revMajor="1" revMinor="6" name="" version="1.00" north="7" south="-4" east="100" west="0"/>
<road name="" length="100" id="1" junction="-1" rule="{rule}">
<planView><geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView><elevationProfile/><lateralProfile/>
<lanes><laneSection s="0"><left>{lanes[2]}{lanes[1]}</left><center><lane id="0" type="none" level="false"/></center>
<right>{lanes[-1]}</right></laneSection></lanes></road></OpenDRIVE>'''


def way(start, end):
    return 'east' if end > start else 'west'


def of_scenario(scenario):
    """Where each lanelet runs, at which y, and on which side of it its left bound is."""
    rows = []
    for lane in scenario.lanelet_network.lanelets:
        centre = lane.center_vertices
        ahead, beside = centre[-1] - centre[0], lane.left_vertices[0] - centre[0]
        side = 'left' if ahead[0] * beside[1] - ahead[1] * beside[0] > 0 else 'right'
        rows.append((round(float(centre[0][1]), 2), way(centre[0][0], centre[-1][0]), side))
    return sorted(rows)


def of_lanelet2(path):
    world = lanelet2.io.load(path, UtmProjector(lanelet2.io.Origin(0, 0)))
    return sorted((round((lane.centerline[0].y) / 1.75) * 1.75, way(lane.centerline[0].x, lane.centerline[len(lane.centerline) - 1].x))
                  for lane in world.laneletLayer)


found = {}
for rule in ('RHT', 'LHT'):
    Path('road.xml').unlink(missing_ok=True)
    Path('road.xodr').write_text(road(rule))
    scenario = opendrive_to_commonroad(Path('road.xodr'))
    CommonRoadFileWriter(scenario, PlanningProblemSet(), '', '', '', set()).write_to_file('road.xml', OverwriteExistingFile.ALWAYS)
    commonroad_to_lanelet('road.xml', 'road.osm')
    found[rule] = of_scenario(scenario), of_lanelet2('road.osm'), of_scenario(lanelet_to_commonroad('road.osm'))
    made, read, back = found[rule]
    print(f'{rule}, CommonRoad: ' + ', '.join(f'{to} at {y:+.2f} m (left bound at its {side})' for y, to, side in made))
    print(f'{rule}, then Lanelet2 read by lanelet2: ' + ', '.join(f'{to} at {y:+.2f} m' for y, to in read))
    print(f'{rule}, and back by the designer: ' + ', '.join(f'{to} at {y:+.2f} m' for y, to, _ in back))
AT = (-1.75, 1.75, 5.25)
right, left = list(zip(AT, ('east', 'west', 'west'))), list(zip(AT, ('west', 'east', 'east')))
ok = found['RHT'][0] == [(*row, 'left') for row in right] and found['LHT'][0] == [(*row, 'right') for row in left]
ok = ok and found['RHT'][1] == found['LHT'][1] == right
ok = ok and all([(row[0], row[1]) for row in found[rule][2]] == right for rule in found)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
