#!/usr/bin/env bash
# Scenic: each bend of an OpenDRIVE road is drawn through 20 points, however long: on a ring of 200 m radius over half of the lap is off the road.
#
# Expected: reading a map with the default tolerance of 5 cm gives lanes that are where the file has them: a car on the centre of its lane
# is on that lane, whose direction is the car's.
# What happens: ref_points=20 is the number for a whole arc, spiral or curve. On one arc of 342 degrees they are 63 m apart at a radius of
# 200 m, and the polygons run up to 2.5 m inside of the bend: 55 % of the places on the outer lane's centre are on no lane, and 54 %
# of those on the inner one are on the outer lane, against its direction. With 200 points all are right. A
# half circle of 400 m radius is 1.3 m off.
# The limits of the file, on its type of road or on its lanes, are not read: speedLimit is None everywhere. And rule="LHT" is not
# read, so that both lanes of a left-hand road run the wrong way (0 degrees for 180), although the parser has a switch for it.
# Why it matters: scenarios place cars on lanes by this map, the simulator drives them on its own, which is the file's.
#
# Output seen:
#   scenic 3.1.1
#   radius 20 m, 342 degrees, 20 points (chords 0.25 m inside by hand): of the outer lane 0 % are on no lane, 0 % on the oncoming one, of the inner lane 0 % and 0 %
#   radius 200 m, 342 degrees, 20 points (chords 2.46 m inside by hand): of the outer lane 55 % are on no lane, 0 % on the oncoming one, of the inner lane 0 % and 54 %
#   radius 200 m, 342 degrees, 200 points (chords 0.02 m inside by hand): of the outer lane 0 % are on no lane, 0 % on the oncoming one, of the inner lane 0 % and 0 %
#   radius 400 m, 172 degrees, 20 points (chords 1.25 m inside by hand): of the outer lane 0 % are on no lane, 0 % on the oncoming one, of the inner lane 0 % and 0 %
#   straight road to the east: its southern lane runs at 0 degrees, limits ['None'], road None
#   straight road to the east rule="RHT": its southern lane runs at 0 degrees, limits ['None'], road None
#   straight road to the east rule="LHT": its southern lane runs at 0 degrees, limits ['None'], road None
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps antlr4-python3-runtime==4.13.2 attrs==26.1.0 contourpy==1.3.3 cycler==0.12.1 Cython==3.3.1 dotmap==1.3.30 fonttools==4.68.0 ImageIO==2.38.1 kiwisolver==1.5.1 lazy-loader==0.6 manifold3d==3.5.4 mapbox_earcut==2.1.0 matplotlib==3.11.2 networkx==3.6.1 numpy==2.4.6 opencv-python==4.14.0.94 packaging==26.4 pegen==0.3.0 pillow==13.0.0 pygame-ce==2.5.8 pyglet==1.5.26 pyparsing==3.3.3 python-dateutil==4.0.0 python-fcl==0.7.0.11 rtree==1.4.1 rv_ltl==0.1.1 scenic==3.1.1 scikit-image==0.26.0 scipy==1.17.1 shapely==2.2.0 tifffile==2026.3.3 trimesh==4.12.2 tzdata==2026.6 
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import numpy as np
from scenic.core.vectors import Vector
from scenic.domains.driving.roads import Network

print('scenic', version('scenic'))
WIDTH, PLACES = 3.5, 400


def network(geometry, length, rule='', points=20):
    """Network of one road with a lane on either side, with limits of 50 km/h by its type and 8 m/s on its lanes."""
    lanes = ''.join(
        f'<{side}><lane id="{number}" type="driving" level="false"><link/><width sOffset="0" a="{WIDTH}" b="0" c="0" d="0"/>'
        f'<speed sOffset="0" max="8" unit="m/s"/></lane></{side}>' + ('<center><lane id="0" type="none" level="false"/></center>' if side == 'left' else '')
        for side, number in (('left', 1), ('right', -1)))
    with open('road.xodr', 'w', encoding='utf-8') as file:
        file.write(
            '<?xml version="1.0"?><OpenDRIVE><header revMajor="1" revMinor="6" name="" version="1" north="0" south="0" east="0" west="0"/>'
            f'<road name="" length="{length}" id="1" junction="-1"{rule}><link/><type s="0" type="town"><speed max="50" unit="km/h"/></type><planView>'
            f'<geometry s="0" x="0" y="0" hdg="0" length="{length}">{geometry}</geometry></planView><elevationProfile/><lateralProfile/>'
            f'<lanes><laneSection s="0">{lanes}</laneSection></lanes></road></OpenDRIVE>')
    return Network.fromOpenDrive('road.xodr', ref_points=points)


def arc(radius, turned, points=20):
    """For the outer and the inner lane of a left bend: share of places on the centre that are on no lane, and on one against them."""
    found, shares = network(f'<arc curvature="{1.0 / radius}"/>', radius * turned, points=points), []
    for side in (1.0, -1.0):
        nowhere = against = 0
        for angle in np.linspace(0.01, turned - 0.01, PLACES):
            r = radius + side * WIDTH / 2.0
            place = Vector(r * np.sin(angle), radius - r * np.cos(angle))
            if found.laneAt(place) is None:
                nowhere += 1
                continue
            drives = found.roadDirection[place].yaw + np.pi / 2.0 + (0.0 if side > 0.0 else np.pi)
            against += abs((drives - angle + np.pi) % (2.0 * np.pi) - np.pi) > np.pi / 2.0
        shares += [nowhere / PLACES, against / PLACES]
    return shares


ok = True
for radius, degrees, points in ((20.0, 342, 20), (200.0, 342, 20), (200.0, 342, 200), (400.0, 172, 20)):
    shares, sag = arc(radius, np.radians(degrees), points), radius * (1.0 - np.cos(np.radians(degrees) / (points - 1) / 2.0))
    print(f'radius {radius:.0f} m, {degrees} degrees, {points} points (chords {sag:.2f} m inside by hand): of the outer lane {100.0 * shares[0]:.0f} % are on no lane, '
          f'{100.0 * shares[1]:.0f} % on the oncoming one, of the inner lane {100.0 * shares[2]:.0f} % and {100.0 * shares[3]:.0f} %')
    ok = ok and (shares[0] > 0.4 and shares[3] > 0.3 if (radius, points) == (200.0, 20) else max(shares) < 0.02)
for rule in ('', ' rule="RHT"', ' rule="LHT"'):
    found = network('<line/>', 200.0, rule)
    direction = np.degrees(found.roadDirection[Vector(100.0, -1.75)].yaw) + 90.0
    print(f'straight road to the east{rule}: its southern lane runs at {direction % 360.0:.0f} degrees, limits {sorted({str(lane.speedLimit) for lane in found.lanes})}, '
          f'road {found.roads[0].speedLimit}')
    ok = ok and abs((direction + 180.0) % 360.0 - 180.0) < 1.0 and all(lane.speedLimit is None for lane in found.lanes) and found.roads[0].speedLimit is None
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
