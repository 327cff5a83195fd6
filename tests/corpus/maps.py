"""Traffic of our own on real road networks: those that ship inside a public package.

commonroad-dataset-converter 2025.1.0 holds the maps of the data sets that it converts (INTERACTION, exiD,
inD, rounD, uniD, MONA, SinD, TUMDOT). Its wheel is downloaded by pip, without its dependencies, and taken
apart; nothing of it is installed or run. Each situation is one of the maps, an ego on a lane that goes on,
and traffic that a seed has chosen.
"""

from __future__ import annotations

import random
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from tests.roads import car, exact, problem, state

__all__ = ["KINDS", "PACKAGE", "Map", "NoMaps", "maps_of", "situation", "situations"]

PACKAGE = "commonroad-dataset-converter==2025.1.0"
_NOT_DRIVEN = {"sidewalk", "crosswalk", "border", "restricted", "bicycleLane", "stairs"}
_HORIZON = 6.0  # [s]
_NARROW = 2.2  # lanes below this width are not started on [m]


class NoMaps(Exception):
    """The package cannot be had; the words say why."""


def maps_of(folder: Path) -> list[Path]:
    """The package's maps, unpacked into a folder.

    Raises
    ------
    NoMaps
        If pip finds no such package: no index can be reached, or none has it.
    """
    asked = [sys.executable, "-m", "pip", "download", "--no-deps", "--only-binary=:all:", "--quiet",
             "--dest", str(folder), PACKAGE]  # fmt: skip
    try:
        done = subprocess.run(asked, capture_output=True, text=True, timeout=600, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise NoMaps(f"pip could not be run: {error}") from error
    wheels = list(folder.glob("*.whl"))
    if done.returncode or not wheels:
        said = [line for line in done.stderr.splitlines() if line.startswith("ERROR")] or ["no wheel came"]
        raise NoMaps(f"{PACKAGE} cannot be downloaded ({said[-1]})")
    with zipfile.ZipFile(wheels[0]) as wheel:
        names = [n for n in wheel.namelist() if n.endswith(".xml")]
        return sorted(Path(wheel.extract(name, folder)) for name in names)


def situations(folder: Path, count: int, seed: int = 0) -> list[Path]:
    """Write situations into a folder, the maps in turn; the same seed makes the same files."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as aside:
        roads = [Map(path) for path in maps_of(Path(aside))]
    made = []
    for number in range(count):
        road = roads[number % len(roads)]
        file = folder / f"{number:03d}_{road.name}.xml"
        file.write_bytes(situation(road, random.Random(f"{seed}:{number}")))
        made.append(file)
    return made


# -- the road --------------------------------------------------------------------------------------


class Map:
    """A map and its lanes that can be driven."""

    def __init__(self, path: Path) -> None:
        import warnings

        from commonroad.common.file_reader import CommonRoadFileReader

        self.name, self.data = path.stem, path.read_bytes()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            scenario, _ = CommonRoadFileReader(str(path)).open()
        self.dt = float(scenario.dt)
        self.lanes = {
            lane.lanelet_id: lane
            for lane in scenario.lanelet_network.lanelets
            if not {t.value for t in lane.lanelet_type} & _NOT_DRIVEN
        }
        self.free = 1 + max(
            int(e.get("id", 0)) for e in ElementTree.fromstring(self.data).iter() if e.get("id")
        )

    def walk(self, rng: random.Random, first: int, most: int = 30) -> Iterator[Any]:
        """The lanes from one on, at forks by chance, none twice."""
        seen: set[int] = set()
        here: int | None = first
        while here is not None and len(seen) < most:
            seen.add(here)
            yield self.lanes[here]
            onward = [n for n in self.lanes[here].successor if n in self.lanes and n not in seen]
            here = rng.choice(onward) if onward else None


@dataclass(frozen=True)
class _Way:
    """The middle of consecutive lanes by arc length, and where on it the ego starts."""

    points: np.ndarray
    arc: np.ndarray
    start: float
    last: int

    def at(self, s: float, aside: float = 0.0) -> tuple[float, float, float]:
        """Place and heading at ``s`` [m] from the start, ``aside`` to the left."""
        query = np.clip(self.start + s + np.array([-1.0, 0.0, 1.0]), 0.0, self.arc[-1])
        x, y = (np.interp(query, self.arc, column) for column in self.points.T)
        heading = float(np.arctan2(y[2] - y[0], x[2] - x[0]))
        past = max(self.start + s - float(self.arc[-1]), 0.0)  # straight on where the lanes end
        return (float(x[1]) + past * np.cos(heading) - aside * np.sin(heading),
                float(y[1]) + past * np.sin(heading) + aside * np.cos(heading), heading)  # fmt: skip


def _way(road: Map, rng: random.Random) -> tuple[_Way, float]:
    """A way of lanes that goes on for the horizon, and a speed [m/s] for it."""
    longest: tuple[float, _Way, float] | None = None
    for _ in range(60):
        lanes = list(road.walk(rng, rng.choice(sorted(road.lanes))))
        points = np.concatenate([lane.center_vertices[:, :2] for lane in lanes])
        points = points[np.concatenate([[True], np.hypot(*np.diff(points, axis=0).T) > 1e-3])]
        if len(points) < 4:
            continue
        arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        start = rng.uniform(2.0, max(lanes[0].distance[-1] - 1.0, 2.1))
        wide = np.hypot(*(lanes[0].left_vertices - lanes[0].right_vertices)[:, :2].T).min()
        way = _Way(points, arc, start, lanes[-1].lanelet_id)
        speed = _speed(way, rng)
        spare = float(arc[-1]) - start - speed * _HORIZON - 15.0
        if wide < _NARROW:
            continue
        if longest is None or spare > longest[0]:
            longest = (spare, way, speed)
        if spare > 0.0:
            break
    assert longest is not None, f"{road.name} has no lane that can be driven"
    spare, way, speed = longest
    return way, speed if spare > 0.0 else max(0.5, speed + spare / _HORIZON)


def _speed(way: _Way, rng: random.Random) -> float:
    """A speed that the bends ahead allow [m/s]."""
    s = np.arange(0.0, 100.0, 4.0)
    headings = np.unwrap([way.at(k)[2] for k in s])
    bend = float(np.abs(np.diff(headings)).max()) / 4.0
    return min(rng.uniform(4.0, 20.0), float(np.sqrt(1.8 / max(bend, 1e-3))))


# -- the traffic -----------------------------------------------------------------------------------

_PERSON = "<rectangle><length>0.5</length><width>0.6</width></rectangle>"
_TRUCK = "<rectangle><length>12.0</length><width>2.5</width></rectangle>"


def _driven(name: int, poses: list[tuple[float, float, float, float]], *, shape: str | None = None) -> str:
    """An obstacle with one pose (x, y, heading, speed) for each step."""
    states = [
        state(x, y, k=k, heading=h, v=v, tag="state" if k else "initialState")
        for k, (x, y, h, v) in enumerate(poses)
    ]
    return car(name, states[0], f"<trajectory>{''.join(states[1:])}</trajectory>", shape=shape)


def _along(way: _Way, s: float, v: float, a: float, t: np.ndarray, aside: float = 0.0) -> list[Any]:
    """Along the way from ``s`` with speed ``v`` and acceleration ``a`` until it stands."""
    stop = -v / a if a < 0.0 else np.inf
    held = np.minimum(t, stop)
    return [(*way.at(s + v * h + 0.5 * a * h * h, aside), max(v + a * h, 0.0)) for h in held]


def _lead(way: _Way, v: float, t: np.ndarray, rng: random.Random, name: int) -> str:
    gap, shape = 8.0 + v * rng.uniform(0.5, 2.0), rng.choice((None, _TRUCK))
    speed, brakes = v * rng.uniform(0.5, 1.0), rng.uniform(1.0, 7.0)
    return _driven(name, _along(way, gap + 4.0 * bool(shape), speed, -brakes, t), shape=shape)


def _standing(way: _Way, v: float, t: np.ndarray, rng: random.Random, name: int) -> str:
    x, y, heading = way.at(10.0 + v * rng.uniform(1.5, 5.0), rng.uniform(-1.5, 1.5))
    body = "<shape><rectangle><length>4.5</length><width>1.8</width></rectangle></shape>"
    place = state(x, y, heading=heading, v=0.0, leave=("velocity", "acceleration"))
    return f'<staticObstacle id="{name}"><type>parkedVehicle</type>{body}{place}</staticObstacle>'


def _crossing(
    way: _Way, v: float, t: np.ndarray, rng: random.Random, name: int, *, walks: bool = False
) -> str:
    meet, speed = rng.uniform(1.5, 4.5), rng.uniform(0.8, 2.0) if walks else rng.uniform(4.0, 12.0)
    x, y, heading = way.at(max(v * meet, 6.0) + rng.uniform(-3.0, 3.0))
    side = heading + rng.choice((1.0, -1.0)) * rng.uniform(1.2, 1.9)
    way_x, way_y = speed * np.cos(side), speed * np.sin(side)
    poses = [(x + way_x * (k - meet), y + way_y * (k - meet), side, speed) for k in t]
    return _driven(name, poses, shape=_PERSON if walks else None)


def _pedestrian(way: _Way, v: float, t: np.ndarray, rng: random.Random, name: int) -> str:
    return _crossing(way, v, t, rng, name, walks=True)


def _oncoming(way: _Way, v: float, t: np.ndarray, rng: random.Random, name: int) -> str:
    speed, aside = rng.uniform(4.0, 12.0), rng.uniform(0.5, 3.5)
    begin = v * rng.uniform(3.0, 6.0) + 20.0
    poses = [way.at(begin - speed * k, aside) for k in t]
    return _driven(name, [(x, y, h + np.pi, speed) for x, y, h in poses])


def _cut_in(way: _Way, v: float, t: np.ndarray, rng: random.Random, name: int) -> str:
    begin, speed, side = rng.uniform(5.0, 15.0), v * rng.uniform(0.4, 0.9), rng.choice((3.5, -3.5))
    long = rng.uniform(1.5, 4.0)
    poses = [way.at(begin + speed * k, side * (1.0 - min(k / long, 1.0))) for k in t]
    return _driven(name, [(x, y, h, speed) for x, y, h in poses])


def _follower(way: _Way, v: float, t: np.ndarray, rng: random.Random, name: int) -> str:
    return _driven(name, _along(way, -rng.uniform(9.0, 20.0), v * rng.uniform(0.9, 1.3), 0.0, t))


def _stated(way: _Way, v: float, t: np.ndarray, rng: random.Random, name: int) -> str:
    """A car ahead whose sets grow with time."""
    gap, speed = 10.0 + v * rng.uniform(0.5, 2.0), v * rng.uniform(0.2, 0.8)
    sets = []
    for k, time in enumerate(t):
        x, y, heading = way.at(gap + speed * time)
        size = exact_rectangle(4.5 + 1.5 * time, 1.8 + 0.2 * time, heading, x, y)
        sets.append(f"<occupancy><shape>{size}</shape>{exact('time', k)}</occupancy>" if k else "")
    x, y, heading = way.at(gap)
    return car(name, state(x, y, heading=heading, v=speed), f"<occupancySet>{''.join(sets)}</occupancySet>")


def exact_rectangle(length: float, width: float, heading: float, x: float, y: float) -> str:
    """A rectangle in the plane."""
    return (f"<rectangle><length>{length}</length><width>{width}</width><orientation>{heading}</orientation>"
            f"<center><x>{x}</x><y>{y}</y></center></rectangle>")  # fmt: skip


KINDS = {
    "lead": _lead, "standing": _standing, "crossing": _crossing, "pedestrian": _pedestrian,
    "oncoming": _oncoming, "cut-in": _cut_in, "follower": _follower, "stated": _stated,
}  # fmt: skip


def situation(road: Map, rng: random.Random) -> bytes:
    """A map with an ego, a goal, and up to three others."""
    way, speed = _way(road, rng)
    steps = max(round(_HORIZON / road.dt), 4)
    t = np.arange(steps + 1) * road.dt
    parts = [
        KINDS[kind](way, speed, t, rng, road.free + k)
        for k, kind in enumerate(rng.sample(sorted(KINDS), rng.randint(0, 3)))
    ]
    x, y, heading = way.at(0.0)
    ends = f"<time><intervalStart>{steps - 2}</intervalStart><intervalEnd>{steps}</intervalEnd></time>"
    where = f'<position><lanelet ref="{way.last}"/></position>' if rng.random() < 0.5 else ""
    goal = f"<goalState>{where}{ends}</goalState>"
    parts.append(problem(road.free + 9, state(x, y, heading=heading, v=speed), goal))
    root = ElementTree.fromstring(road.data)
    for old in [e for e in root if e.tag.endswith("Obstacle") or e.tag == "planningProblem"]:
        root.remove(old)
    for part in parts:
        root.append(ElementTree.fromstring(part))
    return ElementTree.tostring(root, "utf-8", xml_declaration=True)
