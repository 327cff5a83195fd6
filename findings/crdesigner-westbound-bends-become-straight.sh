#!/usr/bin/env bash
# CommonRoad scenario designer: a motorway bend becomes one straight line in OpenDRIVE if it leads west, and ends 49 m beside its place.
#
# Expected: commonroad_to_opendrive draws a left bend of 400 m radius and 200 m length (a vertex every metre) with arcs and clothoids, off by
# centimetres at most, whichever way it is turned on the map.
# What happens: a piece is a line while its heading stays the same, and the threshold of 0.1 degrees for that is used as a relative one: the
# turn of 0.14 degrees from vertex to vertex counts where the heading is near 0, and is nothing where the heading itself is
# 90 degrees or more. Turned by 90 to 240 degrees the whole bend is one line along its first heading, 49 m off at the end, with the right
# length; turned by 270 it is torn by 3.5 m. Eastbound it is right to a centimetre, and with vertices 5 m apart every way.
# The right files cannot be read back by the same package: they have spirals of one curvature, at which its reader raises AttributeError.
# Why it matters: a map with fine vertices loses the bends that lead west and keeps those that lead east, in a file that is
# consistent in itself.
#
# Output seen:
#   commonroad-scenario-designer 0.8.5
#   commonroad-io 2024.3
#   a vertex every 1 m, first heading 0 degrees: 12 pieces (lines: 1), 0.00 m off, gaps of 0.00 m; read back: Curvature at the start and at the end of a spiral must be different
#   a vertex every 1 m, first heading 30 degrees: 12 pieces (lines: 1), 0.00 m off, gaps of 0.00 m; read back: Curvature at the start and at the end of a spiral must be different
#   a vertex every 1 m, first heading 60 degrees: 7 pieces (lines: 1), 0.01 m off, gaps of 0.00 m; read back: Curvature at the start and at the end of a spiral must be different
#   a vertex every 1 m, first heading 90 degrees: 1 pieces (lines: 1), 48.75 m off, gaps of 0.00 m; read back it ends 49.5 m from its end
#   a vertex every 1 m, first heading 120 degrees: 1 pieces (lines: 1), 48.75 m off, gaps of 0.00 m; read back it ends 49.5 m from its end
#   a vertex every 1 m, first heading 150 degrees: 1 pieces (lines: 1), 48.75 m off, gaps of 0.00 m; read back it ends 49.5 m from its end
#   a vertex every 1 m, first heading 180 degrees: 1 pieces (lines: 1), 48.75 m off, gaps of 0.00 m; read back it ends 49.5 m from its end
#   a vertex every 1 m, first heading 210 degrees: 1 pieces (lines: 1), 48.75 m off, gaps of 0.00 m; read back it ends 49.5 m from its end
#   a vertex every 1 m, first heading 240 degrees: 1 pieces (lines: 1), 48.75 m off, gaps of 0.00 m; read back it ends 49.5 m from its end
#   a vertex every 1 m, first heading 270 degrees: 10 pieces (lines: 2), 2.99 m off, gaps of 3.49 m; read back it ends 0.0 m from its end
#   a vertex every 1 m, first heading 300 degrees: 12 pieces (lines: 1), 0.00 m off, gaps of 0.00 m; read back: Curvature at the start and at the end of a spiral must be different
#   a vertex every 1 m, first heading 330 degrees: 12 pieces (lines: 1), 0.00 m off, gaps of 0.00 m; read back: Curvature at the start and at the end of a spiral must be different
#   a vertex every 5 m, first heading 0 degrees: 12 pieces (lines: 1), 0.00 m off, gaps of 0.00 m; read back: Curvature at the start and at the end of a spiral must be different
#   a vertex every 5 m, first heading 180 degrees: 12 pieces (lines: 1), 0.00 m off, gaps of 0.00 m; read back: Curvature at the start and at the end of a spiral must be different
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps PyQt6==6.11.0 PyQt6_sip==13.13.0 PyYAML==6.0.4 antlr4-python3-runtime==4.9.3 certifi==2026.10.19.post1 charset-normalizer==3.5.3 commonroad-clcs==2025.2.0 commonroad-io==2024.3 commonroad-scenario-designer==0.8.5 commonroad-sumo==2025.1.4 commonroad-vehicle-models==3.0.2 cycler==0.12.1 fonttools==4.68.0 idna==3.20 iso3166==2.1.1 kdtree==0.16 kiwisolver==1.5.1 libsumo==1.28.0 lxml==6.1.3 matplotlib==3.11.2 mgrs==1.6.0 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 ordered-set==4.1.0 osqp==0.6.7.post3 packaging==26.4 pandas==2.3.3 pillow==13.0.0 protobuf==3.20.2 pyclothoids==0.1.5 pymetis==2025.2.2 pyparsing==3.3.3 pyproj==3.7.2 python-dateutil==4.0.0 pytz==2026.6 qdldl==0.1.9.post1 requests==2.34.2 rich==15.0.0 scipy==1.17.1 shapely==2.2.0 similaritymeasures==1.5.0 sumolib==1.28.0 tqdm==4.70.1 traci==1.28.0 typing_extensions==4.16.0 urllib3==2.8.0 PyQt6-Qt6==6.11.2 commonroad-drivability-checker==2025.4.0 Polygon3==3.0.9.1 mercantile==1.2.1 PyGeodesy==23.12.29 rtree==1.4.1 six==1.17.0 utm==0.7.0 click==8.5.1 sumo-data==1.28.0 contourpy==1.3.3
cd "$dir"
QT_QPA_PLATFORM=offscreen "$dir/venv/bin/python" -W ignore - <<'PY'
import logging
import xml.etree.ElementTree as ET
from contextlib import redirect_stdout
from importlib.metadata import version
from io import StringIO
from pathlib import Path

import numpy as np
from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile
from commonroad.planning.planning_problem import PlanningProblemSet
from commonroad.scenario.lanelet import Lanelet, LaneletType
from commonroad.scenario.scenario import Scenario, ScenarioID, Tag
from crdesigner.map_conversion.map_conversion_interface import commonroad_to_opendrive, opendrive_to_commonroad
from shapely.geometry import LineString, Point

for name in ('commonroad-scenario-designer', 'commonroad-io'):
    print(name, version(name))
logging.disable(logging.CRITICAL)
RADIUS, LENGTH, HALF = 400.0, 200.0, 1.75


def bend(turned, step):
    """A lanelet that bends to the left and begins at the origin with a heading."""
    s = np.arange(0.0, LENGTH + 1e-9, step)
    headings = turned + s / RADIUS
    centre = RADIUS * np.column_stack([np.sin(headings) - np.sin(turned), np.cos(turned) - np.cos(headings)])
    across = HALF * np.column_stack([-np.sin(headings), np.cos(headings)])
    return Lanelet(centre + across, centre, centre - across, 1, lanelet_type={LaneletType.URBAN})


def converted(lanelet):
    """Pieces of the reference line in the OpenDRIVE file (kind and points), and the lanelet that is read back."""
    scenario = Scenario(0.1, ScenarioID.from_benchmark_id('ZAM_Bend-1_1_T-1', '2020a'))
    scenario.add_objects(lanelet)
    with redirect_stdout(StringIO()):
        writer = CommonRoadFileWriter(scenario, PlanningProblemSet(), 'author', 'affiliation', 'source', {Tag.URBAN}, decimal_precision=10)
        writer.write_to_file('bend.xml', OverwriteExistingFile.ALWAYS)
        commonroad_to_opendrive(Path('bend.xml'), Path('bend.xodr'))
        try:
            back = opendrive_to_commonroad(Path('bend.xodr')).lanelet_network.lanelets[0]
        except AttributeError as error:
            back = error
    pieces = []
    for geometry in ET.parse('bend.xodr').iter('geometry'):
        x, y, heading, length = (float(geometry.get(key)) for key in ('x', 'y', 'hdg', 'length'))
        shape, s = geometry[0], np.linspace(0.0, length, 401)
        first, last = {'line': lambda: (0.0, 0.0), 'arc': lambda: 2 * (float(shape.get('curvature')),),
                       'spiral': lambda: (float(shape.get('curvStart')), float(shape.get('curvEnd')))}[shape.tag]()
        angles = heading + first * s + (last - first) * s**2 / (2.0 * length)
        steps = np.exp(0.5j * (angles[1:] + angles[:-1])) * length / 400
        line = x + 1j * y + np.concatenate([[0.0], np.cumsum(steps)])
        pieces.append((shape.tag, np.column_stack([line.real, line.imag])))
    return pieces, back


ok = True
for step in (1.0, 5.0):
    for degrees in range(0, 360, 30):
        lanelet = bend(np.radians(degrees), step)
        pieces, back = converted(lanelet)
        off = max(min(LineString(points).distance(Point(vertex)) for _, points in pieces) for vertex in lanelet.left_vertices)
        gap = max([float(np.hypot(*(after[0] - before[-1]))) for (_, before), (_, after) in zip(pieces, pieces[1:])] + [0.0])
        read = isinstance(back, Lanelet)
        end = float(np.hypot(*(back.center_vertices[-1] - lanelet.center_vertices[-1]))) if read else np.inf
        kinds = [kind for kind, _ in pieces]
        if step == 1.0 or degrees in (0, 180):
            print(f'a vertex every {step:.0f} m, first heading {degrees} degrees: {len(kinds)} pieces (lines: {kinds.count("line")}), {off:.2f} m off, '
                  f'gaps of {gap:.2f} m; ' + (f'read back it ends {end:.1f} m from its end' if read else f'read back: {back}'))
        if step == 1.0 and 90 <= degrees <= 240:
            ok = ok and kinds == ['line'] and 45.0 < off < 52.0 and 45.0 < end < 52.0
        elif step == 1.0 and degrees == 270:
            ok = ok and gap > 2.0
        else:
            ok = ok and off < 0.05 and gap < 0.05
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
