"""CriMe's TTC and TTR, and the F-TTR as a measure of CriMe; run in CriMe's environment.

``python -m benchmarks.crime.theirs ROWS.json`` reads rows with a file, the record of a repair and the states
of the reference, and prints for each what CriMe says, as JSON.
"""

from __future__ import annotations

import json
import logging
import math
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np


def with_ego(row: dict[str, Any]) -> tuple[Any, int]:
    """The scenario with the reference as one more vehicle, and its id."""
    from commonroad.common.file_reader import CommonRoadFileReader
    from commonroad.geometry.shape import Rectangle
    from commonroad.prediction.prediction import TrajectoryPrediction
    from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
    from commonroad.scenario.state import CustomState, InitialState
    from commonroad.scenario.trajectory import Trajectory

    scenario, _ = CommonRoadFileReader(row["file"]).open(lanelet_assignment=True)
    said, first = row["reference"], row["initial_time_step"]
    columns = list(zip(said["x"], said["y"], said["heading"], said["speed"], strict=True))
    states = [
        CustomState(time_step=first + k, position=np.array([x, y]), orientation=heading, velocity=speed)
        for k, (x, y, heading, speed) in enumerate(columns)
    ]
    begin = states[0]
    initial = InitialState(
        time_step=first, position=begin.position, orientation=begin.orientation, velocity=begin.velocity,
        acceleration=0.0, yaw_rate=0.0, slip_angle=0.0,
    )  # fmt: skip
    shape = Rectangle(row["length"], row["width"])
    name = scenario.generate_object_id()
    prediction = TrajectoryPrediction(Trajectory(first + 1, states[1:]), shape)
    scenario.add_objects(DynamicObstacle(name, ObstacleType.CAR, shape, initial, prediction))
    scenario.assign_obstacles_to_lanelets(obstacle_ids={name})
    return scenario, name


def measured(row: dict[str, Any]) -> dict[str, Any]:
    """What CriMe says of one row: values [s], or what it stopped with."""
    from commonroad_crime.data_structure.configuration import CriMeConfiguration
    from commonroad_crime.measure import TTR, TTCStar

    from benchmarks.crime.measure import FTTR

    said: dict[str, Any] = {}
    scenario, ego = with_ego(row)
    for name, measure in (("ttc", TTCStar), ("ttr", TTR), ("f_ttr", FTTR.of(row["record"]))):
        begin = time.perf_counter()
        try:
            config = CriMeConfiguration()
            config.update(ego_id=ego, sce=scenario)
            value = measure(config).compute(row["initial_time_step"], verbose=False)
            said[name] = None if value is None or math.isnan(value) else str(round(float(value), 3))
        except Exception as error:  # whatever CriMe stops with is the answer
            said[name] = f"{type(error).__name__}: {' '.join(str(error).split())[:120]}"
        said[f"{name}_seconds"] = round(time.perf_counter() - begin, 3)
    return said


def main() -> int:
    """Read, measure, print."""
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")
    rows = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    for row in rows:
        print(json.dumps({"file": row["file"], **measured(row)}), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
