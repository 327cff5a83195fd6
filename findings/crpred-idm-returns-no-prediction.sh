#!/usr/bin/env bash
# commonroad-prediction: the IDM predictor returns a scenario without predictions.
#
# Expected: IDMPredictor(params).predict(scenario) returns the scenario with a prediction by the
# intelligent driver model with the parameters in params.idm.
# What happens: predictions are erased (prediction is None, also those of the scenario that was handed in)
# and what is computed stays in the predictor's agents; params.idm is not handed on, so that a desired
# speed of 5 or 20 m/s gives the same; a second car on the lane raises AttributeError, because the
# follower looks up the lead's erased prediction. Obstacles must have a prediction to begin with.
# Why it matters: an evaluation that asks for IDM runs on traffic that stands at its first state, and
# a study over IDM parameters compares a model with itself.
#
# Output seen:
#   commonroad-prediction 0.1.2
#   desired 20 m/s: returned prediction None, speed inside after 10 s 19.77 m/s
#   desired 5 m/s: returned prediction None, speed inside after 10 s 19.77 m/s
#   two cars on the lane: AttributeError: 'NoneType' object has no attribute 'trajectory'
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-prediction==0.1.2 commonroad-io==2024.3 commonroad-drivability-checker==2025.4.0 commonroad-clcs==2025.2.0 numpy==2.4.6 scipy==1.17.1 shapely==2.2.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
print('commonroad-prediction', version('commonroad-prediction'))
import numpy as np
from commonroad.geometry.shape import Rectangle
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import InitialState
from crpred.utility.config import PredictorParams


def lane(centre):
    along = np.gradient(centre, axis=0)
    left = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    return Lanelet(centre + 2.0 * left, centre, centre - 2.0 * left, 1)


def scenario(centre, *cars):
    made = Scenario(0.1)
    made.add_objects(LaneletNetwork.create_from_lanelet_list([lane(centre)]))
    for number, (place, heading, speed, acceleration, yaw_rate) in enumerate(cars):
        state = InitialState(time_step=0, position=np.array(place), orientation=heading, velocity=speed,
                             acceleration=acceleration, yaw_rate=yaw_rate, slip_angle=0.0)
        made.add_objects(DynamicObstacle(10 + number, ObstacleType.CAR, Rectangle(4.5, 1.8), state))
    return made


straight = np.column_stack([np.arange(0.0, 500.0, 2.0), np.zeros(250)])
from crpred.advanced_models.idm_predictor import IDMPredictor
from crpred.basic_models.constant_velocity_predictor import ConstantVelocityLinearPredictor


def predicted(*cars):
    return ConstantVelocityLinearPredictor(PredictorParams(num_steps_prediction=100)).predict(scenario(straight, *cars), 0)


speeds, gone = {}, []
for wanted in (20.0, 5.0):
    params = PredictorParams(num_steps_prediction=100)
    params.idm.v_desired = wanted
    predictor, before = IDMPredictor(params), predicted(((20.0, 0.0), 0.0, 3.0, 0.0, 0.0))
    after = predictor.predict(before, 0)
    gone += [after.dynamic_obstacles[0].prediction is None, before.dynamic_obstacles[0].prediction is None]
    speeds[wanted] = float(predictor.list_agents[0]._traj_state_list[-1].velocity)
    print(f'desired {wanted:.0f} m/s: returned prediction {after.dynamic_obstacles[0].prediction}, '
          f'speed inside after 10 s {speeds[wanted]:.2f} m/s')
try:
    IDMPredictor(PredictorParams(num_steps_prediction=60)).predict(
        predicted(((20.0, 0.0), 0.0, 10.0, 0.0, 0.0), ((60.0, 0.0), 0.0, 10.0, 0.0, 0.0)), 0)
    raised = ''
except AttributeError as error:
    raised = f'AttributeError: {error}'
print('two cars on the lane:', raised or 'no error')
ok = all(gone) and abs(speeds[20.0] - speeds[5.0]) < 1e-9 and speeds[5.0] > 15.0 and bool(raised)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
