#!/usr/bin/env bash
# frenetix-occlusion: whether the car hit head-on counts as hit in front or from behind depends on which way the road runs on the map.
#
# Expected: the harm metric takes the side of the impact from where the other car is, seen from the one that is hit: one scene has one harm,
# whichever way it is turned.
# What happens: for a head-on encounter at 10 m/s each the other car's harm is 0.065 with the ego driving west or south, and 0.043, that of an
# impact from behind, with the ego driving east or north. For a car from the right the ego's harm is 0.049 (side) in all directions
# but west, 0.025 (from behind) there, and the other car's 0.050, 0.039 or 0.026. The risk, harm times probability, follows.
# Angles are formed as sums and differences of headings in (-pi, pi], not brought back into it, and whatever is beyond
# 135 degrees is "rear": a full turn is.
# Why it matters: a limit on the obstacle's risk passes a manoeuvre eastwards that it refuses westwards, with half as much again.
#
# Output seen:
#   frenetix-occlusion 2024.1.3
#   head-on, ego drives east: harm of the ego 0.063, of the other car 0.043
#   head-on, ego drives north: harm of the ego 0.063, of the other car 0.043
#   head-on, ego drives west: harm of the ego 0.063, of the other car 0.065
#   head-on, ego drives south: harm of the ego 0.063, of the other car 0.065
#   from the right, ego drives east: harm of the ego 0.049, of the other car 0.039
#   from the right, ego drives north: harm of the ego 0.049, of the other car 0.026
#   from the right, ego drives west: harm of the ego 0.025, of the other car 0.026
#   from the right, ego drives south: harm of the ego 0.049, of the other car 0.039
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps commonroad-drivability-checker==2025.4.0 commonroad-io==2023.4 commonroad-vehicle-models==3.0.2 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 frenetix-occlusion==2024.1.3 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 networkx==3.6.1 numpy==1.26.4 omegaconf==2.4.0 packaging==26.4 pillow==13.0.0 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==4.0.0 PyYAML==6.0.4 rtree==1.4.1 scipy==1.13.1 shapely==2.0.7 tqdm==4.70.1 tzdata==2026.6
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
from types import SimpleNamespace

import numpy as np
from frenetix_occlusion.metrics.cp import CP
from frenetix_occlusion.metrics.hr import HR

print('frenetix-occlusion', version('frenetix-occlusion'))
CAR = SimpleNamespace(length=4.5, width=1.8, mass=1500.0, wb_rear_axle=1.4)
TIMES = np.arange(31) * 0.1
SCENES = {'head-on': (np.pi, (40.0, 0.0)), 'from the right': (np.pi / 2, (20.0, -20.0))}
NAMES = {'east': 0.0, 'north': 90.0, 'west': 180.0, 'south': -90.0}


def harm(way, heading, start):
    """Harm of the ego and of another car, 10 m/s each, at the first step of a scene turned by an angle in degrees."""
    way = np.deg2rad(way) + 1e-4  # off the axis, so that no angle is exactly at a border
    turn = np.array([[np.cos(way), -np.sin(way)], [np.sin(way), np.cos(way)]])
    ego = np.outer(10.0 * TIMES, (1.0, 0.0)) @ turn.T
    other = (np.array(start) + np.outer(10.0 * TIMES, (np.cos(heading), np.sin(heading)))) @ turn.T
    headings = [np.full(TIMES.size, np.angle(np.exp(1j * angle))) for angle in (way, way + heading)]
    speed = np.full(TIMES.size, 10.0)
    cartesian = SimpleNamespace(x=ego[:, 0], y=ego[:, 1], theta=headings[0], v=speed, a=0.0 * TIMES)
    prediction = {'pos_list': other, 'cov_list': np.tile(0.3 * np.eye(2), (TIMES.size, 1, 1)), 'orientation_list': headings[1],
                  'v_list': speed, 'shape': {'length': 4.5, 'width': 1.8}}
    agents = SimpleNamespace(predictions={1: prediction}, agent_by_prediction_id=lambda _: SimpleNamespace(agent_type='Car'))
    trajectory = SimpleNamespace(cartesian=cartesian)
    result = HR(CAR, agents).evaluate(trajectory, {'cp': CP(CAR, agents).evaluate(trajectory, {})})[1]
    return result['ego_harm_traj'][0], result['obst_harm_traj'][0]


seen = {}
for scene, (heading, start) in SCENES.items():
    for name, way in NAMES.items():
        seen[scene, name] = harm(way, heading, start)
        print('{}, ego drives {}: harm of the ego {:.3f}, of the other car {:.3f}'.format(scene, name, *seen[scene, name]))
others = [seen['head-on', name][1] for name in NAMES]
ok = np.allclose(others, (0.0430, 0.0430, 0.0646, 0.0646), atol=1e-3)
ok = ok and np.allclose([seen['from the right', name][0] for name in NAMES], (0.0487, 0.0487, 0.0254, 0.0487), atol=1e-3)
ok = ok and np.ptp([seen['from the right', name][1] for name in NAMES]) > 0.01
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
