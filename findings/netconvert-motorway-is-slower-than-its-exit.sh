#!/usr/bin/env bash
# SUMO's netconvert: speed limits that OpenDRIVE gives with a road's type are not read; a motorway is slower than its exit.
#
# Expected: a road whose type has a maximum of 130 km/h (or of 20 mph) has that limit in SUMO, as it has in other readers
# of the format; a limit that a lane gives itself goes before it.
# What happens: only limits given by lanes are read (right, in all units). Where the type of the road gives the limit, all
# driving lanes get 50 km/h and the lanes of an exit 80 km/h, from a table of kinds of lanes, whatever the file
# says. There is no warning. roadgen reads the same files right.
# Why it matters: the type is where most maps give the limit (lanes only what differs from it). Traffic on an imported
# motorway drives at 50 km/h, that of a 20 mph zone too; flows, gaps and what is calibrated on them are those of other roads.
#
# Output seen:
#   eclipse-sumo 1.28.0
#   roadgen 0.41.2
#   motorway, 130 km/h by its type: netconvert 50 km/h, roadgen 130 km/h
#   its exit, 80 km/h by its type: netconvert 80 km/h, roadgen 80 km/h
#   its exit, 40 km/h by its type: netconvert 80 km/h, roadgen 40 km/h
#   street, 20 mph by its type: netconvert 50 km/h, roadgen 32 km/h
#   motorway, 130 km/h by its lane: netconvert 130 km/h, roadgen 130 km/h
#   street, 20 mph by its lane: netconvert 32 km/h, roadgen 32 km/h
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


def read(kind, limit, lane='driving', by_lane=False):
    """The limits, in km/h, of a straight road of one lane as netconvert and as roadgen read it."""
    speed = '<speed max="{}" unit="{}"/>'.format(*limit)
    Path('road.xodr').write_text(f'''<?xml version="1.0" encoding="UTF-8"?>
<OpenDRIVE><header revMajor="1" revMinor="6" name="" version="1.00" north="0" south="-4" east="100" west="0"/>
<road name="" length="100" id="1" junction="-1" rule="RHT"><type s="0" type="{kind}">{'' if by_lane else speed}</type>
<planView><geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView>
<lanes><laneSection s="0"><center><lane id="0" type="none" level="false"/></center><right><lane id="-1" type="{lane}" level="false">
<width sOffset="0" a="3.5" b="0" c="0" d="0"/>{speed.replace('<speed', '<speed sOffset="0"') if by_lane else ''}</lane></right></laneSection></lanes></road></OpenDRIVE>''')
    subprocess.run([str(Path(sys.executable).with_name('netconvert')), '--opendrive', 'road.xodr', '-o', 'road.net.xml'],
                   check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    sumo = [float(lane.get('speed')) * 3.6 for edge in ET.parse('road.net.xml').iter('edge') if not edge.get('function')
            for lane in edge.iter('lane')]
    roadgen.read_opendrive('road.xodr').export_lanelet2('road.osm')
    other = [tag.get('v') for relation in ET.parse('road.osm').iter('relation') for tag in relation.iter('tag')
             if tag.get('k') == 'speed_limit']
    return sumo[0], float(other[0])


ok = True
for name, true, seen, how in (
        ('motorway, 130 km/h by its type', 130.0, 50.0, dict(kind='motorway', limit=(130, 'km/h'))),
        ('its exit, 80 km/h by its type', 80.0, 80.0, dict(kind='motorway', limit=(80, 'km/h'), lane='exit')),
        ('its exit, 40 km/h by its type', 40.0, 80.0, dict(kind='motorway', limit=(40, 'km/h'), lane='exit')),
        ('street, 20 mph by its type', 32.2, 50.0, dict(kind='town', limit=(20, 'mph'))),
        ('motorway, 130 km/h by its lane', 130.0, 130.0, dict(kind='motorway', limit=(130, 'km/h'), by_lane=True)),
        ('street, 20 mph by its lane', 32.2, 32.2, dict(kind='town', limit=(20, 'mph'), by_lane=True))):
    sumo, other = read(**how)
    print(f'{name}: netconvert {sumo:.0f} km/h, roadgen {other:.0f} km/h')
    ok = ok and abs(sumo - seen) < 0.5 and abs(other - true) < 0.5
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
