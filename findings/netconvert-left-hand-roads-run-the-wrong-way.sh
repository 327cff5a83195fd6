#!/usr/bin/env bash
# SUMO's netconvert: OpenDRIVE roads with left-hand traffic run the wrong way; with --lefthand they lie where there is no road.
#
# Expected: the attribute rule="LHT" of an OpenDRIVE road turns round the directions of its lanes: those left of the
# reference line run along it, those right of it against it, all where they are. With one lane left and two right of a
# line to the east, one runs east at y = 1.75 m, two run west at -1.75 and -5.25 m.
# What happens: the attribute is not read. By default two lanes run east and one west, each against its traffic. With
# --lefthand the whole road is mirrored at its reference line: two lanes run east, the outer one at y = 5.25 m, where
# the file has no road, and one west at -1.75 m. No warning in either case. roadgen reads the file right.
# Why it matters: maps of British, Japanese, Indian or Australian roads. By default every vehicle of the simulation is a
# wrong-way driver on the map that planners and pictures use, and with the option meant for it lanes and lane counts are wrong.
#
# Output seen:
#   eclipse-sumo 1.28.0
#   roadgen 0.41.2
#   RHT, netconvert: east at -5.25 m, east at -1.75 m, west at +1.75 m
#   RHT, roadgen: east at -5.25 m, east at -1.75 m, west at +1.75 m
#   LHT, netconvert: east at -5.25 m, east at -1.75 m, west at +1.75 m
#   LHT, netconvert --lefthand: east at +1.75 m, east at +5.25 m, west at -1.75 m
#   LHT, roadgen: east at +1.75 m, west at -5.25 m, west at -1.75 m
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps eclipse-sumo==1.28.0 sumo-data==1.28.0 roadgen==0.41.2
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import subprocess
import sys
import xml.etree.ElementTree as ET
from importlib.metadata import version
from pathlib import Path

import roadgen

print('eclipse-sumo', version('eclipse-sumo'))
print('roadgen', version('roadgen'))
WIDTH = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'


def road(rule):
    lane = f'<lane id="%d" type="driving" level="false">{WIDTH}</lane>'
    return f'''<?xml version="1.0" encoding="UTF-8"?>
<OpenDRIVE><header revMajor="1" revMinor="6" name="" version="1.00" north="4" south="-7" east="100" west="0"/>
<road name="" length="100" id="1" junction="-1" rule="{rule}">
<planView><geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView>
<lanes><laneSection s="0"><left>{lane % 1}</left><center><lane id="0" type="none" level="false"/></center>
<right>{lane % -1}{lane % -2}</right></laneSection></lanes></road></OpenDRIVE>'''


def by_netconvert(*options):
    subprocess.run([str(Path(sys.executable).with_name('netconvert')), '--opendrive', 'road.xodr', '-o', 'road.net.xml', '--no-turnarounds',
                    '--offset.disable-normalization', *options], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    shapes = [[tuple(map(float, point.split(','))) for point in lane.get('shape').split()]
              for edge in ET.parse('road.net.xml').iter('edge') if not edge.get('function') for lane in edge.iter('lane')]
    return sorted(('east' if shape[-1][0] > shape[0][0] else 'west', shape[0][1]) for shape in shapes)


def by_roadgen():
    """A lanelet runs so that its left bound is at its left."""
    roadgen.read_opendrive('road.xodr').export_lanelet2('road.osm')
    tree = ET.parse('road.osm').getroot()
    across = {node.get('id'): float(tag.get('v')) for node in tree.iter('node') for tag in node.iter('tag') if tag.get('k') == 'local_y'}
    first = {way.get('id'): across[way.find('nd').get('ref')] for way in tree.iter('way')}
    bounds = [{member.get('role'): first[member.get('ref')] for member in relation.iter('member') if member.get('ref') in first}
              for relation in tree.iter('relation')]
    return sorted(('east' if bound['left'] > bound['right'] else 'west', (bound['left'] + bound['right']) / 2) for bound in bounds)


found = {}
for rule in ('RHT', 'LHT'):
    Path('road.xodr').write_text(road(rule))
    for name, lanes in (('netconvert', by_netconvert()), ('netconvert --lefthand', by_netconvert('--lefthand')), ('roadgen', by_roadgen())):
        if rule == 'LHT' or name != 'netconvert --lefthand':
            print(f'{rule}, {name}: ' + ', '.join(f'{way} at {y:+.2f} m' for way, y in lanes))
        found[rule, name] = lanes
right, left = [('east', -5.25), ('east', -1.75), ('west', 1.75)], [('east', 1.75), ('west', -5.25), ('west', -1.75)]
mirrored = [('east', 1.75), ('east', 5.25), ('west', -1.75)]
ok = found['RHT', 'netconvert'] == found['RHT', 'roadgen'] == right and found['LHT', 'roadgen'] == left
ok = ok and found['LHT', 'netconvert'] == right and found['LHT', 'netconvert --lefthand'] == mirrored
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
