#!/usr/bin/env bash
# commonroad-route-planner: a goal behind the ego gives a route that was never asked to reach it.
#
# Expected: on a ring road the goal just behind the ego is reached by one lap; on a straight road
# with a goal behind, the planner says that there is no route.
# What happens: routes are sequences of lanelets, and the ego's and the goal's places on them are
# not compared. On the ring the route is the single lanelet that has both, and its path passes the
# goal before it passes the ego; on a straight lane a route comes out as if nothing were wrong;
# with the goal behind on the neighbouring lane the reference path turns round twice by
# 90 degrees from one point to the next, runs 73 m against the traffic and turns again: 345 m on a
# 200 m road, curvature above 100 1/m.
# Why it matters: roundabouts and closed test tracks; a planner that follows the path reverses
# into the traffic, or ends short of its goal without a word.
#
# Output seen:
#   commonroad-route-planner 2025.1.0
#   commonroad-io 2024.3
#   ring, goal 12 m behind: route [1], the path passes the goal before the ego
#   straight lane, goal 130 m behind: route [1]
#   next lane, goal 40 m behind: route [1, 2], 345 m long, 73 m against the lane, turns 1.59 rad at a point, curvature up to 316 1/m
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-route-planner==2025.1.0 commonroad-io==2024.3 commonroad-clcs==2025.2.0 numpy==2.4.6 scipy==1.17.1 shapely==2.2.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
for name in ('commonroad-route-planner', 'commonroad-io'):
    print(name, version(name))
import numpy as np
from commonroad.common.util import Interval
from commonroad.geometry.shape import Rectangle
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.state import CustomState, InitialState
from commonroad_route_planner.reference_path_planner import ReferencePathPlanner
from commonroad_route_planner.route_planner import RoutePlanner


def lane(number, y, **beside):
    centre = np.column_stack([np.arange(0.0, 201.0, 2.0), np.full(101, y)])
    return Lanelet(centre + [0.0, 1.75], centre, centre - [0.0, 1.75], number, **beside)


def arc(number, angles, **joined):
    outward = np.column_stack([np.cos(angles), np.sin(angles)])
    return Lanelet(28.25 * outward, 30.0 * outward, 31.75 * outward, number, **joined)


def path_of(lanes, start, heading, goal):
    ego = InitialState(time_step=0, position=np.array(start), orientation=heading, velocity=10.0,
                       acceleration=0.0, yaw_rate=0.0, slip_angle=0.0)
    area = CustomState(time_step=Interval(1, 300), position=Rectangle(4.0, 3.0, center=np.array(goal)))
    network, problem = LaneletNetwork.create_from_lanelet_list(lanes), PlanningProblem(1, ego, GoalRegion([area]))
    routes = RoutePlanner(network, problem).plan_routes()
    return routes[0].lanelet_ids, ReferencePathPlanner(network, problem, routes).plan_shortest_reference_path()


def passed(path, place):
    return int(np.argmin(np.hypot(*(path - np.array(place)).T)))


at = lambda angle: (30.0 * np.cos(angle), 30.0 * np.sin(angle))
ring = [arc(1, np.linspace(0.0, np.pi, 51), successor=[2], predecessor=[2]),
        arc(2, np.linspace(np.pi, 2.0 * np.pi, 51), successor=[1], predecessor=[1])]
lap, around = path_of(ring, at(0.5), 0.5 + np.pi / 2, at(0.1))
early = passed(around.reference_path, at(0.1)) < passed(around.reference_path, at(0.5))
print(f'ring, goal 12 m behind: route {lap}, the path passes the goal {"before" if early else "after"} the ego')
straight, _ = path_of([lane(1, 0.0)], (150.0, 0.0), 0.0, (20.0, 0.0))
print(f'straight lane, goal 130 m behind: route {straight}')
two = [lane(1, 0.0, adjacent_left=2, adjacent_left_same_direction=True),
       lane(2, 3.5, adjacent_right=1, adjacent_right_same_direction=True)]
ids, back = path_of(two, (100.0, 0.0), 0.0, (60.0, 3.5))
step = np.diff(back.reference_path, axis=0)
turn = np.abs(np.diff(np.unwrap(np.arctan2(step[:, 1], step[:, 0])))).max()
print(f'next lane, goal 40 m behind: route {ids}, {np.hypot(*step.T).sum():.0f} m long, '
      f'{np.hypot(*step[step[:, 0] < 0.0].T).sum():.0f} m against the lane, turns {turn:.2f} rad at a point, '
      f'curvature up to {np.abs(back.path_curvature).max():.0f} 1/m')
ok = lap == [1] and early and straight == [1] and step[:, 0].min() < 0.0 and turn > 1.5
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
