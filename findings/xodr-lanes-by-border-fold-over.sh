#!/usr/bin/env bash
# OpenDRIVE lanes given by their borders: four readers, three roads, and only roadgen's is the one in the file.
#
# Expected: a <border> is the lateral position t of a lane's outer edge, positive left of the reference line, negative
# right of it. Borders at 6 and 3 m, -3 and -6 m are two lanes of 3 m on either side: centres at +4.5, +1.5, -1.5, -4.5 m.
# What happens: commonroad-scenario-designer and pyxodr take the border for a width to be counted from the line towards
# the lane's own side, so -3 m at the right is 3 m to the left: both right lanes lie upon the left ones, with traffic
# of both directions on the same strip and no road at the right. netconvert does not read borders: all lanes get its
# default of 3.65 m. Nothing is said by any of the three. roadgen reads the file right.
# Why it matters: borders are the form for measured roads. Two independent readers agree on the wrong road, so comparing them
# shows nothing, and in the CommonRoad scenario oncoming vehicles in their own lanes collide head on.
#
# Output seen:
#   commonroad-scenario-designer 0.8.5
#   pyxodr 0.1.3
#   eclipse-sumo 1.28.0
#   roadgen 0.41.2
#   lanes by width, scenario designer: centres at +4.50, +1.50, -1.50, -4.50 m
#   lanes by width, pyxodr: centres at +4.50, +1.50, -1.50, -4.50 m
#   lanes by width, netconvert: centres at +4.50, +1.50, -1.50, -4.50 m
#   lanes by width, roadgen: centres at +4.50, +1.50, -1.50, -4.50 m
#   lanes by border, scenario designer: centres at +4.50, +4.50, +1.50, +1.50 m
#   lanes by border, pyxodr: centres at +4.50, +4.50, +1.50, +1.50 m
#   lanes by border, netconvert: centres at +5.47, +1.82, -1.82, -5.47 m
#   lanes by border, roadgen: centres at +4.50, +1.50, -1.50, -4.50 m
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps PyQt6==6.11.0 PyQt6_sip==13.13.0 PyYAML==6.0.4 antlr4-python3-runtime==4.9.3 certifi==2026.10.19.post1 charset-normalizer==3.5.3 commonroad-clcs==2025.2.0 commonroad-io==2024.3 commonroad-scenario-designer==0.8.5 commonroad-sumo==2025.1.4 commonroad-vehicle-models==3.0.2 cycler==0.12.1 fonttools==4.68.0 idna==3.20 iso3166==2.1.1 kdtree==0.16 kiwisolver==1.5.1 libsumo==1.28.0 lxml==6.1.3 matplotlib==3.11.2 mgrs==1.6.0 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 ordered-set==4.1.0 osqp==0.6.7.post3 packaging==26.4 pandas==2.3.3 pillow==13.0.0 protobuf==3.20.2 pyclothoids==0.1.5 pymetis==2025.2.2 pyparsing==3.3.3 pyproj==3.7.2 python-dateutil==4.0.0 pytz==2026.6 pyxodr==0.1.3 qdldl==0.1.9.post1 requests==2.34.2 rich==15.0.0 scipy==1.17.1 shapely==2.2.0 similaritymeasures==1.5.0 sumolib==1.28.0 tqdm==4.70.1 traci==1.28.0 typing_extensions==4.16.0 urllib3==2.8.0 PyQt6-Qt6==6.11.2 commonroad-drivability-checker==2025.4.0 Polygon3==3.0.9.1 mercantile==1.2.1 PyGeodesy==23.12.29 rtree==1.4.1 six==1.17.0 utm==0.7.0 click==8.5.1 sumo-data==1.28.0 contourpy==1.3.3 roadgen==0.41.2 eclipse-sumo==1.28.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { grep -v nanobind errors | tail -3 >&2; exit 1; }
import subprocess
import sys
import xml.etree.ElementTree as ET
from importlib.metadata import version
from pathlib import Path

import roadgen
from crdesigner.map_conversion.map_conversion_interface import opendrive_to_commonroad
from pyxodr.road_objects.network import RoadNetwork

for name in ('commonroad-scenario-designer', 'pyxodr', 'eclipse-sumo', 'roadgen'):
    print(name, version(name))


def road(form):
    """Lanes 2, 1, -1, -2 of 3 m each on a straight road to the east."""
    lanes = {lane: f'<lane id="{lane}" type="driving" level="false">'
                   f'<{form} sOffset="0" a="{3 * lane if form == "border" else 3}" b="0" c="0" d="0"/></lane>' for lane in (2, 1, -1, -2)}
    return f'''<?xml version="1.0" encoding="UTF-8"?>
<OpenDRIVE><header revMajor="1" revMinor="6" name="" version="1.00" north="6" south="-6" east="100" west="0"/>
<road name="" length="100" id="1" junction="-1" rule="RHT">
<planView><geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView><elevationProfile/><lateralProfile/>
<lanes><laneSection s="0"><left>{lanes[2]}{lanes[1]}</left><center><lane id="0" type="none" level="false"/></center>
<right>{lanes[-1]}{lanes[-2]}</right></laneSection></lanes></road></OpenDRIVE>'''


def by_designer():
    return [lane.center_vertices[0][1] for lane in opendrive_to_commonroad(Path('road.xodr')).lanelet_network.lanelets]


def by_pyxodr():
    return [lane.centre_line[0][1] for road in RoadNetwork('road.xodr').get_roads() for section in road.lane_sections for lane in section.lanes]


def by_netconvert():
    subprocess.run([str(Path(sys.executable).with_name('netconvert')), '--opendrive', 'road.xodr', '-o', 'road.net.xml', '--no-turnarounds',
                    '--offset.disable-normalization'], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return [float(lane.get('shape').split()[0].split(',')[1]) for edge in ET.parse('road.net.xml').iter('edge')
            if not edge.get('function') for lane in edge.iter('lane')]


def by_roadgen():
    roadgen.read_opendrive('road.xodr').export_lanelet2('road.osm')
    tree = ET.parse('road.osm').getroot()
    across = {node.get('id'): float(tag.get('v')) for node in tree.iter('node') for tag in node.iter('tag') if tag.get('k') == 'local_y'}
    first = {way.get('id'): across[way.find('nd').get('ref')] for way in tree.iter('way')}
    return [sum(first[member.get('ref')] for member in relation.iter('member') if member.get('role') in ('left', 'right')) / 2
            for relation in tree.iter('relation')]


READERS = {'scenario designer': by_designer, 'pyxodr': by_pyxodr, 'netconvert': by_netconvert, 'roadgen': by_roadgen}
found = {}
for form in ('width', 'border'):
    Path('road.xodr').write_text(road(form))
    for name, centres in READERS.items():
        found[form, name] = sorted((round(float(y), 2) for y in centres()), reverse=True)
        print(f'lanes by {form}, {name}: centres at ' + ', '.join(f'{y:+.2f}' for y in found[form, name]) + ' m')
right, folded = [4.5, 1.5, -1.5, -4.5], [4.5, 4.5, 1.5, 1.5]
ok = all(found['width', name] == right for name in READERS) and found['border', 'roadgen'] == right
ok = ok and found['border', 'scenario designer'] == found['border', 'pyxodr'] == folded
ok = ok and all(abs(a - b) < 0.03 for a, b in zip(found['border', 'netconvert'], (5.475, 1.825, -1.825, -5.475)))
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
