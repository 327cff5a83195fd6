#!/usr/bin/env bash
# nuscenes-devkit: of a car that reverses out of its parking place all physics models predict that it drives into it.
#
# Expected: the baselines of the prediction challenge go on from the annotated motion. A car that points east and has
# reversed at 2 m/s is 12 m further west after 6 s by constant velocity; the oracle, the best of four models, is right.
# What happens: the speed of an agent is the length of its displacement, without a sign, and the models send it along the
# heading. The car is predicted 12 m to the east, 24 m from where it goes, by the velocity model and by the oracle, for
# which no model is better. The same car turned by half a circle, so that it drives forward, is predicted right.
# Why it matters: who backs out of a parking place is the one to expect from there; as a baseline the error is blamed
# on the agent. get_acceleration_for_agent is positive while the car speeds up backwards, too.
#
# Output seen:
#   nuscenes-devkit 1.2.0
#   forward: 2.00 m/s, +0.00 m/s², after 6 s at -12.0 m; constant velocity -12.0 m, best of four -12.0 m
#   in reverse: 2.00 m/s, +0.00 m/s², after 6 s at -12.0 m; constant velocity +12.0 m, best of four +12.0 m
#   in reverse, faster: 1.95 m/s, +0.20 m/s², after 6 s at -15.6 m; constant velocity +11.7 m, best of four +11.7 m
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps nuscenes-devkit==1.2.0 cachetools==8.0.2 cloudpickle==3.1.3 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 joblib==1.6.0 kiwisolver==1.5.1 matplotlib==3.11.2 narwhals==2.29.0 numpy==1.26.4 opencv-python-headless==4.11.0.86 packaging==26.4 pillow==13.0.0 pyparsing==3.3.3 pyquaternion==0.9.9 python-dateutil==4.0.0 scikit-learn==1.9.1 scipy==1.17.1 six==1.17.0 threadpoolctl==3.8.0 tqdm==4.70.1
cd "$dir"
MPLCONFIGDIR="$dir" "$dir/venv/bin/python" -W ignore - <<'PY'
import json
import math
from importlib.metadata import version
from pathlib import Path

import numpy as np
from nuscenes import NuScenes
from nuscenes.prediction import PredictHelper
from nuscenes.prediction.models.physics import ConstantVelocityHeading, PhysicsOracle
from PIL import Image

print('nuscenes-devkit', version('nuscenes-devkit'))
PAST, FUTURE, STEP = 4, 12, 0.5


def recording(name, heading, places):
    """The tables of a recording of one car that moves along the x axis."""
    n = len(places)
    tables = {key: [] for key in ('attribute', 'sensor', 'calibrated_sensor', 'ego_pose', 'sample_data')}
    tables['map'] = [{'token': 'm', 'log_tokens': ['l'], 'category': 'semantic_prior', 'filename': 'town.png'}]
    tables['visibility'] = [{'token': '4', 'level': 'v80-100', 'description': 'visible'}]
    tables['category'] = [{'token': 'c', 'name': 'vehicle.car', 'description': 'car'}]
    tables['log'] = [{'token': 'l', 'logfile': '', 'vehicle': '', 'date_captured': '', 'location': 'town'}]
    tables['scene'] = [{'token': 'n', 'name': name, 'description': '', 'log_token': 'l', 'nbr_samples': n,
                        'first_sample_token': 's0', 'last_sample_token': f's{n - 1}'}]
    tables['instance'] = [{'token': 'i', 'category_token': 'c', 'nbr_annotations': n,
                           'first_annotation_token': 'a0', 'last_annotation_token': f'a{n - 1}'}]

    def neighbours(letter, k):
        return {'prev': f'{letter}{k - 1}' if k else '', 'next': f'{letter}{k + 1}' if k < n - 1 else ''}

    tables['sample'] = [{'token': f's{k}', 'timestamp': int(1e6 * STEP * k), 'scene_token': 'n', **neighbours('s', k)}
                        for k in range(n)]
    tables['sample_annotation'] = [{
        'token': f'a{k}', 'sample_token': f's{k}', 'instance_token': 'i', 'visibility_token': '4', 'attribute_tokens': [],
        'translation': [x, 0.0, 0.0], 'size': [1.8, 4.5, 1.5], 'num_lidar_pts': 9, 'num_radar_pts': 0,
        'rotation': [math.cos(heading / 2.0), 0.0, 0.0, math.sin(heading / 2.0)], **neighbours('a', k)}
        for k, x in enumerate(places)]
    folder = Path(name, 'v1.0-mini')
    folder.mkdir(parents=True)
    Image.new('L', (10, 10), 255).save(Path(name, 'town.png'))
    for key, rows in tables.items():
        (folder / f'{key}.json').write_text(json.dumps(rows))
    return PredictHelper(NuScenes('v1.0-mini', name, verbose=False))


t = STEP * np.arange(-PAST, FUTURE + 1)
ok = True
for name, heading, x in (('forward', math.pi, -2.0 * t), ('in reverse', 0.0, -2.0 * t), ('in reverse, faster', 0.0, -2.0 * t - 0.1 * t**2)):
    data = recording(name, heading, x.tolist())
    speed = data.get_velocity_for_agent('i', f's{PAST}')
    acceleration = data.get_acceleration_for_agent('i', f's{PAST}')
    ends = [float(model(6.0, data)(f'i_s{PAST}').prediction[0, -1, 0]) for model in (ConstantVelocityHeading, PhysicsOracle)]
    print(f'{name}: {speed:.2f} m/s, {acceleration:+.2f} m/s², after 6 s at {x[-1]:+.1f} m; '
          f'constant velocity {ends[0]:+.1f} m, best of four {ends[1]:+.1f} m')
    if name == 'forward':
        ok = ok and np.allclose(ends, x[-1])
    else:
        ok = ok and speed > 1.5 and acceleration > -1e-6 and all(end - x[-1] > 20.0 for end in ends)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
