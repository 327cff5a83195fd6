#!/usr/bin/env bash
# commonroad-labeling: the car that follows the ego is traffic ahead, and the one it follows is traffic behind as well.
#
# Expected: of the labels "traffic ahead" and "traffic behind" a scenario with one other car on the ego's lane gets the one that is
# true, and it does not matter into how many lanelets the lane is cut.
# What happens: on a lane of one lanelet every car is ahead and none behind, the follower 20 m behind the ego too. With the lane
# in three lanelets it and the cars 40 and 120 m ahead are ahead and behind, one 200 m ahead, on the last lanelet, is
# ahead only. "Ahead" means anywhere on the route's lanelets, at any time, "behind" anywhere on the predecessor of one.
# Why it matters: the labels are there to find scenarios, "followed closely" or "nobody behind", by search; the answer to
# both is how the map was cut.
#
# Output seen:
#   commonroad-labeling 2025.1.2
#   commonroad-io 2024.3
#   1 lanelet, the only car 20 m behind: traffic ahead: True, behind: False
#   1 lanelet, the only car 40 m ahead: traffic ahead: True, behind: False
#   1 lanelet, the only car 120 m ahead: traffic ahead: True, behind: False
#   1 lanelet, the only car 200 m ahead: traffic ahead: True, behind: False
#   3 lanelets, the only car 20 m behind: traffic ahead: True, behind: True
#   3 lanelets, the only car 40 m ahead: traffic ahead: True, behind: True
#   3 lanelets, the only car 120 m ahead: traffic ahead: True, behind: True
#   3 lanelets, the only car 200 m ahead: traffic ahead: True, behind: False
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps casadi==3.8.2 cloudpickle==3.1.3 commonroad-clcs==2025.2.0 commonroad-crime==0.4.5 commonroad-drivability-checker==2025.3.1 commonroad-io==2024.3 commonroad-labeling==2025.1.2 commonroad-reach==2025.2.0 commonroad-reactive-planner==2025.1 commonroad-route-planner==2025.1.0 commonroad-vehicle-models==3.0.2 contourpy==1.3.3 cycler==0.12.1 Cython==3.3.1 fonttools==4.68.0 ImageIO==2.38.1 iniconfig==2.3.1 iso3166==3.0.0 joblib==1.6.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 methodtools==0.4.7 narwhals==2.29.0 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 opencv-python==4.14.0.94 osqp==0.6.7.post3 packaging==26.4 pandas==2.3.3 pillow==13.0.0 pluggy==1.7.0 Polygon3==3.0.9.1 protobuf==3.20.2 Pygments==2.21.0 pyparsing==3.3.3 pytest==9.2.0 python-dateutil==4.0.0 pytz==2026.6 PyYAML==6.0.4 qdldl==0.1.9.post1 rtree==1.4.1 scikit-learn==1.9.1 scipy==1.17.1 seaborn==0.13.2 shapely==2.2.0 six==1.17.0 threadpoolctl==3.8.0 tqdm==4.70.1 triangle==20250106 tzdata==2026.6 wirerope==1.0.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import contextlib
import io
import logging
from importlib.metadata import version
from pathlib import Path

import numpy as np
from commonroad.common.file_writer import CommonRoadFileWriter
from commonroad.common.util import Interval
from commonroad.geometry.shape import Rectangle
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem, PlanningProblemSet
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario, Tag
from commonroad.scenario.state import CustomState, InitialState
from commonroad.scenario.trajectory import Trajectory
from commonroad_labeling.common.general import find_scenario_tags
from commonroad_labeling.common.tag import TagEnum

logging.disable(logging.CRITICAL)
for name in ('commonroad-labeling', 'commonroad-io'):
    print(name, version(name))
AHEAD, BEHIND = TagEnum.ROUTE_OBSTACLE_TRAFFIC_AHEAD, TagEnum.ROUTE_OBSTACLE_TRAFFIC_BEHIND


def start(place, speed):
    return InitialState(time_step=0, position=np.array([place, 0.0]), orientation=0.0, velocity=speed, acceleration=0.0,
                        yaw_rate=0.0, slip_angle=0.0)


def labels(place, pieces, speed=10.0):
    """Whether traffic is ahead and behind for an ego at 50 m on a lane of 300 m in pieces, with one other car on it."""
    road, shape = Scenario(0.1), Rectangle(4.5, 1.8)
    ends = np.linspace(0.0, 300.0, pieces + 1)
    for k in range(pieces):
        x = np.linspace(ends[k], ends[k + 1], 51)
        left, centre, right = (np.column_stack([x, np.full_like(x, y)]) for y in (1.75, 0.0, -1.75))
        road.add_objects(Lanelet(left, centre, right, k + 1, predecessor=[k] if k else [],
                                 successor=[k + 2] if k + 1 < pieces else []))
    states = [CustomState(time_step=k, position=np.array([place + 0.1 * speed * k, 0.0]), orientation=0.0, velocity=speed)
              for k in range(1, 21)]
    road.add_objects(DynamicObstacle(100, ObstacleType.CAR, shape, start(place, speed),
                                     TrajectoryPrediction(Trajectory(1, states), shape)))
    goal = CustomState(time_step=Interval(0, 300), position=Rectangle(10.0, 3.0, np.array([290.0, 0.0]), 0.0))
    problems = PlanningProblemSet([PlanningProblem(500, start(50.0, 10.0), GoalRegion([goal]))])
    file = Path(f'{pieces}-{place:.0f}.xml')
    with contextlib.redirect_stdout(io.StringIO()):
        CommonRoadFileWriter(road, problems, '', '', '', {Tag.URBAN}).write_to_file(str(file))
        tags = find_scenario_tags(file)
    return AHEAD in tags, BEHIND in tags


seen = {}
for pieces in (1, 3):
    for name, place in (('20 m behind', 30.0), ('40 m ahead', 90.0), ('120 m ahead', 170.0), ('200 m ahead', 250.0)):
        ahead, behind = seen[pieces, place] = labels(place, pieces)
        print(f'{pieces} lanelet{"s" if pieces > 1 else ""}, the only car {name}: traffic ahead: {ahead}, behind: {behind}')
ok = all(seen[1, place] == (True, False) for place in (30.0, 90.0, 170.0, 250.0))
ok = ok and all(seen[3, place] == (True, True) for place in (30.0, 90.0, 170.0)) and seen[3, 250.0] == (True, False)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
