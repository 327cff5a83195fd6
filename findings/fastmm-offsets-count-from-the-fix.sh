#!/usr/bin/env bash
# fastmm: the offset on an edge counts from the last position fix, not from the edge's start: 10 m where the car is at 100 m.
#
# Expected: `edge_offset` of a matched point is "distance from the start of the edge to this point": for a car that drives along a road of
# two edges of 100 m, the x coordinate on the first and x - 100 m on the second. With noise allowed for by `reverse_tolerance`, points
# of an edge "always go from lower to higher offset" (the documentation), and a car that stands from 3 s to 5 s is there at both times.
# What happens: positions, times and edges are right, offsets are right up to the second fix only. From there on each piece between two
# fixes starts at 0: the end of the first edge is at 10 m, 50 m of the second at 20 m. Moving the start of the recording by a few
# metres moves all offsets. A point that goes back from 90 to 80 m has offsets 0 and 10 m, in a piece whose points run backwards, and
# 10 m are added to the distance driven. Of a stop the end is missing: both points of the piece from 3 s to 4 s are at 3 s.
# Why it matters: the offset is what puts a car onto a lane; it is right in an example with two fixes on one edge.
#
# Output seen:
#   fastmm 0.3.2
#   two fixes on one edge, from its start
#     edge 1 at x = 0 m: offset 0 m, 0.0 s, 0 m driven, edge 1 at x = 80 m: offset 80 m, 4.0 s, 80 m driven
#     worst offset wrong by 0 m
#   along both edges
#     edge 1 at x = 10 m: offset 0 m, 0.0 s, 0 m driven, edge 1 at x = 90 m: offset 80 m, 4.0 s, 80 m driven
#     edge 1 at x = 90 m: offset 0 m, 4.0 s, 80 m driven, edge 1 at x = 100 m: offset 10 m, 4.5 s, 90 m driven, edge 2 at x = 100 m: offset 0 m, 4.5 s, 90 m driven, edge 2 at x = 130 m: offset 30 m, 6.0 s, 120 m driven
#     edge 2 at x = 130 m: offset 0 m, 6.0 s, 120 m driven, edge 2 at x = 150 m: offset 20 m, 7.0 s, 140 m driven
#     worst offset wrong by 90 m
#   back by 10 m
#     edge 1 at x = 10 m: offset 0 m, 0.0 s, 0 m driven, edge 1 at x = 90 m: offset 80 m, 4.0 s, 80 m driven
#     edge 1 at x = 90 m: offset 0 m, 4.0 s, 80 m driven, edge 1 at x = 80 m: offset 10 m, 6.0 s, 90 m driven
#     edge 1 at x = 80 m: offset 0 m, 6.0 s, 90 m driven, edge 1 at x = 95 m: offset 15 m, 8.0 s, 105 m driven
#     worst offset wrong by 90 m
#   a stop from 3 s to 5 s
#     edge 1 at x = 10 m: offset 0 m, 0.0 s, 0 m driven, edge 1 at x = 70 m: offset 60 m, 3.0 s, 60 m driven
#     edge 1 at x = 70 m: offset 0 m, 3.0 s, 60 m driven, edge 1 at x = 70 m: offset 0 m, 3.0 s, 60 m driven
#     edge 1 at x = 70 m: offset 0 m, 4.0 s, 60 m driven, edge 1 at x = 70 m: offset 0 m, 4.0 s, 60 m driven
#     edge 1 at x = 70 m: offset 0 m, 5.0 s, 60 m driven, edge 1 at x = 90 m: offset 20 m, 7.0 s, 80 m driven
#     worst offset wrong by 70 m
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps fastmm==0.3.2
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY' | grep -v '\[info\]'
from importlib.metadata import version
from pathlib import Path

import fastmm

print('fastmm', version('fastmm'))
road = fastmm.Network()
road.add_edge(1, 1, 2, [(0.0, 0.0), (100.0, 0.0)])
road.add_edge(2, 2, 3, [(100.0, 0.0), (200.0, 0.0)])
road.finalize()
STARTS = {1: 0.0, 2: 100.0}
matcher = fastmm.FastMapMatch(road, fastmm.TransitionMode.SHORTEST, max_distance_between_candidates=1000.0, cache_dir=Path('cache'))


def match(fixes, tolerance=0.0):
    """Edge, x, offset, time and distance driven of all matched points, piece by piece, of fixes (x, time) on the road."""
    recording = fastmm.Trajectory.from_xyt_tuples([(x, 0.0, time) for x, time in fixes])
    result = matcher.match(recording, candidate_search_radius=20.0, gps_error=5.0, reverse_tolerance=tolerance)
    (whole,) = result.subtrajectories
    return [[(edge.edge_id, point.x, point.edge_offset, point.t, point.cumulative_distance) for edge in piece.edges for point in edge.points]
            for piece in whole.segments]


def show(words, pieces):
    """Print the points and say how far the worst offset is from the distance to the edge's start."""
    print(words)
    worst = 0.0
    for piece in pieces:
        for edge, x, offset, time, driven in piece:
            worst = max(worst, abs(offset - (x - STARTS[edge])))
        print('  ' + ', '.join(f'edge {edge} at x = {x:.0f} m: offset {offset:.0f} m, {time:.1f} s, {driven:.0f} m driven'
                               for edge, x, offset, time, driven in piece))
    print(f'  worst offset wrong by {worst:.0f} m')
    return worst


two = show('two fixes on one edge, from its start', match([(0.0, 0.0), (80.0, 4.0)]))
along = show('along both edges', match([(10.0, 0.0), (90.0, 4.0), (130.0, 6.0), (150.0, 7.0)]))
pieces = match([(10.0, 0.0), (90.0, 4.0), (80.0, 6.0), (95.0, 8.0)], tolerance=20.0)
back = show('back by 10 m', pieces)
stop = match([(10.0, 0.0), (70.0, 3.0), (70.0, 4.0), (70.0, 5.0), (90.0, 7.0)])
show('a stop from 3 s to 5 s', stop)
ok = two == 0.0 and along == 90.0 and back == 90.0
ok = ok and [round(point[1]) for point in pieces[1]] == [90, 80] and [point[3] for point in stop[1]] == [3.0, 3.0]
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
