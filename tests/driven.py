"""Solution files as others write them: CommonRoad's own vehicle models under random bounded inputs.

A case is a road, a planning problem on it, and a trajectory of states that CommonRoad accepts for its
model; that it does is asked, not assumed (:func:`official`). Nothing of the package takes part.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.common.solution import (
    CommonRoadSolutionReader,
    CommonRoadSolutionWriter,
    CostFunction,
    PlanningProblemSolution,
    Solution,
    VehicleModel,
    VehicleType,
)
from commonroad.scenario.scenario import ScenarioID
from commonroad.scenario.state import InitialState
from commonroad.scenario.trajectory import Trajectory
from commonroad_dc.feasibility.solution_checker import solution_feasible, starts_at_correct_state
from commonroad_dc.feasibility.vehicle_dynamics import VehicleDynamics
from tests import roads

ROADS = ("straight", "curved", "ring")
MANOEUVRES = ("free", "stop", "stand", "start", "short", "hard")
STEPS = (0.04, 0.1, 0.2, 0.5)
MODELS = ("KS", "PM", "ST", "MB")
NAME = "ZAM_Driven-1_1_T-1"
_RADIUS = 30.0  # of the ring [m]
LAP = 2.0 * np.pi * _RADIUS


@dataclass(frozen=True)
class Case:
    """What one file is to be like."""

    road: str = "straight"
    manoeuvre: str = "free"
    dt: float = 0.1
    model: str = "KS"
    vehicle: int = 2
    seed: int = 0
    off: float = 0.0  # first speed against the planning problem's [m/s]
    noise: float = 0.0  # of each state, as a share of what the checker allows
    origin: tuple[float, float] = (0.0, 0.0)

    def __str__(self) -> str:
        """Name in a test's report."""
        return f"{self.road}-{self.manoeuvre}-{self.dt:g}s-{self.model}{self.vehicle}-{self.seed}"


def cases(count: int, first: int = 0) -> list[Case]:
    """As many cases, all kinds of each mixed; the same for the same numbers."""
    made = []
    for k in range(first, first + count):
        rng = np.random.default_rng(k)
        model = MODELS[0] if rng.uniform() < 0.6 else str(rng.choice(MODELS[1:]))
        made.append(
            Case(
                ROADS[k % 3], MANOEUVRES[k // 3 % 6], float(rng.choice(STEPS)), model,
                int(rng.integers(1, 4)), k, float(rng.uniform(-1.9, 1.9)) * int(rng.uniform() < 0.5),
                float(rng.choice([0.0, 0.0, 0.2, 0.5])),
            )
        )  # fmt: skip
    return made


def centre_line(road: str) -> np.ndarray:
    """Points (M, 2) a metre apart."""
    s = np.arange(0.0, 700.0)
    if road == "straight":
        return np.stack([s, 0.0 * s], axis=1)
    if road == "ring":
        angle = np.linspace(0.0, 2.0 * np.pi, 189)
        return _RADIUS * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=1)
    heading = 0.9 * np.sin(s / 40.0)
    return np.cumsum(np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)


def scenario_text(case: Case, start: tuple[float, float, float, float], duration: float = 6.0) -> str:
    """The file: one wide road, an obstacle far from it that sets the horizon, the planning problem."""
    line = centre_line(case.road) + case.origin
    tangent = np.gradient(line, axis=0)
    if case.road == "ring":
        tangent[[0, -1]] = (1.0, 0.0)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1) / np.hypot(*tangent.T)[:, None]
    half = len(line) // 2
    pieces = ((1, slice(0, half + 1)), (2, slice(half, None)))
    road = ""
    for name, piece in pieces:
        left, right = (
            "".join(roads.point(*p) for p in (line + side * normal)[piece]) for side in (8.0, -8.0)
        )
        other = 3 - name
        before = f'<predecessor ref="{other}"/>' if case.road == "ring" or name == 2 else ""
        after = f'<successor ref="{other}"/>' if case.road == "ring" or name == 1 else ""
        bounds = f"<leftBound>{left}</leftBound><rightBound>{right}</rightBound>"
        road += f'<lanelet id="{name}">{bounds}{before}{after}</lanelet>'
    x, y, heading, speed = start
    far = np.array(case.origin) - 200.0
    last = round(duration / case.dt)
    parked = "".join(roads.state(*far, k=k, v=0.0, tag="state") for k in range(1, last + 1))
    obstacle = roads.car(30, roads.state(*far, v=0.0), f"<trajectory>{parked}</trajectory>")
    problem = roads.problem(100, roads.state(x, y, heading=heading, v=speed))
    return roads.scenario(road=road, obstacles=obstacle, problems=problem, dt=case.dt, name=NAME)


def drive(case: Case, duration: float = 6.0) -> tuple[list, tuple[float, float, float, float]]:
    """States of the case's model at the scenario's steps, and the planning problem's state."""
    rng = np.random.default_rng([case.seed, 7])
    dynamics = VehicleDynamics.from_model(VehicleModel[case.model], VehicleType(case.vehicle))
    line = centre_line(case.road)
    tangent = np.gradient(line, axis=0)
    at = 40 if case.road != "ring" else int(rng.integers(5, 150))
    heading = float(np.arctan2(tangent[at, 1], tangent[at, 0]))
    top = 12.0 if case.road == "ring" else 20.0
    speed = 0.0 if case.manoeuvre in ("stand", "start") else float(rng.uniform(2.0, top))
    if speed:
        speed = max(speed, case.off + 0.1)
    place = line[at] + case.origin
    begin = InitialState(
        time_step=0,
        position=place,
        orientation=heading,
        velocity=speed,
        acceleration=0.0,
        yaw_rate=0.0,
        slip_angle=0.0,
    )
    x, _ = dynamics.state_to_array(begin)
    if case.model == "MB":
        x = np.asarray(dynamics.state_to_array(dynamics.convert_initial_state(begin))[0])
    count = round((rng.uniform(1.5, 3.5) if case.manoeuvre == "short" else duration) / case.dt)
    rows, control = [x], _Driver(case, line + case.origin, rng, top)
    for k in range(max(count, 4)):
        following = control.follow(dynamics, rows[-1], k * case.dt)
        if following is None:
            break
        rows.append(_disturbed(case, dynamics, rows[-1], following, rng))
    states = [dynamics.array_to_state(row, k) for k, row in enumerate(rows)]
    return states, (float(place[0]), float(place[1]), heading, max(speed - case.off, 0.0))


class _Driver:
    """Keeps roughly to the road; whatever else it does is random, and within the model's bounds."""

    def __init__(self, case: Case, line: np.ndarray, rng: np.random.Generator, top: float) -> None:
        self.case, self.line, self.rng, self.top = case, line, rng, top
        self.accelerate, self.offset, self.until = 0.0, 0.0, -1.0
        self.brake_from = rng.uniform(0.0, 2.0)
        self.start_at = rng.uniform(0.0, 2.0)
        self.braking = rng.uniform(1.0, 8.0)

    def follow(self, dynamics: VehicleDynamics, x: np.ndarray, t: float) -> np.ndarray | None:
        """The next state; the inputs are made smaller until the model takes them."""
        if t > self.until:
            self.until = t + self.rng.uniform(0.3, 1.5)
            hard = 3.0 if self.case.manoeuvre == "hard" else 1.0
            self.accelerate = float(self.rng.uniform(-2.0, 2.0) * hard)
            self.offset = float(self.rng.uniform(-2.0, 2.0))
        point_mass = self.case.model == "PM"
        v = float(np.hypot(x[2], x[3])) if point_mass else float(x[3])
        a = self._acceleration(v, t)
        for share in (1.0, 0.7, 0.4, 0.2, 0.0):
            u = self._point_mass(x, v, a, share) if point_mass else self._steered(dynamics, x, v, a, share)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                made = dynamics.forward_simulation(np.array(x), u, self.case.dt, throw=False)
            if made is not None and self._moved(x, np.asarray(made), v):
                return np.asarray(made)
        return None

    def _moved(self, before: np.ndarray, after: np.ndarray, v: float) -> bool:
        """Whether it is a motion at all: the multi-body model's integration may fail without a word."""
        if not np.isfinite(after).all():
            return False
        return bool(np.hypot(*(after - before)[:2]) >= 0.4 * v * self.case.dt)

    def _acceleration(self, v: float, t: float) -> float:
        kind, dt = self.case.manoeuvre, self.case.dt
        if kind == "stand" or (kind == "start" and t < self.start_at):
            return 0.0
        if kind == "stop" and t >= self.brake_from:
            return -min(self.braking, v / dt)
        a = self.accelerate if kind != "start" else abs(self.accelerate) + 0.3
        a = min(a, (self.top - v) / max(dt, 0.5))
        return max(a, -v / dt)  # it does not reverse

    def _aim(self, x: np.ndarray, v: float) -> tuple[float, float]:
        """Direction to a point ahead, and how far it is."""
        nearest = int(np.argmin(np.hypot(*(self.line - x[:2]).T)))
        ahead = nearest + int(6.0 + 0.9 * v + 3.0 * v * self.case.dt)
        n = len(self.line)
        here = self.line[ahead % (n - 1)] if self.case.road == "ring" else self.line[min(ahead, n - 1)]
        past = (
            self.line[(ahead - 1) % (n - 1)] if self.case.road == "ring" else self.line[min(ahead, n - 1) - 1]
        )
        along = (here - past) / max(np.hypot(*(here - past)), 1e-9)
        goal = here + self.offset * np.array([-along[1], along[0]])
        way = goal - x[:2]
        return float(np.arctan2(way[1], way[0])), float(np.hypot(*way))

    def _steered(
        self, dynamics: VehicleDynamics, x: np.ndarray, v: float, a: float, share: float
    ) -> np.ndarray:
        p = dynamics.parameters
        direction, distance = self._aim(x, v)
        error = (direction - x[4] + np.pi) % (2.0 * np.pi) - np.pi
        wanted = np.arctan(2.0 * (p.a + p.b) * np.sin(error) / max(distance, 1.0))
        grip = np.arctan(0.6 * p.longitudinal.a_max * (p.a + p.b) / max(v * v, 1.0))
        wanted = np.clip(wanted, -min(grip, 0.8), min(grip, 0.8))
        rate = np.clip((wanted - x[2]) / max(self.case.dt, 0.3), -0.39, 0.39) + 0.02 * self.rng.normal()
        standing = v == 0.0 and a == 0.0
        return np.array(
            [0.0 if standing else share * np.clip(rate, -0.4, 0.4), share * a if share else min(a, 0.0)]
        )

    def _point_mass(self, x: np.ndarray, v: float, a: float, share: float) -> np.ndarray:
        if self.case.manoeuvre == "turn":  # to a standstill and off to the side, which no vehicle can
            return np.array([-min(4.0, x[2] / self.case.dt), 1.0 if x[2] <= 1e-6 else 0.0])
        heading = float(np.arctan2(x[3], x[2])) if v > 0.0 else self._aim(x, v)[0]
        direction, distance = self._aim(x, v)
        error = (direction - heading + np.pi) % (2.0 * np.pi) - np.pi
        across = share * float(np.clip(2.0 * v * v * np.sin(error) / max(distance, 1.0), -5.0, 5.0))
        cos, sin = np.cos(heading), np.sin(heading)
        if v > 0.0 and a <= -v / self.case.dt + 1e-12:
            across = 0.0
        return np.array([a * cos - across * sin, a * sin + across * cos])


def _disturbed(
    case: Case, dynamics: VehicleDynamics, before: np.ndarray, x: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Rounded as planners round: to a share of the position and heading that the checker lets pass."""
    if not case.noise or case.model not in ("KS",) or abs(float(x[3])) < 0.5:
        return x
    made = np.array(x)
    made[:2] += case.noise * rng.uniform(-0.01, 0.01, 2)
    made[4] += case.noise * rng.uniform(-0.01, 0.01)
    return made


def parameters(case: Case) -> Any:
    """Of the case's vehicle."""
    return VehicleDynamics.from_model(VehicleModel[case.model], VehicleType(case.vehicle)).parameters


def written(
    case: Case, folder, duration: float = 6.0, *, rows: np.ndarray | None = None, start: tuple | None = None
) -> tuple:
    """Paths of the scenario and of the solution file of a case.

    ``rows`` (K, 5) are states x, y, steering, speed, heading to write instead of those that are driven, the
    place that of the centre.
    """
    if rows is None:
        states, start = drive(case, duration)
    else:
        dynamics = VehicleDynamics.from_model(VehicleModel[case.model], VehicleType(case.vehicle))
        states = [dynamics.array_to_state(_at_axle(row, case), k) for k, row in enumerate(rows)]
    scenario, solution = folder / "scenario.xml", folder / "reference.xml"
    scenario.write_text(scenario_text(case, start, duration), encoding="utf-8")
    made = PlanningProblemSolution(
        100,
        VehicleModel[case.model],
        VehicleType(case.vehicle),
        CostFunction.JB1,
        Trajectory(0, states),
    )
    text = CommonRoadSolutionWriter(Solution(ScenarioID.from_benchmark_id(NAME, "2020a"), [made])).dump(
        pretty=False
    )
    solution.write_bytes(text)
    return scenario, solution


def _at_axle(row: np.ndarray, case: Case) -> np.ndarray:
    """The model's own state, whose place is the rear axle's."""
    rear = parameters(case).b
    return np.array([row[0] - rear * np.cos(row[4]), row[1] - rear * np.sin(row[4]), *row[2:]])


def official(scenario_file, solution_file) -> bool:
    """Whether CommonRoad's checks accept start and motion of a solution file."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of its integrator and optimiser
        scenario, problems = CommonRoadFileReader(str(scenario_file)).open()
        solution = CommonRoadSolutionReader.open(str(solution_file))
        if len(solution.planning_problem_solutions[0].trajectory.state_list) < 5:
            return False
        try:
            starts_at_correct_state(solution, problems)
            return all(found[0] for found in solution_feasible(solution, scenario.dt, problems).values())
        except Exception:  # also of its own where it refuses the very first transition
            return False
