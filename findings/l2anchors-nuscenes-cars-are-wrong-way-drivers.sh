#!/usr/bin/env bash
# lanelet2anchors: a car read from nuScenes points backwards, and is matched to its own lane as a wrong-way driver, with certainty.
#
# Expected: VehiclePose.from_nusc takes the quaternion of a nuScenes pose record (scalar first), as the package's own loader hands it over,
# and gives the car's heading, so that the matching takes a car that drives along its lane for one that does.
# What happens: every heading comes out turned by half a turn: 180 degrees for a car that drives east, -150 for 30. SciPy takes the scalar
# last, so the rotation is read as one about the x axis by pi less the yaw; inverted, its x component is the yaw less pi.
# The bounding box is symmetric, so lane, distance and plot of the box are right. But the match of a car on its lane is the inverted
# lanelet, probability 1, with the own heading 36 standard deviations off; for a wrong-way driver it is the lanelet as it is.
# Why it matters: the package is for nuScenes, and the direction of the match is what tells a wrong-way driver.
#
# Output seen:
#   lanelet2anchors 0.1.0, lanelet2 1.2.3, scipy 1.17.1
#   lane at 0 degrees, car along it: heading off by 180 degrees, matched against its direction: True (probability 1.00), with the heading as it is: False
#   lane at 0 degrees, car against it: heading off by 180 degrees, matched against its direction: False (probability 1.00), with the heading as it is: True
#   lane at 30 degrees, car along it: heading off by 180 degrees, matched against its direction: True (probability 1.00), with the heading as it is: False
#   lane at 30 degrees, car against it: heading off by 180 degrees, matched against its direction: False (probability 1.00), with the heading as it is: True
#   lane at 90 degrees, car along it: heading off by 180 degrees, matched against its direction: True (probability 1.00), with the heading as it is: False
#   lane at 90 degrees, car against it: heading off by 180 degrees, matched against its direction: False (probability 1.00), with the heading as it is: True
#   lane at -120 degrees, car along it: heading off by 180 degrees, matched against its direction: True (probability 1.00), with the heading as it is: False
#   lane at -120 degrees, car against it: heading off by 180 degrees, matched against its direction: False (probability 1.00), with the heading as it is: True
#   lane at 179 degrees, car along it: heading off by 180 degrees, matched against its direction: True (probability 1.00), with the heading as it is: False
#   lane at 179 degrees, car against it: heading off by 180 degrees, matched against its direction: False (probability 1.00), with the heading as it is: True
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps contourpy==1.3.3 cycler==0.12.1 fastdtw==0.3.4 fonttools==4.68.0 kiwisolver==1.5.1 lanelet2==1.2.3 lanelet2anchors==0.1.0 matplotlib==3.11.2 networkx==2.8.8 numpy==1.26.4 packaging==26.4 pillow==13.0.0 pyparsing==3.3.3 python-dateutil==4.0.0 scipy==1.17.1 Shapely==1.8.5.post1
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import lanelet2
import numpy as np
from lanelet2.core import Lanelet, LaneletMap, LineString3d, Point3d
from lanelet2anchors import AnchorGenerator
from lanelet2anchors.anchor_tools.lanelet_matching import VehiclePose

print(f"lanelet2anchors {version('lanelet2anchors')}, lanelet2 {version('lanelet2')}, scipy {version('scipy')}")


def road(degrees):
    """A lane of 100 m with a direction on the map, its centre line through (100, 100), as a map that has been read."""
    way = np.deg2rad(degrees)
    turn = np.array([[np.cos(way), -np.sin(way)], [np.sin(way), np.cos(way)]])

    def line(number, left):
        ends = np.array([(-50.0, left), (0.0, left), (50.0, left)]) @ turn.T + 100.0
        bound = LineString3d(number, [Point3d(number + k + 1, x, y, 0.0) for k, (x, y) in enumerate(ends)])
        bound.attributes['type'], bound.attributes['subtype'] = 'line_thin', 'solid'
        return bound

    lane = Lanelet(1000, line(100, 1.75), line(200, -1.75))
    for key, value in {'type': 'lanelet', 'subtype': 'road', 'location': 'nonurban', 'one_way': 'yes'}.items():
        lane.attributes[key] = value
    world = LaneletMap()
    world.add(lane)
    lanelet2.io.write('road.osm', world, lanelet2.projection.UtmProjector(lanelet2.io.Origin(49.0, 8.4)))
    return AnchorGenerator('road.osm', 49.0, 8.4)


def match(world, pose):
    """Whether the lane is matched against its direction, and the probability."""
    found = world.match_vehicle_onto_lanelets_probabilistically(pose)[1000]
    return found.lanelet.inverted(), found.probability


ok = True
for degrees in (0.0, 30.0, 90.0, -120.0, 179.0):
    world = road(degrees)
    for name, yaw in (('along', degrees), ('against', degrees + 180.0)):
        half = np.deg2rad(yaw) / 2.0
        record = np.array([np.cos(half), 0.0, 0.0, np.sin(half)])  # w, x, y, z, as in nuScenes
        read = VehiclePose.from_nusc(100.0, 100.0, record, 2.0, 4.5)
        own = VehiclePose(100.0, 100.0, np.deg2rad(yaw), read.bbox, 4.5, 2.0)
        turned = np.rad2deg(np.angle(np.exp(1j * (read.psi - np.deg2rad(yaw)))))
        (wrong, sure), (own_wrong, _) = match(world, read), match(world, own)
        print(f'lane at {degrees:.0f} degrees, car {name} it: heading off by {abs(turned):.0f} degrees, matched against its direction: '
              f'{wrong} (probability {sure:.2f}), with the heading as it is: {own_wrong}')
        ok = ok and abs(abs(turned) - 180.0) < 1e-6 and wrong == (name == 'along') and own_wrong == (name == 'against') and sure > 0.99
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
