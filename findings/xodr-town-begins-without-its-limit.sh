#!/usr/bin/env bash
# OpenDRIVE speed limits that begin on the way: scenario designer and roadgen know the first only.
#
# Expected: a road of 200 m has 100 km/h, and from its middle on, where the town begins, 50 km/h; written as two <type>
# records of the road or as two <speed> records of its lane (both are lists by position) it is the same road.
# What happens: the scenario designer and roadgen make one lanelet of 200 m with 100 km/h of either. SUMO's netconvert splits
# the lane where the lane's records do. And a lane's limit of 20 m/s, the unit that the format takes where none is given,
# is no limit at all for the designer.
# Why it matters: a planner, a monitor of traffic rules or a simulation of drivers on these maps enters towns at 100 km/h; of the four
# ways through two readers and two forms none says that a limit was left out.
#
# Output seen:
#   commonroad-scenario-designer 0.8.5
#   roadgen 0.41.2
#   eclipse-sumo 1.28.0
#   by the road, scenario designer: 200 m of 100 km/h
#   by the road, roadgen: 200 m of 100 km/h
#   by the lane, scenario designer: 200 m of 100 km/h
#   by the lane, roadgen: 200 m of 100 km/h
#   by the lane, netconvert: 100 m of 100 km/h, then 100 m of 50 km/h
#   20 m/s by the lane, scenario designer: 200 m of no limit
#   20 m/s by the lane, roadgen: 200 m of 72 km/h
#   20 m/s by the lane, netconvert: 200 m of 72 km/h
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

for name in ('commonroad-scenario-designer', 'roadgen', 'eclipse-sumo'):
    print(name, version(name))


def road(types='', speeds=''):
    return f'''<?xml version="1.0" encoding="UTF-8"?>
<OpenDRIVE><header revMajor="1" revMinor="6" name="" version="1.00" north="0" south="-4" east="200" west="0"/>
<road name="" length="200" id="1" junction="-1" rule="RHT">{types}
<planView><geometry s="0" x="0" y="0" hdg="0" length="200"><line/></geometry></planView><elevationProfile/><lateralProfile/>
<lanes><laneSection s="0"><center><lane id="0" type="none" level="false"/></center><right><lane id="-1" type="driving" level="false">
<width sOffset="0" a="3.5" b="0" c="0" d="0"/>{speeds}</lane></right></laneSection></lanes></road></OpenDRIVE>'''


def by_designer():
    network = opendrive_to_commonroad(Path('road.xodr')).lanelet_network
    for lane in network.lanelets:
        signs = [element for sign in lane.traffic_signs for element in network.find_traffic_sign_by_id(sign).traffic_sign_elements]
        limits = [3.6 * float(sign.additional_values[0]) for sign in signs if sign.traffic_sign_element_id.name == 'MAX_SPEED']
        yield abs(lane.center_vertices[-1][0] - lane.center_vertices[0][0]), limits[0] if limits else None


def by_roadgen():
    roadgen.read_opendrive('road.xodr').export_lanelet2('road.osm')
    tree = ET.parse('road.osm').getroot()
    along = {node.get('id'): float(tag.get('v')) for node in tree.iter('node') for tag in node.iter('tag') if tag.get('k') == 'local_x'}
    ways = {way.get('id'): [along[nd.get('ref')] for nd in way.iter('nd')] for way in tree.iter('way')}
    for relation in tree.iter('relation'):
        tags = {tag.get('k'): tag.get('v') for tag in relation.iter('tag')}
        if tags.get('type') == 'lanelet':
            x = next(ways[member.get('ref')] for member in relation.iter('member') if member.get('role') == 'left')
            yield max(x) - min(x), float(tags['speed_limit']) if 'speed_limit' in tags else None


def by_netconvert():
    subprocess.run([str(Path(sys.executable).with_name('netconvert')), '--opendrive', 'road.xodr', '-o', 'road.net.xml', '--no-turnarounds'],
                   check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    for edge in ET.parse('road.net.xml').iter('edge'):
        if not edge.get('function'):
            yield from ((float(lane.get('length')), 3.6 * float(lane.get('speed'))) for lane in edge.iter('lane'))


FORMS = {'by the road': road(types='<type s="0" type="rural"><speed max="100" unit="km/h"/></type>'
                                   '<type s="100" type="town"><speed max="50" unit="km/h"/></type>'),
         'by the lane': road(speeds='<speed sOffset="0" max="100" unit="km/h"/><speed sOffset="100" max="50" unit="km/h"/>'),
         '20 m/s by the lane': road(speeds='<speed sOffset="0" max="20" unit="m/s"/>')}
found = {}
for form, text in FORMS.items():
    Path('road.xodr').write_text(text)
    readers = {'scenario designer': by_designer, 'roadgen': by_roadgen}
    if form != 'by the road':  # netconvert reads no limits of roads at all, which is another matter
        readers['netconvert'] = by_netconvert
    for name, reader in readers.items():
        parts = found[form, name] = [(round(length), limit if limit is None else round(limit)) for length, limit in reader()]
        print(f'{form}, {name}: ' + ', then '.join(f'{length} m of ' + ('no limit' if limit is None else f'{limit} km/h') for length, limit in parts))
ok = all(found[form, name] == [(200, 100)] for form in ('by the road', 'by the lane') for name in ('scenario designer', 'roadgen'))
ok = ok and found['by the lane', 'netconvert'] == [(100, 100), (100, 50)]
ok = ok and found['20 m/s by the lane', 'scenario designer'] == [(200, None)]
ok = ok and found['20 m/s by the lane', 'roadgen'] == found['20 m/s by the lane', 'netconvert'] == [(200, 72)]
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
