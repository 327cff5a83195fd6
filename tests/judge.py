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


def ego_boxes(ego: Ego) -> np.ndarray:
    """The ego's rectangle at each of its poses, as shapely polygons (K,)."""
    return _boxes(ego.poses, ego.length, ego.width)


def _outline(shape):
    """A CommonRoad shape in the plane, or about its own origin, as a shapely geometry."""
    if hasattr(shape, "shapes"):
        return shapely.union_all([_outline(part) for part in shape.shapes])
    if hasattr(shape, "radius"):  # commonroad-io 2024.3 gives half of it
        return shapely.Point(shape.center).buffer(shape.radius, quad_segs=64)
    return shape.shapely_object


def _placed(shape, poses: np.ndarray):
    """A shape at poses (K, 3), in pieces (K,): turned about their own centres, and as a whole."""
    for part in getattr(shape, "shapes", [shape]):
        if hasattr(part, "shapes"):
            yield from _placed(part, poses)
            continue
        points, centre = (
            shapely.get_coordinates(_outline(part).exterior),
            np.asarray(part.center, dtype=float),
        )
        c, s = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
        for about in [centre] if np.hypot(*centre) < 1e-9 else [centre, np.zeros(2)]:
            x, y = (points - about).T
            turned = np.stack([c * x - s * y, s * x + c * y], axis=-1)
            yield shapely.polygons(turned + about + poses[:, None, :2])


def _poses(states, first: int, dt: float, t: np.ndarray) -> np.ndarray:
    """Poses (K, 3) of a rigid obstacle at times t, linearly between its states; NaN where it is not there."""
    at = {s.time_step - first: (*s.position[:2], s.orientation) for s in states}
    begin = min(at)
    table = np.full((max(at) - begin + 2, 3), np.nan)
    for k, pose in at.items():
        table[k - begin] = pose
    low = np.floor(t / dt + 1e-9)
    share = np.clip(t / dt - low, 0.0, 1.0)
    row = low.astype(int) - begin
    inside = (row >= 0) & (row < len(table) - 1)
    row = np.where(inside, row, 0)
    here, there = table[row], np.where(share[:, None] > 1e-9, table[row + 1], table[row])
    change = there - here
    change[:, 2] = (change[:, 2] + np.pi) % (2 * np.pi) - np.pi
    return np.where(inside[:, None], here + share[:, None] * change, np.nan)


def _certain(state) -> bool:
    return not (hasattr(state.position, "center") or hasattr(state.position, "shapes")
                or hasattr(state.orientation, "start"))  # fmt: skip


def draws_a_trailer(obstacle) -> bool:
    """What commonroad-io 2024.3 lays on its tractor, and nobody judges here."""
    prediction = getattr(obstacle, "prediction", None)
    hitched = any(
        "hitch_angle" in vars(s) for s in getattr(getattr(prediction, "trajectory", None), "state_list", ())
    )
    return hitched or bool(getattr(prediction, "wheelbase", None))


def off_centre(obstacle) -> bool:
    """Whether a moving body is not centred on its position, so that there are two readings of it."""
    shape = getattr(obstacle, "obstacle_shape", None)
    if shape is None or getattr(obstacle, "initial_state", None) is None:
        return False
    return any(np.hypot(*part.center) > 1e-3 for part in getattr(shape, "shapes", [shape]))


def _regions(obstacle):
    """What is stated at the steps: (step, region); None for a rigid obstacle with exact states."""
    prediction, start = getattr(obstacle, "prediction", None), getattr(obstacle, "initial_state", None)
    trajectory = getattr(prediction, "trajectory", None)
    if prediction is not None and trajectory is None:
        stated = [(o.time_step, o.shape) for o in prediction.occupancy_set]
        if start is not None:
            stated.append((start.time_step, obstacle.occupancy_at_time(start.time_step).shape))
    elif trajectory is not None and not all(_certain(s) for s in (start, *trajectory.state_list)):
        steps = range(start.time_step, trajectory.final_state.time_step + 1)
        stated = [(k, obstacle.occupancy_at_time(k).shape) for k in steps if obstacle.occupancy_at_time(k)]
    else:
        return None
    return [
        (k, _outline(shape))
        for step, shape in stated
        for k in range(getattr(step, "start", step), getattr(step, "end", step) + 1)
    ]


def obstacles_of(scenario) -> list:
    """All that can be met, of whatever role."""
    return [
        *scenario.static_obstacles, *scenario.dynamic_obstacles,
        *getattr(scenario, "phantom_obstacle", ()), *getattr(scenario, "environment_obstacle", ()),
    ]  # fmt: skip


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
    return first_contact(ego, scenario, first, until, since=since, deeper=deeper, apart=apart)[0]


def first_contact(
    ego: Ego,
    scenario,
    first: int,
    until: float,
    *,
    since: float = 0.0,
    deeper: float = 0.0,
    apart: frozenset[int] = frozenset(),
) -> tuple[float, int | None]:
    """As :func:`contact_time`, and who is met first."""
    keep = (ego.t >= since - 1e-9) & (ego.t <= until + 1e-9)
    t, poses = ego.t[keep], ego.poses[keep]
    length, width = max(ego.length - 2 * deeper, 0.01), max(ego.width - 2 * deeper, 0.01)
    boxes = _boxes(poses, length, width)
    best, who = np.inf, None
    for obstacle in obstacles_of(scenario):
        if obstacle.obstacle_id in apart or draws_a_trailer(obstacle):
            continue
        time = _meets(obstacle, t, poses, boxes, np.hypot(length, width) / 2, first, scenario.dt)
        if time < best:
            best, who = time, obstacle.obstacle_id
    return best, who


def _meets(obstacle, t, poses, boxes, radius: float, first: int, dt: float) -> float:
    """First of the times t at which the ego's boxes meet an obstacle."""
    start, shape = getattr(obstacle, "initial_state", None), getattr(obstacle, "obstacle_shape", None)
    regions = _regions(obstacle)
    hits = np.zeros(len(t), dtype=bool)
    if regions is not None:  # it holds at its step, and with the next one's between them
        for step, region in regions:
            near = np.abs(t / dt - (step - first)) < 1 - 1e-9
            hits[near] |= shapely.intersects(boxes[near], region)
    elif start is None or (getattr(obstacle, "prediction", None) is None and not _certain(start)):
        region = _outline(shape if start is None else obstacle.occupancy_at_time(start.time_step).shape)
        hits = shapely.intersects(boxes, region)
    else:
        if getattr(obstacle, "prediction", None) is None:
            its = np.tile([*start.position[:2], start.orientation], (len(t), 1))
        else:
            its = _poses((start, *obstacle.prediction.trajectory.state_list), first, dt, t)
        low_x, low_y, high_x, high_y = _outline(shape).bounds
        reach = radius + 2 * np.hypot(max(-low_x, high_x), max(-low_y, high_y))
        near = np.hypot(*(its[:, :2] - poses[:, :2]).T) <= reach  # not where it is not there: NaN
        for piece in _placed(shape, its[near]) if near.any() else ():
            hits[near] |= shapely.intersects(boxes[near], piece)
    return float(t[np.argmax(hits)]) if hits.any() else np.inf


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
