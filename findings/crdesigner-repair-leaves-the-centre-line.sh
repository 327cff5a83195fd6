#!/usr/bin/env bash
# CommonRoad scenario designer: the map repair moves the bounds of lanelets and leaves the centre line: half-way along, the left bound is at a quarter.
#
# Expected: verify_and_repair_scenario makes a map consistent: the centre line lies in the middle of its bounds, vertex by vertex, and points on
# the three at one distance are beside each other.
# What happens: two neighbours that share a border, with a vertex every 5 m in one and every 2.5 m in the other, are not valid by the
# verification, and the repair gives the first one the bounds of the second with their 41 vertices, while its centre
# line keeps 21: interpolate_position(50.0) is at x = 50 m on the centre line and at 25 m on both bounds. Neighbours 30 or 90 cm
# apart get one border half-way, and centre lines that are as before, up to 22 cm off the middle. Verified again,
# all are valid; written to a file and read again they are another map, in which the centre lines are right.
# Why it matters: planners take the reference path from centre lines and the room from bounds, of the scenario in memory.
#
# Output seen:
#   commonroad-scenario-designer 0.8.5
#   commonroad-io 2024.3
#   21 and 21 vertices, 0.0 m apart: valid True; repaired: valid True
#     lanelet 1: left, centre and right have (21, 21, 21) vertices, half-way is x = 50 m on the centre and 50 m on the left, centre 0.000 m off the middle; read again (21, 21, 21), 50 m, 0.000 m
#     lanelet 2: left, centre and right have (21, 21, 21) vertices, half-way is x = 50 m on the centre and 50 m on the left, centre 0.000 m off the middle; read again (21, 21, 21), 50 m, 0.000 m
#   21 and 41 vertices, 0.0 m apart: valid False; repaired: valid True
#     lanelet 1: left, centre and right have (41, 21, 41) vertices, half-way is x = 50 m on the centre and 25 m on the left, centre 0.000 m off the middle; read again (41, 41, 41), 50 m, 0.000 m
#     lanelet 2: left, centre and right have (41, 41, 41) vertices, half-way is x = 50 m on the centre and 50 m on the left, centre 0.000 m off the middle; read again (41, 41, 41), 50 m, 0.000 m
#   21 and 21 vertices, 0.3 m apart: valid False; repaired: valid True
#     lanelet 1: left, centre and right have (21, 21, 21) vertices, half-way is x = 50 m on the centre and 50 m on the left, centre 0.075 m off the middle; read again (21, 21, 21), 50 m, 0.000 m
#     lanelet 2: left, centre and right have (21, 21, 21) vertices, half-way is x = 50 m on the centre and 50 m on the left, centre 0.075 m off the middle; read again (21, 21, 21), 50 m, 0.000 m
#   21 and 21 vertices, 0.9 m apart: valid False; repaired: valid True
#     lanelet 1: left, centre and right have (21, 21, 21) vertices, half-way is x = 50 m on the centre and 50 m on the left, centre 0.225 m off the middle; read again (21, 21, 21), 50 m, 0.000 m
#     lanelet 2: left, centre and right have (21, 21, 21) vertices, half-way is x = 50 m on the centre and 50 m on the left, centre 0.225 m off the middle; read again (21, 21, 21), 50 m, 0.000 m
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps PyQt6==6.11.0 PyQt6_sip==13.13.0 PyYAML==6.0.4 antlr4-python3-runtime==4.9.3 certifi==2026.10.19.post1 charset-normalizer==3.5.3 commonroad-clcs==2025.2.0 commonroad-io==2024.3 commonroad-scenario-designer==0.8.5 commonroad-sumo==2025.1.4 commonroad-vehicle-models==3.0.2 cycler==0.12.1 fonttools==4.68.0 idna==3.20 iso3166==2.1.1 kdtree==0.16 kiwisolver==1.5.1 libsumo==1.28.0 lxml==6.1.3 matplotlib==3.11.2 mgrs==1.6.0 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 ordered-set==4.1.0 osqp==0.6.7.post3 packaging==26.4 pandas==2.3.3 pillow==13.0.0 protobuf==3.20.2 pyclothoids==0.1.5 pymetis==2025.2.2 pyparsing==3.3.3 pyproj==3.7.2 python-dateutil==4.0.0 pytz==2026.6 qdldl==0.1.9.post1 requests==2.34.2 rich==15.0.0 scipy==1.17.1 shapely==2.2.0 similaritymeasures==1.5.0 sumolib==1.28.0 tqdm==4.70.1 traci==1.28.0 typing_extensions==4.16.0 urllib3==2.8.0 PyQt6-Qt6==6.11.2 commonroad-drivability-checker==2025.4.0 Polygon3==3.0.9.1 mercantile==1.2.1 PyGeodesy==23.12.29 rtree==1.4.1 six==1.17.0 utm==0.7.0 click==8.5.1 sumo-data==1.28.0 contourpy==1.3.3
cd "$dir"
QT_QPA_PLATFORM=offscreen "$dir/venv/bin/python" -W ignore - <<'PY'
import logging
from contextlib import redirect_stdout
from importlib.metadata import version
from io import StringIO

import numpy as np
from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile
from commonroad.planning.planning_problem import PlanningProblemSet
from commonroad.scenario.lanelet import Lanelet, LaneletType
from commonroad.scenario.scenario import Scenario, ScenarioID, Tag
from crdesigner.verification_repairing.map_verification_repairing import verify_and_repair_scenario

for name in ('commonroad-scenario-designer', 'commonroad-io'):
    print(name, version(name))
logging.disable(logging.CRITICAL)
LENGTH, WIDTH = 100.0, 3.5


def road(numbers, apart):
    """Two lanes to the east, the left one some metres further from the right one than its width, with numbers of vertices."""
    scenario = Scenario(0.1, ScenarioID.from_benchmark_id('ZAM_Road-1_1_T-1', '2020a'))
    for lane, number in enumerate(numbers):
        x, y = np.linspace(0.0, LENGTH, number), lane * (WIDTH + apart)
        right, centre, left = (np.column_stack([x, np.full(number, y + shift)]) for shift in (-WIDTH / 2.0, 0.0, WIDTH / 2.0))
        beside = {'adjacent_left': 2, 'adjacent_left_same_direction': True} if lane == 0 else {'adjacent_right': 1, 'adjacent_right_same_direction': True}
        scenario.add_objects(Lanelet(left, centre, right, lane + 1, lanelet_type={LaneletType.URBAN}, **beside))
    return scenario


def quietly(function, *arguments):
    """The answer of a function that talks."""
    with redirect_stdout(StringIO()):
        return function(*arguments)


def reread(scenario):
    """The scenario after it has been written to a file."""
    writer = CommonRoadFileWriter(scenario, PlanningProblemSet(), 'author', 'affiliation', 'source', {Tag.URBAN}, decimal_precision=10)
    writer.write_to_file('map.xml', OverwriteExistingFile.ALWAYS)
    return CommonRoadFileReader('map.xml').open()[0]


def state(scenario):
    """For both lanelets: numbers of vertices, x on centre, right and left half-way, and how far the centre line is off the middle."""
    found = []
    for lanelet in scenario.lanelet_network.lanelets:
        numbers = tuple(len(line) for line in (lanelet.left_vertices, lanelet.center_vertices, lanelet.right_vertices))
        halfway = tuple(float(point[0]) for point in lanelet.interpolate_position(LENGTH / 2.0)[:3])
        middle = (lanelet.left_vertices[:, 1].mean() + lanelet.right_vertices[:, 1].mean()) / 2.0
        found.append((numbers, halfway, float(abs(lanelet.center_vertices[:, 1].mean() - middle))))
    return found


ok = True
for numbers, apart in (((21, 21), 0.0), ((21, 41), 0.0), ((21, 21), 0.3), ((21, 21), 0.9)):
    before = road(numbers, apart)
    repaired, was_valid = quietly(verify_and_repair_scenario, before)
    _, is_valid = quietly(verify_and_repair_scenario, repaired)
    print(f'{numbers[0]} and {numbers[1]} vertices, {apart:.1f} m apart: valid {was_valid}; repaired: valid {is_valid}')
    after, again = state(repaired), state(quietly(reread, repaired))
    for number, ((vertices, halfway, off), (vertices_again, halfway_again, off_again)) in enumerate(zip(after, again), 1):
        print(f'  lanelet {number}: left, centre and right have {vertices} vertices, half-way is x = {halfway[0]:.0f} m on the centre and {halfway[2]:.0f} m on the left, '
              f'centre {off:.3f} m off the middle; read again {vertices_again}, {halfway_again[2]:.0f} m, {off_again:.3f} m')
        ok = ok and off_again < 0.001 and abs(halfway_again[2] - 50.0) < 0.1
    ok = ok and is_valid and was_valid == (numbers == (21, 21) and apart == 0.0)
    if numbers == (21, 41):
        ok = ok and after[0][0] == (41, 21, 41) and abs(after[0][1][2] - 25.0) < 1.5
    else:
        ok = ok and all(abs(off - apart / 4.0) < 0.001 for _, _, off in after)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
