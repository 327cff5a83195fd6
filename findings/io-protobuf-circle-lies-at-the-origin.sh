#!/usr/bin/env bash
# commonroad-io: a circle that is read from a protobuf file lies at the origin for
# every geometric look-up.
#
# Expected: the same scenario read from XML and from protobuf answers the same.
# What happens: the protobuf reader makes a circle at (0, 0) and then sets its
# centre; the Shapely object behind it is not made anew. circle.center and
# contains_point are right, shapely_object, and with it find_lanelet_by_shape, the
# extent of uncertain positions and every use in Shapely, are at the origin. From
# XML they are right. Setting circle.center (or .radius) by hand does the same; and
# the centre of a rectangle whose vertices were asked for before stays as well.
# Why it matters: the predicted set of a pedestrian (phantom obstacles, set-based
# predictions) is matched to the lanelets at (0, 0): the crossing's lane is free.
#
# Output seen:
#   commonroad-io 2024.3
#   protobuf 3.20.2
#   s.xml centre [50.0, 40.0], shapely object at (50.0, 40.0), on lanelets [2]
#   s.pb  centre [50.0, 40.0], shapely object at (-0.0, 0.0), on lanelets [1]
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-io==2024.3 numpy==2.4.6 scipy==1.17.1 shapely==2.2.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
for name in ['commonroad-io', 'protobuf']:
    print(name, version(name))
import contextlib, io
import numpy as np
from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.common.file_writer import CommonRoadFileWriter, FileFormat, OverwriteExistingFile
from commonroad.geometry.shape import Circle
from commonroad.planning.planning_problem import PlanningProblemSet
from commonroad.prediction.prediction import Occupancy, SetBasedPrediction
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.obstacle import PhantomObstacle
from commonroad.scenario.scenario import Location, Scenario, Tag

x = np.linspace(-100.0, 100.0, 21)
def lanelet(number, low):
    left, right = np.c_[x, np.full(21, low + 4.0)], np.c_[x, np.full(21, low)]
    return Lanelet(left, (left + right) / 2, right, number)

scenario = Scenario(0.1, author="a", affiliation="b", source="c", tags={Tag.URBAN}, location=Location())
scenario.add_objects([lanelet(1, -2.0), lanelet(2, 38.0)])
sets = [Occupancy(k, Circle(1.5, np.array([50.0, 40.0]))) for k in range(3)]
scenario.add_objects(PhantomObstacle(9, SetBasedPrediction(0, sets)))
found = {}
for file_format, name in ((FileFormat.XML, "s.xml"), (FileFormat.PROTOBUF, "s.pb")):
    with contextlib.redirect_stdout(io.StringIO()):
        CommonRoadFileWriter(scenario, PlanningProblemSet(), "a", "b", "c", {Tag.URBAN}, Location(),
                             file_format=file_format).write_to_file(name, OverwriteExistingFile.ALWAYS)
    read, _ = CommonRoadFileReader(name, file_format=file_format).open()
    circle = read.phantom_obstacle[0].occupancy_at_time(1).shape
    middle = circle.shapely_object.centroid
    found[name] = (circle.center.tolist(), (round(middle.x, 6), round(middle.y, 6)),
                   read.lanelet_network.find_lanelet_by_shape(circle))
    print(f"{name:5s} centre {found[name][0]}, shapely object at {found[name][1]}, on lanelets {found[name][2]}")
assert found["s.xml"] == ([50.0, 40.0], (50.0, 40.0), [2])
assert found["s.pb"] == ([50.0, 40.0], (0.0, 0.0), [1])
print("behaviour as stated")
PY
