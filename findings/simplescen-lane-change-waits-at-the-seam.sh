#!/usr/bin/env bash
# simple-scenario: a lane change that goes on over the end of a lanelet stands on the spot there and slides sideways at 20 m/s.
#
# Expected: the same two lanes of 600 m, as one lanelet each or cut into three: a car that changes lanes within 3 s drives the same.
# What happens: with a cut at 200 m, 20 m before which the lane change begins, the car goes on to the cut, stands there for 2 s, moves
# 3 m sideways on the spot, its nose turned by 90 degrees, and goes on 40 m behind where it would be. Its speed is 20 m/s all
# the time. The lane change is laid along the lanelet in which it begins, and a place beyond the end of that is its end.
# In a bend the car has lost the same 40 m.
# Why it matters: real maps are cut every few dozen metres; the cut-in that a test is about happens with a step of the speed from 20
# to 0 and back, and with a gap to the ego that is 40 m off, while start, end lane and recorded speed are right.
#
# Output seen:
#   simple_scenario 1.0.1, lanelet2 1.2.3
#   straight, one lanelet of 600 m: 238 m in 12 s, steps of 2.00 to 2.01 m, speed 20 to 20 m/s, heading turns by up to 1 degrees from step to step
#   straight, cut at 200 and 400 m: 201 m in 12 s, steps of 0.00 to 2.01 m, speed 20 to 20 m/s, heading turns by up to 90 degrees from step to step
#   bend of 400 m, one lanelet of 600 m: 238 m in 12 s, steps of 1.96 to 2.01 m, speed 20 to 20 m/s, heading turns by up to 1 degrees from step to step
#   bend of 400 m, cut at 200 and 400 m: 201 m in 12 s, steps of 0.00 to 2.01 m, speed 20 to 20 m/s, heading turns by up to 89 degrees from step to step
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps certifi==2026.10.19.post1 commonroad-vehicle-models==3.0.2 contourpy==1.3.3 cycler==0.12.1 elementpath==5.1.4 fonttools==4.68.0 kiwisolver==1.5.1 lanelet2==1.2.3 loguru==0.7.3 lxml==6.1.3 matplotlib==3.11.2 numpy==2.4.6 omegaconf==2.4.0 packaging==26.4 pandas==3.1.1 pillow==13.0.0 pybind11==3.1.0 pyclothoids==0.2.0 pyparsing==3.3.3 pyproj==3.7.2 python-dateutil==4.0.0 PyYAML==6.0.4 scenariogeneration==0.16.7 scipy==1.17.1 simple-scenario==1.0.1 tqdm==4.70.1 typing_extensions==4.16.0 xmlschema==4.3.2
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version

import lanelet2
import numpy as np
from lanelet2.core import Lanelet, LaneletMap, LineString3d, Point3d
from loguru import logger

logger.remove()
from simple_scenario import EgoConfiguration, Scenario, Vehicle  # noqa: E402
from simple_scenario.road import MappedRoad  # noqa: E402

print(f"simple_scenario {version('simple-scenario')}, lanelet2 {version('lanelet2')}")
PROJECTION = '+proj=tmerc +lat_0=50 +lon_0=9 +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m'
LANELET = {'type': 'lanelet', 'subtype': 'highway', 'location': 'nonurban', 'one_way': 'yes', 'participant:vehicle': 'yes'}


def mapped(cuts, radius):
    """Two lanes of one direction along a straight line (radius inf) or an arc to the left, cut at some lengths."""
    points, lines, world = {}, {}, LaneletMap()

    def point(along, left):
        if (along, left) not in points:
            x, y = along, left
            if np.isfinite(radius):
                x, y = (radius - left) * np.sin(along / radius), radius - (radius - left) * np.cos(along / radius)
            points[along, left] = Point3d(len(points) + 1, float(x), float(y), 0.0)
        return points[along, left]

    def line(start, end, left):
        if (start, left) not in lines:
            lines[start, left] = LineString3d(5000 + len(lines), [point(s, left) for s in np.arange(start, end + 1.0, 5.0)])
            lines[start, left].attributes['type'] = 'line_thin'
            lines[start, left].attributes['subtype'] = 'solid' if left else 'dashed'
        return lines[start, left]

    for part, (start, end) in enumerate(zip(cuts[:-1], cuts[1:])):
        for lane, (right, left) in enumerate(((-3.5, 0.0), (0.0, 3.5))):
            lanelet = Lanelet(9000 + 10 * part + lane, line(start, end, left), line(start, end, right))
            for key, value in LANELET.items():
                lanelet.attributes[key] = value
            world.add(lanelet)
    lanelet2.io.write('road.osm', world, lanelet2.projection.UtmProjector(lanelet2.io.Origin(50.0, 9.0)))
    with open('road.xodr', 'w') as file:
        file.write(f'<OpenDRIVE><header><geoReference><![CDATA[{PROJECTION}]]></geoReference></header></OpenDRIVE>')
    return MappedRoad('road.xodr', 'road.osm'), 9000 + 10 * (len(cuts) - 2)


seen = {}
for shape, radius in (('straight', np.inf), ('bend of 400 m', 400.0)):
    for name, cuts in (('one lanelet of 600 m', (0.0, 600.0)), ('cut at 200 and 400 m', (0.0, 200.0, 400.0, 600.0))):
        road, last = mapped(cuts, radius)
        ego = EgoConfiguration(start_lanelet_id=9000, start_s=10.0, start_t=0.0, target_lanelet_id=last, target_s=50.0, target_t=0.0, v0=20.0)
        car = Vehicle(1, start_lanelet_id=9000, start_s=100.0, start_t=0.0, target_lanelet_id=last + 1, v0=20.0,
                      lc_direction=1, lc_delay=4.0, lc_duration=3.0)
        Scenario('a road', road, ego, [car], 12.0, 0.1)
        steps = np.hypot(np.diff(car.x), np.diff(car.y))
        turned = np.rad2deg(np.abs(np.angle(np.exp(1j * np.diff(car.heading))))).max()
        seen[shape, name] = steps.sum(), steps.min(), steps.max(), car.v.min(), car.v.max(), turned
        print('{}, {}: {:.0f} m in 12 s, steps of {:.2f} to {:.2f} m, speed {:.0f} to {:.0f} m/s, heading turns by up to {:.0f} '
              'degrees from step to step'.format(shape, name, *seen[shape, name]))
ok = all(row[3] == row[4] == 20.0 and row[2] < 2.1 for row in seen.values())
for (_, name), row in seen.items():
    whole = name.startswith('one')
    ok = ok and (row[0] > 235.0 and row[1] > 1.9 and row[5] < 2.0 if whole else row[0] < 205.0 and row[1] < 0.1 and row[5] > 60.0)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
