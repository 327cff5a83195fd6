"""An independent judge of how repairs end, and situations that go on after the conflict.

Nothing of the package takes part: the stop is a list of CommonRoad KS states, driven and held against the
traffic by :mod:`tests.judge`; whose prediction has ended is extended here, state by state; the road is the
union of the lanelets' polygons.
"""

from __future__ import annotations

import math
import random
from collections import Counter
from copy import deepcopy
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import shapely
from tests.crossings import Crossing, crossing
from tests.judge import STEP, contact_time, ego_of
from tests.roads import car, lanelet, problem, scenario, state

import repair

GRIP = 11.5  # of CommonRoad's vehicle 1 [m/s²]
GAP = 0.1  # gaps of the map up to this width are road [m]


def situation(seed: int) -> Crossing:
    """Somebody crosses the ego's way; behind that somebody stands, drives slowly or comes towards it."""
    rng = random.Random(seed)
    dt = rng.choice((0.04, 0.1, 0.2))
    own, meet = rng.uniform(6.0, 20.0), rng.uniform(1.0, 2.5)
    there = 20.0 + own * meet
    parts, words = [_moves(30, rng, dt, there, -8.0 * meet, 8.0, math.pi / 2, 0.0)], []
    for name in range(31, 31 + rng.randint(1, 3)):
        kind = rng.choice(("stands", "slow", "oncoming", "behind", "late"))
        lane = rng.choice((0.0, 0.0, 3.5))
        ahead = there + rng.uniform(8.0, 60.0)
        if kind == "oncoming":
            parts.append(_moves(name, rng, dt, ahead + own * 3.0, lane, own, math.pi, 0.0))
        elif kind == "behind":
            parts.append(_moves(name, rng, dt, 20.0 - rng.uniform(8.0, 20.0), lane, own, 0.0, 0.0))
        elif kind == "late":  # crosses when the repair has ended
            t = meet + rng.uniform(3.0, 5.0)
            parts.append(_moves(name, rng, dt, ahead, lane - 6.0 * t, 6.0, math.pi / 2, 0.0))
        else:
            v = 0.0 if kind == "stands" else rng.uniform(1.0, 0.7 * own)
            parts.append(_moves(name, rng, dt, ahead, lane, v, 0.0, rng.uniform(-1.0, 0.0) if v else 0.0))
        words.append(kind)
    lanes = [lanelet(1, range(-60, 601, 20), [0.0] * 34, more='<adjacentLeft ref="2" drivingDir="same"/>')]
    lanes.append(
        lanelet(2, range(-60, 601, 20), [3.5] * 34, more='<adjacentRight ref="1" drivingDir="same"/>')
    )
    steps = round(6.0 / dt)
    time = f"<time><intervalStart>{steps - 1}</intervalStart><intervalEnd>{steps}</intervalEnd></time>"
    wanted = problem(100, state(20.0, 0.0, v=own), f"<goalState>{time}</goalState>")
    text = scenario(road="".join(lanes), obstacles="".join(parts), problems=wanted, dt=dt)
    return Crossing(text, f"seed {seed}: {own:.1f} m/s, step {dt} s, {', '.join(words)}")


def _moves(
    name: int, rng: random.Random, dt: float, x: float, y: float, v: float, heading: float, a: float
) -> str:
    """A car, predicted for two to eight seconds."""
    states = []
    for k in range(round(rng.uniform(2.0, 8.0) / dt) + 1):
        t = k * dt
        t_a = t if a >= 0.0 else min(t, v / -a)
        way, speed = v * t_a + 0.5 * a * t_a**2, v + a * t_a
        place = x + way * math.cos(heading), y + way * math.sin(heading)
        states.append(state(*place, k=k, heading=heading, v=speed, tag="state" if k else "initialState"))
    return car(name, states[0], f"<trajectory>{''.join(states[1:])}</trajectory>")


def goes_on(read, how: str, until: int):
    """The scenario with every predicted obstacle extended to a step: held, or at its last velocity."""
    made = deepcopy(read)
    for obstacle in made.dynamic_obstacles:
        prediction = obstacle.prediction
        if prediction is None:
            states, last = None, obstacle.initial_state
        elif getattr(prediction, "trajectory", None) is None:
            sets = prediction.occupancy_set
            if how == "hold":
                for step in range(sets[-1].time_step + 1, until + 1):
                    held = deepcopy(sets[-1])
                    held.time_step = step
                    sets.append(held)
            continue
        else:
            states = prediction.trajectory.state_list
            last = states[-1]
        ahead = []
        for step in range(last.time_step + 1, until + 1):
            way = (step - last.time_step) * made.dt * last.velocity * (how == "constant_velocity")
            turn = np.array([np.cos(last.orientation), np.sin(last.orientation)])
            one = deepcopy(last)
            one.time_step, one.position = step, np.asarray(last.position) + way * turn
            ahead.append(one)
        if states is None:
            obstacle.prediction = SimpleNamespace(trajectory=SimpleNamespace(state_list=ahead))
        else:
            states.extend(ahead)
    return made


def fault(result: repair.RepairResult, file: Path) -> str:
    """What is wrong with what is said about the end of a repair; empty where nothing is."""
    from commonroad.common.file_reader import CommonRoadFileReader
    from vehiclemodels import parameters_vehicle1

    terminal = result.terminal
    if terminal is None or terminal.ending.value == "unsafe":
        return ""
    read, problems = CommonRoadFileReader(str(file)).open()
    start = next(iter(problems.planning_problem_dict.values())).initial_state
    driven = terminal.continuation.states
    states = [
        SimpleNamespace(position=(x, y), orientation=psi, velocity=v, steering_angle=delta)
        for x, y, psi, v, delta in zip(
            driven.x, driven.y, driven.orientation, driven.speed, driven.steering, strict=True
        )
    ]
    dt, last = read.dt, result.states
    wrong = _drives(states, dt) or _follows(driven, last)
    if wrong:
        return wrong
    ego = ego_of(states, dt, parameters_vehicle1.parameters_vehicle1())
    ego.t[:] += driven.t[0]
    until, first = float(driven.t[-1]), start.time_step
    recorded = frozenset(
        other.obstacle_id
        for other in read.dynamic_obstacles
        if np.hypot(*(np.asarray(other.initial_state.position) - start.position)) < 0.1
    )
    steps = first + math.ceil(until / dt) + 1
    ways = {"predicted": read}
    if terminal.ending.value == "safe":
        ways |= {how: goes_on(read, how, steps) for how in ("constant_velocity", "hold")}
    for name, traffic in ways.items():
        met = contact_time(ego, traffic, first, until, since=float(driven.t[0]), apart=recorded)
        if met < np.inf:
            return f"{name}: contact at {met:.3f} s"
    return _off_road(ego, read)


def _drives(states, dt: float) -> str:
    """Comes to rest, brakes no harder than the tyres hold, and ends each step where the next state is."""
    if abs(states[-1].velocity) > 1e-6:
        return f"ends at {states[-1].velocity:.3f} m/s"
    speed = np.array([s.velocity for s in states])
    if (np.diff(speed) / dt).min(initial=0.0) < -GRIP:
        return f"brakes at {(np.diff(speed) / dt).min():.2f} m/s²"
    from vehiclemodels import parameters_vehicle1

    parameters = parameters_vehicle1.parameters_vehicle1()
    for here, there in pairwise(states):
        poses = ego_of([here, there], dt, parameters).poses
        missed = float(np.hypot(*(poses[-2, :2] - poses[-1, :2])))
        if missed > 0.03 + STEP * max(abs(here.velocity), abs(there.velocity)) * 2.0:
            return f"a step misses the next state by {missed:.3f} m"
    return ""


def _follows(driven, last) -> str:
    """The stop begins in the last state of the repair."""
    off = np.hypot(driven.x[0] - last.x[-1], driven.y[0] - last.y[-1])
    off = max(off, abs(driven.speed[0] - last.speed[-1]), abs(driven.orientation[0] - last.orientation[-1]))
    return f"begins {off:.4f} off the repair's end" if off > 1e-3 or driven.t[0] != last.t[-1] else ""


def _off_road(ego, read) -> str:
    lanes = [lane.polygon.shapely_object for lane in read.lanelet_network.lanelets]
    road = shapely.union_all([lane.buffer(GAP) for lane in lanes])
    half = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (0.5 * ego.length, 0.5 * ego.width)
    for x, y, psi in ego.poses[:: max(round(0.02 / STEP), 1)]:
        turn = np.array([[np.cos(psi), np.sin(psi)], [-np.sin(psi), np.cos(psi)]])
        if not road.contains(shapely.Polygon(half @ turn + (x, y))):
            return f"off the road at ({x:.1f}, {y:.1f})"
    return ""


def main() -> int:
    """``python -m tests.ends --seeds N``, or ``--folder DIR``: endings, and what is wrong with them."""
    import argparse
    import tempfile

    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--seeds", type=int, default=0)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--reference", nargs="+", default=["constant", "planner"])
    options = parser.parse_args()
    count: Counter[str] = Counter()

    def judge(file: Path, backend: str, reference: str, words: str) -> None:
        result = repair.repair(file, backend=backend, overrides=[f"reference.source={reference}"])
        if result.terminal is None:
            return
        shown = result.terminal.continuation
        count[f"{result.terminal.ending.value} ({shown.maneuver if shown else 'no stop'})"] += 1
        if wrong := fault(result, file):
            print(f"{backend}, {reference}, {result.terminal.ending.value}: {wrong}: {words}")
            count["wrong"] += 1

    with tempfile.TemporaryDirectory() as folder:
        for seed in range(options.seeds):
            case = situation(seed) if seed % 4 else crossing(seed)
            file = Path(folder) / "situation.xml"
            file.write_text(case.text, encoding="utf-8")
            judge(file, ("ego", "casadi", "qptr")[seed % 3], "constant", case.words)
    for file in sorted(options.folder.glob("*.xml")) if options.folder else []:
        for backend in ("ego", "casadi", "qptr"):
            for reference in options.reference:
                judge(file, backend, reference, file.name)
    print(", ".join(f"{n} {name}" for name, n in sorted(count.items())))
    return int(count["wrong"] > 0)


if __name__ == "__main__":
    raise SystemExit(main())
