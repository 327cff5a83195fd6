#!/usr/bin/env bash
# commonroad-io: Lanelet.merge_lanelets returns a lane without type, signs, lights,
# stop line, users and neighbours, and with an id that is not unique.
#
# Expected: the merged lane keeps what both parts agree on and references the signs
# and the stop line of either.
# What happens: only geometry, outer neighbours along the lane and obstacles are
# carried over. The speed limit of the merged lane is None, its stop line is gone,
# its adjacent lanes are None. The id is the two ids written one after the other:
# 1 + 23 and 12 + 3 both give 123, and adding the second to a network is refused
# with a warning only. The obstacles of the first lane are edited in place: the
# ORIGINAL lanelet afterwards holds the obstacles of its successor.
# Why it matters: reference lanes for criticality measures and route matching are
# built with merge_lanelets or all_lanelets_by_merging_successors_from_lanelet;
# lane changes, limits and stop lines vanish there.
#
# Output seen:
#   commonroad-io 2024.3
#   type, users, signs, lights, stop line, left neighbour: (set(), set(), set(), set(), None, None)
#   obstacles of the first lanelet itself afterwards: {500}
#   ids 123 123 added: (True, False) lanes: 1
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-io==2024.3 numpy==2.4.6 scipy==1.17.1 shapely==2.2.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
for name in ['commonroad-io']:
    print(name, version(name))
import numpy as np
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork, LaneletType, LineMarking, RoadUser, StopLine

def lanelet(number, start, end, low=0.0, **more):
    x = np.linspace(start, end, 11)
    left, right = np.c_[x, np.full(11, low + 3.5)], np.c_[x, np.full(11, low)]
    return Lanelet(left, (left + right) / 2, right, number, **more)

line = StopLine(np.array([198.0, 0.0]), np.array([198.0, 3.5]), LineMarking.SOLID)
common = dict(lanelet_type={LaneletType.URBAN}, user_one_way={RoadUser.CAR}, traffic_signs={70},
              adjacent_left=8, adjacent_left_same_direction=True)
a = lanelet(1, 0.0, 100.0, successor=[23], **common)
b = lanelet(23, 100.0, 200.0, predecessor=[1], stop_line=line, traffic_lights={71}, **common)
b.add_static_obstacle_to_lanelet(500)
merged = Lanelet.merge_lanelets(a, b)
kept = (merged.lanelet_type, merged.user_one_way, merged.traffic_signs, merged.traffic_lights,
        merged.stop_line, merged.adj_left)
print("type, users, signs, lights, stop line, left neighbour:", kept)
print("obstacles of the first lanelet itself afterwards:", a.static_obstacles_on_lanelet)
other = Lanelet.merge_lanelets(lanelet(12, 0.0, 100.0, low=9.0, successor=[3]),
                               lanelet(3, 100.0, 200.0, low=9.0, predecessor=[12]))
network = LaneletNetwork()
added = network.add_lanelet(merged), network.add_lanelet(other)
print("ids", merged.lanelet_id, other.lanelet_id, "added:", added, "lanes:", len(network.lanelets))
assert kept == (set(), set(), set(), set(), None, None)
assert a.static_obstacles_on_lanelet == {500}
assert merged.lanelet_id == other.lanelet_id == 123 and added == (True, False)
print("behaviour as stated")
PY
