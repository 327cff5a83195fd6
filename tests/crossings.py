"""Generated traffic that crosses or grazes the ego's way: any speed, step and shape, turning or not."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass

from tests.roads import car, lanelet, problem, scenario, state


@dataclass(frozen=True)
class Crossing:
    """The file, and in words what crosses in it."""

    text: str
    words: str


def _shape(rng: random.Random) -> tuple[str, str]:
    """A shape about its own origin, in XML and in words."""
    kind = rng.choice(("box", "thin", "circle", "polygon", "group"))
    if kind == "box":
        length, width = rng.uniform(2.0, 12.0), rng.uniform(1.0, 2.6)
    elif kind == "thin":
        length, width = rng.uniform(0.2, 1.0), rng.uniform(0.2, 0.6)
    if kind in ("box", "thin"):
        return _rectangle(length, width), f"{length:.2f} x {width:.2f} m box"
    if kind == "circle":
        radius = rng.uniform(0.2, 2.0)
        return f"<circle><radius>{radius}</radius></circle>", f"circle of {radius:.2f} m"
    if kind == "group":
        ahead = rng.uniform(1.5, 4.0)
        parts = _rectangle(1.0, 0.8, ahead) + _rectangle(2.0, 1.2, -ahead)
        return parts, f"two boxes, {2 * ahead:.1f} m apart"
    size = rng.uniform(0.4, 3.0)
    corners = [(size * math.cos(a), 0.5 * size * math.sin(a)) for a in (0.3, 1.9, 3.4, 5.0)]
    middle = [sum(c[i] for c in corners) / len(corners) for i in (0, 1)]
    points = "".join(f"<point><x>{x - middle[0]}</x><y>{y - middle[1]}</y></point>" for x, y in corners)
    return f"<polygon>{points}</polygon>", f"polygon of {size:.2f} m"


def _rectangle(length: float, width: float, ahead: float = 0.0) -> str:
    centre = f"<center><x>{ahead}</x><y>0.0</y></center>" if ahead else ""
    return f"<rectangle><length>{length}</length><width>{width}</width>{centre}</rectangle>"


def crossing(seed: int) -> Crossing:
    """The scenario of a seed: one obstacle that meets, or just misses, an ego that keeps its speed."""
    rng = random.Random(seed)
    dt = rng.choice((0.02, 0.04, 0.05, 0.1, 0.2, 0.25, 0.5))
    own, speed = rng.uniform(4.0, 30.0), math.exp(rng.uniform(0.0, math.log(40.0)))
    spin = rng.choice((0.0, 0.0, rng.uniform(-3.0, 3.0)))
    angle = rng.choice((math.pi / 2, -math.pi / 2, math.pi, rng.uniform(-math.pi, math.pi)))
    meet = rng.uniform(1.0, 3.0)  # [s]
    # Beside the ego's middle at that time, from a full hit to just past it.
    along, across = rng.uniform(-4.0, 4.0), rng.uniform(-2.0, 2.0)
    shape, words = _shape(rng)
    count = max(round(4.0 / dt), 2)
    states = []
    for k in range(count + 1):
        t = k * dt - meet
        x = 20.0 + own * meet + along + speed * math.cos(angle) * t
        y = across + speed * math.sin(angle) * t
        heading = math.remainder(angle + spin * t, 2 * math.pi)
        tag = "state" if k else "initialState"
        states.append(state(x, y, k=k, heading=heading, v=speed, tag=tag))
    other = car(30, states[0], f"<trajectory>{''.join(states[1:])}</trajectory>", shape=shape)
    steps = f"<time><intervalStart>{count - 1}</intervalStart><intervalEnd>{count}</intervalEnd></time>"
    start = state(20.0, 0.0, v=own)
    road = lanelet(1, range(-40, 401, 20), [0.0] * 23, width=5.0)
    wanted = problem(100, start, f"<goalState>{steps}</goalState>")
    said = f"seed {seed}: {words}, {speed:.1f} m/s at {angle:.2f} rad, step {dt} s, {spin:.2f} rad/s"
    return Crossing(scenario(road=road, obstacles=other, problems=wanted, dt=dt), said)
