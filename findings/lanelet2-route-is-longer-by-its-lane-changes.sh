#!/usr/bin/env bash
# Lanelet2: a route with a lane change on a 100 m road is 200 m long, or 125 m if the map is cut more finely.
#
# Expected: Route.length2d, from the start of a road's left lane to the end of its right lane, is about 100 m,
# however many lanelets the road is cut into.
# What happens: the lanelets of the shortest path are added up, and a lane change has both, the one that is left
# and the one beside it: 200 m for a road of one piece, 150 m for two, 125 m for four. Two changes over three lanes
# of one piece make 300 m.
# Why it matters: distances to go, mean speeds and expected arrival times along routes hang on where the map was cut.
#
# Output seen:
#   lanelet2 1.2.3
#   road of 100 m in 1 pieces: along a lane 100 m, to the next lane 200 m, over three lanes 300 m
#   road of 100 m in 2 pieces: along a lane 100 m, to the next lane 150 m, over three lanes 200 m
#   road of 100 m in 4 pieces: along a lane 100 m, to the next lane 125 m, over three lanes 150 m
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


def lengths(pieces):
    """Of routes along a 100 m road of three lanes in some pieces: along the left lane, and to the others."""
    d = Drawn()
    at = {(i, y): d.point(100.0 * i / pieces, y) for i in range(pieces + 1) for y in (8, 4, 0, -4)}
    line = {(i, y): d.line(at[i, y], at[i + 1, y], marking='dashed' if y in (4, 0) else 'solid')
            for i in range(pieces) for y in (8, 4, 0, -4)}
    lane = {(i, y): d.lane(line[i, y], line[i, y - 4]) for i in range(pieces) for y in (8, 4, 0)}
    graph = RoutingGraph(d.map, RULES)
    return [graph.getRoute(lane[0, 8], lane[pieces - 1, y]).length2d() for y in (8, 4, 0)]


found = {}
for pieces in (1, 2, 4):
    found[pieces] = lengths(pieces)
    print('road of 100 m in {} pieces: along a lane {:.0f} m, to the next lane {:.0f} m, over three lanes {:.0f} m'.format(
        pieces, *found[pieces]))
ok = all(abs(found[n][k] - 100.0 * (1.0 + k / n)) < 1e-6 for n in found for k in range(3))
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
