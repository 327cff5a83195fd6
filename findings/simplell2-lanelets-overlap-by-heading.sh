#!/usr/bin/env bash
# simple-lanelet2: a lanelet that lies exactly on another does not overlap it, and one 40 m further on touches it on some headings.
#
# Expected: the drop-in replacement answers as Lanelet2 does, and the answer does not depend on where the road points: of two lanelets on
# the same ground, or half on it, each conflicts with the other, and two on one line with 40 m between them are 40 m apart.
# What happens: with Lanelet2 all of that holds on all 72 headings. With simple-lanelet2 equal lanelets never overlap and never conflict in
# the routing graph; two that share half of their ground do on 51 of 72 headings (60 in UTM coordinates); two 40 m apart on one line
# intersect, at distance 0, on 10 of 72 (40 and 80 degrees among them), but in UTM coordinates not; two side by side with 1 m between
# them on 9. Lanelets that cross are right everywhere. Borders that lie on one line are what is judged by rounding.
# Why it matters: merging, splitting and doubled lanes, as after putting two maps together, have common borders; conflicting() is what a
# right-of-way check relies on. The mode that is to restore the behaviour of Lanelet2 (LANELET2_BUG_COMPAT) gives the same answers.
#
# Output seen:
#   lanelet2 1.2.3
#   equal: overlap on 72 of 72 headings, conflict on 72, distance 0 on 72
#   half on it, one behind the other: overlap on 72 of 72 headings, conflict on 72, distance 0 on 72
#   half on it, side by side: overlap on 72 of 72 headings, conflict on 72, distance 0 on 72
#   across: overlap on 72 of 72 headings, conflict on 72, distance 0 on 72
#   40 m further on: overlap on 0 of 72 headings, conflict on 0, distance 0 on 0
#   1 m beside: overlap on 0 of 72 headings, conflict on 0, distance 0 on 0
#   half on it in UTM coordinates: overlap on 72 of 72 headings, conflict on 72, distance 0 on 72
#   simple-lanelet2 1.2.3
#   equal: overlap on 0 of 72 headings, conflict on 0, distance 0 on 72
#   half on it, one behind the other: overlap on 51 of 72 headings, conflict on 51, distance 0 on 72
#   half on it, side by side: overlap on 59 of 72 headings, conflict on 59, distance 0 on 72
#   across: overlap on 72 of 72 headings, conflict on 72, distance 0 on 72
#   40 m further on: overlap on 0 of 72 headings, conflict on 0, distance 0 on 10
#   1 m beside: overlap on 0 of 72 headings, conflict on 0, distance 0 on 9
#   half on it in UTM coordinates: overlap on 60 of 72 headings, conflict on 60, distance 0 on 72
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
for name in lanelet2 simple-lanelet2; do
    python3 -m venv --without-pip "$dir/$name"
    python3 -m pip --python "$dir/$name/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps numpy==1.26.4 "$name==1.2.3"
done
cd "$dir"
cat > compare.py <<'PY'
import math
import sys
from importlib.metadata import version

import lanelet2
from lanelet2 import geometry
from lanelet2.core import Lanelet, LaneletMap, LineString3d, Point3d, getId

name = sys.argv[1]
print(name, version(name))
RULES = lanelet2.traffic_rules.create(lanelet2.traffic_rules.Locations.Germany, lanelet2.traffic_rules.Participants.Vehicle)
HEADINGS = [math.radians(5.0 * count) for count in range(72)]
UTM = (690000.0, 5335000.0)


def lanelet(box, heading, origin):
    """Straight lanelet from a box (first, last, right, left) in a frame with the heading and origin."""
    first, last, right, left = box
    cosine, sine = math.cos(heading), math.sin(heading)

    def border(y):
        places = [(origin[0] + x * cosine - y * sine, origin[1] + x * sine + y * cosine) for x in (first, last)]
        return LineString3d(getId(), [Point3d(getId(), *place, 0.0) for place in places])

    made = Lanelet(getId(), border(left), border(right))
    for key, value in (('subtype', 'road'), ('location', 'urban'), ('one_way', 'yes')):
        made.attributes[key] = value
    return made


def compare(words, second, origin=(0.0, 0.0)):
    """Numbers of headings with overlap, conflict and distance 0 of a lanelet of 60 m and another."""
    overlaps = conflicts = touches = 0
    for heading in HEADINGS:
        one, other = lanelet((0.0, 60.0, 0.0, 4.0), heading, origin), lanelet(second, heading, origin)
        both = LaneletMap()
        both.add(one)
        both.add(other)
        overlaps += geometry.overlaps2d(one, other)
        conflicts += len(lanelet2.routing.RoutingGraph(both, RULES).conflicting(one)) > 0
        touches += geometry.distance(one, other) < 1e-6
    print(f'{words}: overlap on {overlaps} of {len(HEADINGS)} headings, conflict on {conflicts}, distance 0 on {touches}')
    return overlaps, conflicts, touches


equal = compare('equal', (0.0, 60.0, 0.0, 4.0))
behind = compare('half on it, one behind the other', (30.0, 90.0, 0.0, 4.0))
beside = compare('half on it, side by side', (0.0, 60.0, 2.0, 6.0))
across = compare('across', (20.0, 24.0, -20.0, 20.0))
away = compare('40 m further on', (100.0, 160.0, 0.0, 4.0))
gap = compare('1 m beside', (0.0, 60.0, 5.0, 9.0))
utm = compare('half on it in UTM coordinates', (30.0, 90.0, 0.0, 4.0), UTM)
full, none = (72, 72, 72), (0, 0, 0)
if name == 'lanelet2':
    ok = [equal, behind, beside, across, away, gap, utm] == [full, full, full, full, none, none, full]
else:
    ok = equal == (0, 0, 72) and behind[1] < 72 and beside[1] < 72 and across == full and utm[1] < 72
    ok = ok and away[2] > 0 and gap[2] > 0
raise SystemExit(not ok)
PY
ok=true
for name in lanelet2 simple-lanelet2; do
    "$dir/$name/bin/python" compare.py "$name" || ok=false
done
if $ok; then echo 'behaviour as stated'; else echo 'behaviour has changed'; exit 1; fi
