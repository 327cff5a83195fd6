#!/usr/bin/env bash
# CommonRoad scenario factory: its filter drops every lane change and every car that passes the end of a lanelet, and nobody on the left counts.
#
# Expected: the factory looks for cars that could be the ego: criteria find manoeuvres, one of them lane changes, and filters keep those
# on an interesting road (a lane that is changed, one that comes into an intersection, one with neighbours) with somebody around.
# What happens: InterestingLaneletNetworkFilter keeps a car that stays in its lanelet, if there is a lane beside; whoever ends in
# another lanelet than it began in is refused: the lane change that LaneChangeCriterion has found (its own comment calls that
# interesting), and each car on the same road cut into ten. A lane that leads into an intersection is refused too, since a
# lanelet is looked up among ids. What remains is let through by chance only (0.4 by default, 0 here).
# EnoughSurroundingVehiclesFilter counts the lanes from one to the right up to the own one: the car that is 20 m ahead, beside or
# 10 m behind on the left lane is nobody, mirrored it is enough.
# Why it matters: scenarios made by the factory are what planners are compared on; lane changes are left to a die.
#
# Output seen:
#   commonroad-scenario-factory 2.1.0
#   commonroad-io 2024.3
#   stays in the middle lane: kept True
#   changes to the left lane: kept False
#   stays in the middle lane of ten lanelets: kept False
#   on the only lane into an intersection: kept False
#   the lane change is found by the criterion: True, at step 30
#   one other car 20 m ahead, enough around: on the left lane False, on the own lane True, on the right lane True
#   one other car beside, enough around: on the left lane False, on the right lane True
#   one other car 10 m behind, enough around: on the left lane False, on the own lane True, on the right lane True
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps casadi==3.8.2 commonroad-clcs==2025.2.0 commonroad-io==2024.3 commonroad-scenario-factory==2.1.0 commonroad-vehicle-models==3.0.2 contourpy==1.3.3 cycler==0.12.1 Cython==3.3.1 fonttools==4.68.0 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 osqp==0.6.7.post3 packaging==26.4 pillow==13.0.0 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==4.0.0 PyYAML==6.0.4 qdldl==0.1.9.post1 rtree==1.4.1 scipy==1.17.1 shapely==2.2.0 six==1.17.0 tqdm==4.70.1 typing_extensions==4.16.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import numpy as np
from commonroad.geometry.shape import Rectangle
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.intersection import Intersection, IntersectionIncomingElement
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import CustomState, InitialState
from commonroad.scenario.trajectory import Trajectory
from scenario_factory.ego_vehicle_selection import (
    EgoVehicleManeuver, EnoughSurroundingVehiclesFilter, InterestingLaneletNetworkFilter, LaneChangeCriterion)

for name in ('commonroad-scenario-factory', 'commonroad-io'):
    print(name, version(name))
LENGTH, WIDTH, SPEED, STEP, FRAMES = 300.0, 3.5, 15.0, 0.1, 60


def road(pieces=1, lanes=3):
    """A straight road to the east whose lanes (0 is the right one) consist of some lanelets each."""
    scenario, long = Scenario(STEP), LENGTH / pieces
    for piece in range(pieces):
        for lane in range(lanes):
            x, number = np.linspace(piece * long, (piece + 1) * long, 31), 10 * piece + lane + 1
            right, centre, left = (np.column_stack([x, np.full(31, lane * WIDTH + shift)]) for shift in (-WIDTH / 2, 0.0, WIDTH / 2))
            scenario.add_objects(Lanelet(
                left, centre, right, number, predecessor=[number - 10] if piece > 0 else [], successor=[number + 10] if piece < pieces - 1 else [],
                adjacent_left=number + 1 if lane < lanes - 1 else None, adjacent_left_same_direction=True if lane < lanes - 1 else None,
                adjacent_right=number - 1 if lane > 0 else None, adjacent_right_same_direction=True if lane > 0 else None))
    return scenario


def car(number, x, y, end=None):
    """A car at constant speed, seen for 6 s, that moves to another y between 1.5 and 4.5 s."""
    steps = np.arange(FRAMES + 1)
    places = np.column_stack([x + SPEED * STEP * steps, y + ((y if end is None else end) - y) * np.clip((steps - 15) / 30, 0, 1)])
    first = InitialState(time_step=0, position=places[0], orientation=0.0, velocity=SPEED, acceleration=0.0, yaw_rate=0.0, slip_angle=0.0)
    later = [CustomState(time_step=int(k), position=places[k], orientation=0.0, velocity=SPEED) for k in steps[1:]]
    shape = Rectangle(4.5, 1.8)
    return DynamicObstacle(number, ObstacleType.CAR, shape, first, TrajectoryPrediction(Trajectory(1, later), shape))


def kept(road_filter, scenario, ego, *others):
    """Whether the filter keeps the ego's manoeuvre of 4 s that begins at 0.5 s."""
    scenario.add_objects([ego, *others])
    return road_filter.matches(scenario, 40, EgoVehicleManeuver(ego, 5))


into = road(2, 1)
into.add_objects(Intersection(500, [IntersectionIncomingElement(501, incoming_lanelets={1}, successors_straight={11})]))
road_filter = InterestingLaneletNetworkFilter(random_inclusion_probability=0.0)
changing = car(100, 20.0, WIDTH, 2.0 * WIDTH)
CASES = {
    'stays in the middle lane': (road(), car(100, 20.0, WIDTH)),
    'changes to the left lane': (road(), changing),
    'stays in the middle lane of ten lanelets': (road(10), car(100, 20.0, WIDTH)),
    'on the only lane into an intersection': (into, car(100, 20.0, 0.0)),
}
seen = {name: kept(road_filter, scenario, ego) for name, (scenario, ego) in CASES.items()}
for name, keeps in seen.items():
    print(f'{name}: kept {keeps}')
found, step = LaneChangeCriterion().matches(CASES['changes to the left lane'][0], changing)
print(f'the lane change is found by the criterion: {found}, at step {step}')
ok = list(seen.values()) == [True, False, False, False] and found
around = EnoughSurroundingVehiclesFilter()
for name, x in (('20 m ahead', 40.0), ('beside', 20.0), ('10 m behind', 10.0)):
    left, own, right = (kept(around, road(), car(100, 20.0, WIDTH), car(200, x, y)) if y != WIDTH or x != 20.0 else None for y in (2.0 * WIDTH, WIDTH, 0.0))
    print(f'one other car {name}, enough around: on the left lane {left}, ' + (f'on the own lane {own}, ' if own is not None else '') + f'on the right lane {right}')
    ok = ok and not left and right and own is not False
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
