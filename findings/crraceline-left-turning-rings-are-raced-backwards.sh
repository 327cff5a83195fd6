#!/usr/bin/env bash
# CommonRoad raceline planner: a ring that turns left is raced against its traffic; in map coordinates the start decides it.
#
# Expected: the raceline through lanelets that follow each other runs their way, from the ego's place on; where the ring
# lies on the map, and where on it the ego starts, is no matter.
# What happens: the planner wants clockwise tracks, so it turns the points of a ring that turns left round, and nothing says so
# or turns the result back: the raceline begins at the ego and runs against all lanelets.
# In map coordinates the test of clockwise is not one: its sum leaves out the closing edge and takes y as it is, so that
# with y = 5335 km the gap between last and first point decides. The ring that turns right is raced backwards
# from half of the starts, the one that turns left forwards from the other half.
# The heading of a raceline counts from north, that of every CommonRoad state from east; so states built from it drive sideways.
# Why it matters: with lanelets of one direction the plan drives a lap as a wrong-way driver, and moving the scenario by
# translate_rotate, or starting elsewhere, changes the plan's direction.
#
# Output seen:
#   commonroad-raceline-planner 0.1.1
#   commonroad-io 2024.3
#   ring that turns left around (0, 0), eight starts: share of the track that runs with the lanes 0 0 0 0 0 0 0 0
#   ring that turns right around (0, 0), eight starts: share of the track that runs with the lanes 1 1 1 1 1 1 1 1
#   ring that turns left in UTM coordinates, eight starts: share of the track that runs with the lanes 0 0 1 1 1 1 0 0
#   ring that turns right in UTM coordinates, eight starts: share of the track that runs with the lanes 0 0 1 1 1 1 0 0
#   raceline, ring that turns right around (0, 0), ego after 0.04 of the lap: with the lanes 1, begins 2 degrees off the ego, its own heading is 89 degrees off its points
#   raceline, ring that turns left around (0, 0), ego after 0.04 of the lap: with the lanes 0, begins 176 degrees off the ego, its own heading is 89 degrees off its points
#   raceline, ring that turns right in UTM coordinates, ego after 0.04 of the lap: with the lanes 0, begins 176 degrees off the ego, its own heading is 91 degrees off its points
#   raceline, ring that turns right in UTM coordinates, ego after 0.54 of the lap: with the lanes 1, begins 2 degrees off the ego, its own heading is 89 degrees off its points
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps casadi==3.8.2 commonroad-io==2024.3 commonroad-raceline-planner==0.1.1 commonroad-vehicle-models==3.0.2 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.8.4 networkx==3.6.1 numpy==1.26.4 omegaconf==2.4.0 packaging==26.4 pillow==13.0.0 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==4.0.0 PyYAML==6.0.4 quadprog==0.1.13 rtree==1.4.1 scipy==1.17.1 shapely==2.2.0 tqdm==4.70.1
cd "$dir"
cat >car.ini <<'INI'
[GENERAL_OPTIONS]
ggv_file="ggv.csv"
ax_max_machines_file="engine.csv"
stepsize_opts={"stepsize_prep": 1.0, "stepsize_reg": 3.0, "stepsize_interp_after_opt": 2.0}
reg_smooth_opts={"k_reg": 3, "s_reg": 10}
curv_calc_opts={"d_preview_curv": 2.0, "d_review_curv": 2.0, "d_preview_head": 1.0, "d_review_head": 1.0}
veh_params={"v_max": 40.0, "length": 4.5, "width": 2.0, "mass": 1200.0, "dragcoeff": 0.75, "curvlim": 0.12, "g": 9.81}
vel_calc_opts={"dyn_model_exp": 1.0, "vel_profile_conv_filt_window": null}
[OPTIMIZATION_OPTIONS]
optim_opts_shortest_path={"width_opt": 3.0}
optim_opts_mincurv={"width_opt": 3.0, "iqp_iters_min": 3, "iqp_curverror_allowed": 0.01}
INI
printf '0.0,8.0,8.0\n40.0,8.0,8.0\n' >ggv.csv
printf '0.0,5.0\n40.0,3.0\n' >engine.csv
"$dir/venv/bin/python" -W ignore - <<'PY'
import logging
from importlib.metadata import version

import numpy as np
from commonroad.common.util import Interval
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import CustomState, InitialState
from commonroad_raceline_planner.racetrack import RaceTrackFactory
from commonroad_raceline_planner.raceline_fast_api import generate_ftm_minimum_curvature_raceline_from_cr

for name in ('commonroad-raceline-planner', 'commonroad-io'):
    print(name, version(name))
logging.disable(logging.CRITICAL)
LEFT, RIGHT, PARTS, RADII = 1, -1, 4, np.array([78.0, 60.0])
PLACES = {'around (0, 0)': (0.0, 0.0), 'in UTM coordinates': (690000.0, 5335000.0)}


def oval(turn, origin):
    """A closed road 8 m wide, of four lanelets that follow each other, driven in the sense of turn."""
    scenario = Scenario(0.1)
    for part in range(PARTS):
        angles = turn * 2.0 * np.pi * np.linspace(part, part + 1, 16) / PARTS
        inner, centre, outer = ((RADII + shift) * np.column_stack([np.cos(angles), np.sin(angles)]) + origin for shift in (-4.0, 0.0, 4.0))
        left, right = (inner, outer) if turn == LEFT else (outer, inner)
        scenario.add_objects(Lanelet(left, centre, right, part + 1, [(part - 1) % PARTS + 1], [(part + 1) % PARTS + 1]))
    return scenario


def start(turn, origin, share):
    """Planning problem that begins on the centre line after a share of the lap, with the heading of the lane."""
    angle = turn * 2.0 * np.pi * share
    place, heading = RADII * [np.cos(angle), np.sin(angle)] + origin, np.arctan2(turn * RADII[1] * np.cos(angle), -turn * RADII[0] * np.sin(angle))
    state = InitialState(time_step=0, position=place, orientation=heading, velocity=10.0, yaw_rate=0.0, slip_angle=0.0)
    return PlanningProblem(100, state, GoalRegion([CustomState(time_step=Interval(0, 100))]))


def with_the_lanes(points, turn, origin):
    """Share of the steps between points that go round in the lanes' sense."""
    about = (points - origin)[:-1]
    step = np.diff(points, axis=0)
    moves = np.hypot(*step.T) > 1e-3
    return float(np.mean(turn * (about[:, 0] * step[:, 1] - about[:, 1] * step[:, 0])[moves] > 0.0))


ok = True
for place, origin in PLACES.items():
    for turn, name in ((LEFT, 'left'), (RIGHT, 'right')):
        scenario, seen = oval(turn, origin), []
        for share in np.arange(8) / 8.0 + 0.04:
            track = RaceTrackFactory.generate_racetrack_from_cr_scenario(scenario.lanelet_network, start(turn, origin, share), 2.0)
            seen.append(with_the_lanes(np.column_stack([track.x_m, track.y_m]), turn, origin))
        print(f'ring that turns {name} {place}, eight starts: share of the track that runs with the lanes ' + ' '.join(f'{s:.0f}' for s in seen))
        backwards = [s < 0.05 for s in seen]
        ok = ok and (sum(backwards) == (8 if turn == LEFT else 0) if place == 'around (0, 0)' else sum(backwards) == 4 == sum(s > 0.95 for s in seen))
for place, turn, share in (('around (0, 0)', RIGHT, 0.04), ('around (0, 0)', LEFT, 0.04), ('in UTM coordinates', RIGHT, 0.04), ('in UTM coordinates', RIGHT, 0.54)):
    origin = np.array(PLACES[place])
    problem = start(turn, origin, share)
    line = generate_ftm_minimum_curvature_raceline_from_cr(oval(turn, origin), problem, 'car.ini', 'ggv.csv', 'engine.csv')
    steps = np.diff(line.points[:2], axis=0)[0]
    drives = np.arctan2(steps[1], steps[0])
    off, said = (abs((a + np.pi) % (2.0 * np.pi) - np.pi) for a in (drives - problem.initial_state.orientation, line.heading_per_point[0] - drives))
    share_with = with_the_lanes(line.points, turn, origin)
    print(f'raceline, ring that turns {"left" if turn == LEFT else "right"} {place}, ego after {share:.2f} of the lap: with the lanes {share_with:.0f}, '
          f'begins {np.degrees(off):.0f} degrees off the ego, its own heading is {np.degrees(said):.0f} degrees off its points')
    wrong = turn == LEFT if place == 'around (0, 0)' else share < 0.5
    ok = ok and (share_with < 0.05 and off > 2.5 if wrong else share_with > 0.95 and off < 0.6) and abs(said - np.pi / 2.0) < 0.1
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
