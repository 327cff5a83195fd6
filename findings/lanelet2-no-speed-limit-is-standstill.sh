#!/usr/bin/env bash
# Lanelet2: a motorway tagged with the speed limit "none" has a mandatory limit of 0 km/h.
#
# Expected: "none" is how OpenStreetMap says that a road has no limit: it is that of a motorway without any
# tag, 130 km/h and not mandatory, or an error says that the text is not understood.
# What happens: text that is no velocity becomes 0 km/h, mandatory, without a word ("walk" too, which is meant
# as walking pace). Routing by travel time then takes the motorway as impassable: a 3 km detour at 50 km/h
# is found shorter than 1 km of free motorway, whose travel time is infinite; routing by distance takes the motorway.
# Why it matters: the fastest roads of a map are those on which a planner has to stand, and routes avoid them.
#
# Output seen:
#   lanelet2 1.2.3
#   speed limit 130: 130 km/h, mandatory True, by travel time the motorway, by distance the motorway
#   no tag: 130 km/h, mandatory False, by travel time the motorway, by distance the motorway
#   speed limit none: 0 km/h, mandatory True, by travel time the detour, by distance the motorway
#   speed limit walk: 0 km/h, mandatory True, by travel time the detour, by distance the motorway
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps lanelet2==1.2.3
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import lanelet2
from lanelet2.core import LaneletMap, Lanelet, LineString3d, Point3d
from lanelet2.routing import RoutingCostDistance, RoutingCostTravelTime, RoutingGraph

print('lanelet2', version('lanelet2'))
RULES = lanelet2.traffic_rules.create(lanelet2.traffic_rules.Locations.Germany,
                                      lanelet2.traffic_rules.Participants.Vehicle)


class Drawn:
    """A map that numbers what is drawn on it."""

    def __init__(self):
        self.map, self.count = LaneletMap(), 0

    def number(self):
        self.count += 1
        return self.count

    def point(self, x, y):
        return Point3d(self.number(), float(x), float(y), 0.0)

    def line(self, *points, marking='solid'):
        made = LineString3d(self.number(), list(points))
        made.attributes['type'], made.attributes['subtype'] = 'line_thin', marking
        return made

    def lane(self, left, right, **more):
        made = Lanelet(self.number(), left, right)
        for key, value in dict(subtype='highway', location='nonurban', one_way='yes', **more).items():
            made.attributes[key] = value
        self.map.add(made)
        return made


def choice(limit):
    """Two ways between two motorways: 1 km of motorway with some limit, or 3 km at 50 km/h."""
    d = Drawn()
    (a, b), (c, e) = ((d.point(x, 2), d.point(x, -2)) for x in (0, 1000))
    start = d.lane(d.line(d.point(-100, 2), a), d.line(d.point(-100, -2), b), speed_limit='100')
    goal = d.lane(d.line(c, d.point(1100, 2)), d.line(e, d.point(1100, -2)), speed_limit='100')
    motorway = d.lane(d.line(a, c), d.line(b, e), **({} if limit is None else {'speed_limit': limit}))
    detour = d.lane(d.line(a, d.point(500, 1500), c), d.line(b, d.point(500, 1490), e), speed_limit='50')
    graph = RoutingGraph(d.map, RULES, [RoutingCostTravelTime(0.0), RoutingCostDistance(0.0)])
    ways = ['detour' if detour.id in [lane.id for lane in graph.shortestPath(start, goal, cost)] else 'motorway'
            for cost in (0, 1)]
    said = RULES.speedLimit(motorway)
    return round(said.speedLimit), bool(said.isMandatory), *ways


found = {}
for limit in ('130', None, 'none', 'walk'):
    found[limit] = speed, mandatory, quick, short = choice(limit)
    print(f'{"no tag" if limit is None else "speed limit " + limit}: {speed} km/h, mandatory {mandatory}, '
          f'by travel time the {quick}, by distance the {short}')
ok = found['130'] == (130, True, 'motorway', 'motorway') and found[None] == (130, False, 'motorway', 'motorway')
ok = ok and found['none'] == found['walk'] == (0, True, 'detour', 'motorway')
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
