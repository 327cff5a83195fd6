#!/usr/bin/env bash
# ASAM's OpenDRIVE checker: a hole of 15 m within a road is "redundant geometry"; only between two roads it is an error.
#
# Expected: the checker's rule for gaps ("the transition between lane elements should be defined with no gaps") holds for the
# elements of a road's reference line as it does from road to road: a hole of 15 m, a step of 2 m to the side and a kink of
# 90 degrees are errors wherever they are.
# What happens: only from one road (or lane section) to the next places are compared. Within a road the hole and the step are
# not seen; since both lines have the same heading there is a warning that the second is redundant, as if one line had
# been written as two. A kink of 90 degrees and a length of 150 m for 100 m of line are no issues at all.
# In files of OpenDRIVE 1.6 and before the gap between roads is no issue either: the rule is skipped for them.
# Why it matters: "0 issues" by the standard's own checker is what maps are accepted by (those of CARLA, for one, are of
# version 1.4), and a lane with a hole is one for which every reader has an answer of its own.
#
# Output seen:
#   asam-qc-opendrive 1.0.0
#   two roads, joined: no issues
#   15 m between two roads: level 1, The transition between lane elements should be defined with no gaps.
#   15 m between two roads, OpenDRIVE 1.6: no issues
#   15 m within a road: level 2, Redundant line geometry declaration.
#   a step of 2 m to the side within a road: level 2, Redundant line geometry declaration.
#   a kink of 90 degrees within a road: no issues
#   a road of 100 m said to be 150 m long: no issues
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps annotated-types==0.8.0 asam-qc-baselib==1.1.0 asam-qc-opendrive==1.0.0 elementpath==4.8.0 lxml==5.4.0 numpy==1.26.4 pyclothoids==0.1.5 pydantic==2.14.4 pydantic_core==2.50.5 pydantic-xml==2.22.0 scipy==1.14.1 semver==3.0.4 transforms3d==0.4.2 typing_extensions==4.16.0 typing-inspection==0.4.5 xmlschema==3.4.5
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import subprocess
import sys
import xml.etree.ElementTree as ET
from importlib.metadata import version
from pathlib import Path

print('asam-qc-opendrive', version('asam-qc-opendrive'))
LANE = '<right><lane id="-1" type="driving" level="false">%s<width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right>'


def line(s, x, y, heading):
    return f'<geometry s="{s}" x="{x}" y="{y}" hdg="{heading}" length="100"><line/></geometry>'


def road(number, lines, length, links='', lane_links=''):
    return (f'<road name="" length="{length}" id="{number}" junction="-1" rule="RHT">{links}<planView>{lines}</planView><lanes><laneSection s="0">'
            f'<center><lane id="0" type="none" level="false"/></center>{LANE % lane_links}</laneSection></lanes></road>')


def within(x, y, heading, length=200):
    return road(1, line(0, 0, 0, 0) + line(100, x, y, heading), length)


def between(x, y, heading):
    one = '<link><successor elementType="road" elementId="2" contactPoint="start"/></link>'
    two = '<link><predecessor elementType="road" elementId="1" contactPoint="end"/></link>'
    return (road(1, line(0, 0, 0, 0), 100, one, '<link><successor id="-1"/></link>')
            + road(2, line(0, x, y, heading), 100, two, '<link><predecessor id="-1"/></link>'))


def issues(roads, minor=8):
    """What the checker says of a file: levels (1 is an error, 2 a warning) and texts."""
    Path('map.xodr').write_text('<?xml version="1.0" encoding="UTF-8"?><OpenDRIVE>'
                                f'<header revMajor="1" revMinor="{minor}" name="" version="1.00" north="0" south="0" east="0" west="0"/>{roads}</OpenDRIVE>')
    Path('config.xml').write_text('<Config><Param name="InputFile" value="map.xodr"/><CheckerBundle application="xodrBundle">'
                                  '<Param name="resultFile" value="result.xqar"/></CheckerBundle></Config>')
    subprocess.run([str(Path(sys.executable).with_name('qc_opendrive')), '-c', 'config.xml'], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return [(int(issue.get('level')), issue.get('description')) for issue in ET.parse('result.xqar').iter('Issue')]


GAP, SAME = 'no gaps', 'Redundant'
found = {}
for name, roads, minor, expected in (
        ('two roads, joined', between(100, 0, 0), 8, None), ('15 m between two roads', between(115, 0, 0), 8, GAP),
        ('15 m between two roads, OpenDRIVE 1.6', between(115, 0, 0), 6, None), ('15 m within a road', within(115, 0, 0), 8, SAME),
        ('a step of 2 m to the side within a road', within(100, 2, 0), 8, SAME), ('a kink of 90 degrees within a road', within(100, 0, 1.5708), 8, None),
        ('a road of 100 m said to be 150 m long', road(1, line(0, 0, 0, 0), 150), 8, None)):
    said = issues(roads, minor)
    print(f'{name}: ' + ('; '.join(f'level {level}, {text}' for level, text in said) or 'no issues'))
    found[name] = (len(said) == 1 and expected in said[0][1]) if expected else not said
ok = all(found.values())
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
