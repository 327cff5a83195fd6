#!/usr/bin/env bash
# mappymatch: a drive of 700 m from the middle of one road to the middle of the next has no match, one of 950 m ends 400 m off.
#
# Expected: a car that drives 2 m beside the centre line of a straight road, made of two-way pieces of 1 km, is on those pieces, 2 m off.
# What happens: the candidate path leads from the piece's end that is nearer to the first fix to the one nearer to the last. Where both are one
# node the path is empty, and so it is for every part the trace is cut into: from 50 to 450 m, and from 600 to 1300 m,
# no fix is matched (road None, distance infinite). From 450 to 1400 m the path is the first piece alone, and the fixes on the second
# are matched to it, up to 400 m away. Of two roads between the same nodes the shortest path uses the straight one and the answer is the
# one that was added first, 298 m beside the car. The other matcher, which snaps each fix to the nearest road, says a distance of 0
# for fixes 40 m beside, and puts a car on its way back on the carriageway there.
# Why it matters: recordings of intersections are a few hundred metres long and begin and end between nodes.
#
# Output seen:
#   mappymatch 0.7.1
#   from 100 to 1900 m on pieces of 1 km, 2 m beside the line: on A-B, B-C, up to 2 m off
#   from 50 to 450 m on pieces of 1 km, 2 m beside the line: on none, up to inf m off
#   from 600 to 1300 m on pieces of 1 km, 2 m beside the line: on none, up to inf m off
#   from 450 to 1400 m on pieces of 1 km, 2 m beside the line: on A-B, up to 400 m off
#   straight on where another road goes round, straight road added first: up to 2 m off
#   straight on where another road goes round, way round added first: up to 298 m off
#   snapped, from 100 to 1900 m, 40 m beside the line: on A-B, B-C, up to 0 m off
#   snapped, from 1900 to 100 m, 40 m beside the line: on B-C, A-B, up to 0 m off
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps branca==0.8.2 certifi==2026.10.19.post1 charset-normalizer==3.5.3 contourpy==1.3.3 cycler==0.12.1 folium==0.20.0 fonttools==4.68.0 geopandas==1.2.0 idna==3.20 igraph==1.0.0 Jinja2==3.1.6 kiwisolver==1.5.1 mappymatch==0.7.1 MarkupSafe==3.0.4 matplotlib==3.11.2 networkx==3.6.1 numpy==2.4.6 osmnx==2.1.1 packaging==26.4 pandas==2.3.3 pillow==13.0.0 polyline==2.0.4 pyogrio==0.13.0 pyparsing==3.3.3 pyproj==3.7.2 python-dateutil==4.0.0 pytz==2026.6 requests==2.34.2 shapely==2.2.0 texttable==1.7.2 tzdata==2026.6 urllib3==2.8.0 xyzservices==2026.9.1 
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import geopandas as gpd
import networkx as nx
import numpy as np
from mappymatch.constructs.trace import Trace
from mappymatch.maps.nx.nx_map import NxMap
from mappymatch.matchers.lcss.lcss import LCSSMatcher
from mappymatch.matchers.line_snap import LineSnapMatcher
from pyproj import CRS
from shapely.geometry import LineString, Point

print('mappymatch', version('mappymatch'))
PLANE, KM = CRS(3857), 1000.0


def road_map(*pieces):
    """Map of directed roads, each from a node to a node along points."""
    graph = nx.MultiDiGraph(crs=PLANE, distance_weight='kilometers', time_weight='minutes', geometry_key='geometry')
    for start, end, points in pieces:
        line = LineString(points)
        graph.add_edge(start, end, geometry=line, kilometers=line.length / KM, minutes=line.length / KM)
    return NxMap(graph)


def drive(matcher, first, last, beside=2.0):
    """Roads matched in their order, and distances, of 21 fixes from first to last along x."""
    fixes = gpd.GeoDataFrame(geometry=[Point(x, beside) for x in np.linspace(first, last, 21)], crs=PLANE)
    matches = matcher.match_trace(Trace(fixes)).matches
    roads = ['-'.join(map(str, match.road.road_id[:2])) if match.road else 'none' for match in matches]
    return list(dict.fromkeys(roads)), [float(match.distance) for match in matches]


two_way = road_map(*((a, b, [(KM * x, 0.0), (KM * y, 0.0)]) for a, b, x, y in (('A', 'B', 0, 1), ('B', 'A', 1, 0), ('B', 'C', 1, 2), ('C', 'B', 2, 1))))
ok = True
for first, last, roads, farthest in ((100.0, 1900.0, ['A-B', 'B-C'], 2.0), (50.0, 450.0, ['none'], np.inf), (600.0, 1300.0, ['none'], np.inf), (450.0, 1400.0, ['A-B'], 400.0)):
    seen, distances = drive(LCSSMatcher(two_way), first, last)
    print(f'from {first:.0f} to {last:.0f} m on pieces of 1 km, 2 m beside the line: on {", ".join(seen)}, up to {max(distances):.0f} m off')
    ok = ok and seen == roads and (max(distances) == farthest or abs(max(distances) - farthest) < 0.5)
STRAIGHT, ROUND = ('B', 'C', [(KM, 0.0), (3 * KM, 0.0)]), ('B', 'C', [(KM, 0.0), (KM, 300.0), (3 * KM, 300.0), (3 * KM, 0.0)])
for name, pair, farthest in (('straight road added first', (STRAIGHT, ROUND), 2.0), ('way round added first', (ROUND, STRAIGHT), 298.0)):
    parallel = road_map(('A', 'B', [(0.0, 0.0), (KM, 0.0)]), *pair, ('C', 'D', [(3 * KM, 0.0), (4 * KM, 0.0)]))
    _, distances = drive(LCSSMatcher(parallel), 100.0, 3900.0)
    print(f'straight on where another road goes round, {name}: up to {max(distances):.0f} m off')
    ok = ok and abs(max(distances) - farthest) < 0.5
for first, last, beside in ((100.0, 1900.0, 40.0), (1900.0, 100.0, 40.0)):
    seen, distances = drive(LineSnapMatcher(two_way), first, last, beside)
    print(f'snapped, from {first:.0f} to {last:.0f} m, {beside:.0f} m beside the line: on {", ".join(seen)}, up to {max(distances):.0f} m off')
    ok = ok and max(distances) == 0.0 and sorted(seen) == ['A-B', 'B-C']
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
