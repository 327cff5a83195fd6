#!/usr/bin/env bash
# commonroad-reactive-planner: below 4 m/s the first planned state has another heading and speed than the car.
#
# Expected: the planned trajectory begins with the state that the planner was given, at every speed.
# What happens: below 4 m/s the lateral motion is planned over the arc length, above it over time. The initial
# state is converted when the planner is set up, as for a fast car; that a car is slow is noticed only when it
# plans, and its lateral speed is then read as its slope. At 3.9 m/s and 0.1 rad from the lane's direction
# the plan begins at 0.371 rad and 4.16 m/s. When a car of a later cycle crosses 4 m/s upwards, it is the
# other way round: its slope is read as its lateral speed, and the plan begins at 0.025 instead of 0.1 rad.
# Why it matters: the planner's limits of yaw rate and steering speed compare its own states only and do not
# see the jump of 0.27 rad before them: the plan passes as feasible and cannot be driven by this car.
#
# Output seen:
#   commonroad-reactive-planner 2025.1
#   car at 3.0 m/s and 0.100 rad: the plan begins at 3.12 m/s and 0.291 rad
#   car at 3.9 m/s and 0.100 rad: the plan begins at 4.16 m/s and 0.371 rad
#   car at 4.1 m/s and 0.100 rad: the plan begins at 4.10 m/s and 0.100 rad
#   car at 6.0 m/s and 0.100 rad: the plan begins at 6.00 m/s and 0.100 rad
#   the next cycle at 4.1 m/s and 0.100 rad: the plan begins at 4.08 m/s and 0.025 rad
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps commonroad-clcs==2025.2.0 commonroad-drivability-checker==2025.4.0 commonroad-reactive-planner==2025.1 methodtools==0.4.7 wirerope==1.0.0 commonroad-io==2024.3 commonroad-route-planner==2025.1.0 commonroad-vehicle-models==3.0.2 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 imageio==2.38.1 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 antlr4-python3-runtime==4.9.3 osqp==0.6.7.post3 packaging==26.4 pandas==3.1.1 pillow==13.0.0 Polygon3==3.0.9.1 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==4.0.0 PyYAML==6.0.4 qdldl==0.1.9.post1 rtree==1.4.1 scipy==1.17.1 shapely==2.2.0 six==1.17.0 tqdm==4.70.1
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { grep -v nanobind errors | tail -3 >&2; exit 1; }
from importlib.metadata import version

import numpy as np
from commonroad.common.util import Interval
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import CustomState, InitialState
from commonroad_rp.reactive_planner import ReactivePlanner
from commonroad_rp.state import ReactivePlannerState
from commonroad_rp.utility.config import ReactivePlannerConfiguration
from commonroad_rp.utility.utils_coordinate_system import create_coordinate_system

print('commonroad-reactive-planner', version('commonroad-reactive-planner'))
HEADING = 0.1
scenario = Scenario(0.1)
x = np.arange(-50.0, 601.0, 5.0)
scenario.add_objects(Lanelet(np.c_[x, 0 * x + 6], np.c_[x, 0 * x], np.c_[x, 0 * x - 6], 1))
along = create_coordinate_system(np.c_[np.arange(-40.0, 551.0), np.zeros(591)])


def planner_at(velocity):
    start = InitialState(time_step=0, position=np.zeros(2), orientation=HEADING, velocity=velocity, acceleration=0.0,
                         yaw_rate=0.0, slip_angle=0.0)
    goal = CustomState(time_step=Interval(0, 1000), velocity=Interval(0.0, 20.0))
    settings = ReactivePlannerConfiguration()
    settings.debug.multiproc, settings.debug.logging_level = False, 'ERROR'
    settings.update(scenario=scenario, planning_problem=PlanningProblem(1, start, GoalRegion([goal])))
    planner = ReactivePlanner(settings)
    planner.reset(coordinate_system=along)
    return planner


def first_planned(planner):
    velocity = planner.x_0.velocity
    planner.set_desired_velocity(velocity + 1.0, velocity)
    return planner.plan()[0].state_list[0]


ok = True
for velocity in (3.0, 3.9, 4.1, 6.0):
    state = first_planned(planner_at(velocity))
    print(f'car at {velocity:.1f} m/s and {HEADING:.3f} rad: the plan begins at {state.velocity:.2f} m/s and {state.orientation:.3f} rad')
    slow = velocity < 4.0
    ok = ok and abs(state.orientation - (np.arctan(velocity * np.sin(HEADING)) if slow else HEADING)) < 1e-3
    ok = ok and abs(state.orientation - HEADING) < 1e-3 or slow and state.orientation > 2.5 * HEADING

planner = planner_at(3.9)
first_planned(planner)
faster = ReactivePlannerState(time_step=1, position=np.array([0.0, 0.0]), orientation=HEADING, velocity=4.1,
                              acceleration=0.0, yaw_rate=0.0, steering_angle=0.0)
planner.reset(initial_state_cart=faster, coordinate_system=along)
state = first_planned(planner)
print(f'the next cycle at 4.1 m/s and {HEADING:.3f} rad: the plan begins at {state.velocity:.2f} m/s and {state.orientation:.3f} rad')
ok = ok and state.orientation < 0.3 * HEADING
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
