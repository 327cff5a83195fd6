"""An independent judge of contact: shapely every millisecond, CommonRoad's own objects, a vehicle of its own.

Nothing of the package takes part: the trajectory is a list of CommonRoad KS states, the traffic a
CommonRoad scenario. Between two states the kinematic single-track model is integrated here, with constant
acceleration and steering rate; between two steps an obstacle moves and turns linearly, and a set holds as it
is stated.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from shapely import affinity

STEP = 1e-3  # [s]


@dataclass(frozen=True)
class Ego:
    """Poses (K, 3) of the middle of the vehicle at times (K,), and its size."""

    t: np.ndarray
    poses: np.ndarray
    length: float
    width: float


def ego_of(states, dt: float, parameters) -> Ego:
    """Drive the states of a CommonRoad trajectory; ``parameters`` are those of vehiclemodels."""
    rear, wheelbase = parameters.b, parameters.a + parameters.b
    count = max(round(dt / STEP), 1)
    h, times, poses = dt / count, [], []
    for k, (here, there) in enumerate(pairwise(states)):
        psi, v, delta = here.orientation, here.velocity, here.steering_angle
        x, y = here.position[0] - rear * np.cos(psi), here.position[1] - rear * np.sin(psi)
        a, rate = (there.velocity - v) / dt, (there.steering_angle - delta) / dt
        for i in range(count):
            times.append((k + i / count) * dt)
            poses.append((x + rear * np.cos(psi), y + rear * np.sin(psi), psi))
            v_mid, d_mid = v + 0.5 * h * a, delta + 0.5 * h * rate
            psi_mid = psi + 0.5 * h * v * np.tan(delta) / wheelbase
            x, y = x + h * v_mid * np.cos(psi_mid), y + h * v_mid * np.sin(psi_mid)
            psi += h * v_mid * np.tan(d_mid) / wheelbase
            v, delta = v + h * a, delta + h * rate
    last = states[-1]
    times.append((len(states) - 1) * dt)
    poses.append((*last.position, last.orientation))
    return Ego(np.array(times), np.array(poses), parameters.l, parameters.w)


def _boxes(poses: np.ndarray, length: float, width: float) -> np.ndarray:
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    corners = 0.5 * np.array([[length, width], [length, -width], [-length, -width], [-length, width]])
    x = poses[:, :1] + corners[:, 0] * cos[:, None] - corners[:, 1] * sin[:, None]
    y = poses[:, 1:2] + corners[:, 0] * sin[:, None] + corners[:, 1] * cos[:, None]
    return shapely.polygons(np.stack([x, y], axis=-1))


def _outline(shape):
    """A CommonRoad shape about its own origin as a shapely geometry."""
    if hasattr(shape, "shapes"):
        return shapely.union_all([_outline(part) for part in shape.shapes])
    if hasattr(shape, "radius"):  # commonroad-io 2024.3 gives half of it
        return shapely.Point(shape.center).buffer(shape.radius, quad_segs=64)
    return shape.shapely_object


def _placed(shape, x: float, y: float, psi: float):
    """A shape at a pose: its parts turned about their own centres (commonroad-io), and as a whole."""
    if hasattr(shape, "shapes"):
        return shapely.union_all([_placed(part, x, y, psi) for part in shape.shapes])
    outline, centre = _outline(shape), tuple(float(c) for c in shape.center)
    about = [centre] if np.hypot(*centre) < 1e-9 else [centre, (0.0, 0.0)]
    turned = [affinity.rotate(outline, psi, point, use_radians=True) for point in about]
    return affinity.translate(shapely.union_all(turned), x, y)


def _moving(states, shape, first: int, dt: float, t: np.ndarray):
    """Geometry of a rigid obstacle at times t (None where it is not there)."""
    steps = {s.time_step - first: s for s in states}
    found = []
    for time in t:
        k = time / dt
        low = int(np.floor(k + 1e-9))
        share = k - low
        here, there = steps.get(low), steps.get(low + 1)
        if here is None or (share > 1e-9 and there is None):
            found.append(None)
            continue
        x, y, psi = *here.position, here.orientation
        if share > 1e-9:
            turn = (there.orientation - psi + np.pi) % (2 * np.pi) - np.pi
            x, y = (1 - share) * np.array([x, y]) + share * np.asarray(there.position)
            psi += share * turn
        found.append(_placed(shape, x, y, psi))
    return found


def _stated(occupancies, first: int, dt: float, t: np.ndarray):
    """Geometry of a set-based prediction: what is stated at a step, between two steps the union of both."""
    at: dict[int, list] = {}
    for occupancy in occupancies:
        step = occupancy.time_step
        for k in range(getattr(step, "start", step), getattr(step, "end", step) + 1):
            at.setdefault(k - first, []).append(_outline(occupancy.shape))
    found = []
    for time in t:
        k = time / dt
        low = int(np.floor(k + 1e-9))
        parts = at.get(low, []) + (at.get(low + 1, []) if k - low > 1e-9 else [])
        found.append(shapely.union_all(parts) if parts else None)
    return found


def contact_time(
    ego: Ego,
    scenario,
    first: int,
    until: float,
    *,
    since: float = 0.0,
    deeper: float = 0.0,
    apart: frozenset[int] = frozenset(),
) -> float:
    """First time [s] at which the ego meets an obstacle by more than ``deeper`` [m]; inf if never."""
    keep = (ego.t >= since - 1e-9) & (ego.t <= until + 1e-9)
    t, boxes = ego.t[keep], _boxes(ego.poses[keep], ego.length - 2 * deeper, ego.width - 2 * deeper)
    low, high = ego.poses[keep, :2].min(axis=0) - 10.0, ego.poses[keep, :2].max(axis=0) + 10.0
    best = np.inf
    for obstacle in [*scenario.static_obstacles, *scenario.dynamic_obstacles]:
        if obstacle.obstacle_id in apart:
            continue
        prediction = getattr(obstacle, "prediction", None)
        start = obstacle.initial_state
        if prediction is None:
            x, y = start.position
            shapes = [_placed(obstacle.obstacle_shape, x, y, start.orientation)] * len(t)
        elif getattr(prediction, "trajectory", None) is not None:
            states = {s.time_step: s for s in (start, *prediction.trajectory.state_list)}
            centres = np.array([s.position for s in states.values()])
            if (centres.max(axis=0) < low).any() or (centres.min(axis=0) > high).any():
                continue
            shapes = _moving(states.values(), obstacle.obstacle_shape, first, scenario.dt, t)
        else:
            shapes = _stated(prediction.occupancy_set, first, scenario.dt, t)
        there = np.array([s is not None for s in shapes])
        if not there.any():
            continue
        hits = shapely.intersects(boxes[there], np.array([s for s in shapes if s is not None]))
        if hits.any():
            best = min(best, float(t[there][np.argmax(hits)]))
    return best


def judged(result, file) -> float:
    """When a trajectory that was called feasible or free of conflict meets an obstacle [s]; inf if never."""
    from commonroad.common.file_reader import CommonRoadFileReader
    from vehiclemodels import parameters_vehicle1

    scenario, problems = CommonRoadFileReader(str(file)).open()
    start = next(iter(problems.planning_problem_dict.values())).initial_state
    first = start.time_step
    recorded = frozenset(  # who starts in the ego's own place is its recording, and no traffic
        other.obstacle_id
        for other in scenario.dynamic_obstacles
        if np.hypot(*(np.asarray(other.initial_state.position) - start.position)) < 0.1
    )
    states = result.trajectory.state_list
    ego = ego_of(states, scenario.dt, parameters_vehicle1.parameters_vehicle1())
    return contact_time(ego, scenario, first, (len(states) - 1) * scenario.dt, apart=recorded)


def main() -> int:
    """``python -m tests.judge --crossings N``, or ``--folder DIR``: contacts, and how many were judged."""
    import argparse
    import tempfile
    from collections import Counter
    from pathlib import Path

    from tests.crossings import crossing

    import repair

    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--crossings", type=int, default=0)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--reference", nargs="+", default=["constant", "planner"])
    options = parser.parse_args()
    backends, count = ("ego", "casadi", "qptr"), Counter()

    def judge(file: Path, backend: str, reference: str, words: str) -> None:
        try:
            result = repair.repair(file, backend=backend, overrides=[f"reference.source={reference}"])
        except repair.RepairError as error:
            print(f"refused  {words}: {error}")
            count["refused"] += 1
            return
        count[result.status.value] += 1
        if result.status.value in ("found", "no_conflict"):
            time = judged(result, file)
            if time < np.inf:
                print(f"contact at {time:.3f} s, {backend}, {reference}, {result.status.value}: {words}")
                count["contact"] += 1

    with tempfile.TemporaryDirectory() as folder:
        for seed in range(options.crossings):
            case = crossing(seed)
            file = Path(folder) / "crossing.xml"
            file.write_text(case.text, encoding="utf-8")
            judge(file, backends[seed % 3], "constant", case.words)
    for file in sorted(options.folder.glob("*.xml")) if options.folder else []:
        for backend in backends:
            for reference in options.reference:
                judge(file, backend, reference, file.name)
    print(", ".join(f"{n} {name}" for name, n in sorted(count.items())))
    return int(count["contact"] > 0)


if __name__ == "__main__":
    raise SystemExit(main())
