"""Generated situations in which there is little or nothing left to do: too near, and too fast."""

from __future__ import annotations

import math
from collections.abc import Iterator

from tests.roads import car, driving, lanelet, problem, scenario, state

COUNT = 60  # steps of 0.1 s
KINDS = ("wall", "post", "cut_in", "crossing", "oncoming", "rear")


def _box(length: float, width: float) -> str:
    return f"<rectangle><length>{length}</length><width>{width}</width></rectangle>"


def _moving(name: int, places: list[tuple[float, float, float]], speed: float, shape: str) -> str:
    states = [
        state(x, y, k=k, heading=heading, v=speed, tag="state" if k else "initialState")
        for k, (x, y, heading) in enumerate(places)
    ]
    return car(name, states[0], f"<trajectory>{''.join(states[1:])}</trajectory>", shape=shape)


def _other(kind: str, own: float, gap: float, speed: float) -> str:
    """Who is in the way; ``gap`` is from the ego's front to them, as they are when they are met or start."""
    front = 20.0 + 2.16 + gap
    times = [0.1 * k for k in range(COUNT + 1)]
    if kind in ("wall", "post"):
        width = 60.0 if kind == "wall" else 1.8
        body = f"<type>roadBoundary</type><shape>{_box(1.0, width)}</shape>{state(front + 0.5, 0.0)}"
        return f'<staticObstacle id="30">{body}</staticObstacle>'
    if kind == "cut_in":  # from the left within a second, slower
        places = []
        for t in times:
            share = min(t, 1.0)
            aside = 3.5 * (1.0 - share * share * (3.0 - 2.0 * share))
            places.append((front + 2.25 + speed * t, aside, 0.0))
        return _moving(30, places, speed, _box(4.5, 1.8))
    if kind == "crossing":  # from the right, on the ego's path when an ego that does nothing gets there
        meet = gap / own
        places = [(front + 0.9, speed * (t - meet), math.pi / 2) for t in times]
        return _moving(30, places, speed, _box(6.0, 1.8))
    if kind == "oncoming":
        places = [(front + 2.25 - speed * t, 0.3, math.pi) for t in times]
        return _moving(30, places, speed, _box(4.5, 1.8))
    wall = _other("wall", own, gap, speed)  # and who follows closely does not brake
    places = [(20.0 - 2.16 - 2.25 - 1.5 + own * t, 0.0, 0.0) for t in times]
    return wall + _moving(31, places, own, _box(4.5, 1.8))


def situation(kind: str, own: float, gap: float, speed: float = 8.0, width: float = 5.0) -> str:
    """A file: an ego at ``own`` m/s at x = 20 m on a straight road, and who is in its way.

    Parameters
    ----------
    kind : str
        One of ``KINDS``.
    own, speed : float
        Of the ego, and of who moves [m/s].
    gap : float
        From the ego's front [m].
    width : float
        Of the road [m].
    """
    steps = f"<time><intervalStart>{COUNT - 1}</intervalStart><intervalEnd>{COUNT}</intervalEnd></time>"
    road = lanelet(1, range(-40, 401, 20), [0.0] * 23, width=width)
    far = driving(39, 380.0, 0.0, 0.0, range(1, COUNT + 1))  # only says how long the traffic is known
    wanted = problem(100, state(20.0, 0.0, v=own), f"<goalState>{steps}</goalState>")
    return scenario(road=road, obstacles=_other(kind, own, gap, speed) + far, problems=wanted)


def grid() -> Iterator[tuple[str, float, float, float, float]]:
    """Kinds with speeds, gaps and widths of the road, as :func:`situation` takes them."""
    for kind in KINDS:
        for own in (8.0, 15.0, 25.0):
            for share in (0.25, 0.5, 0.8):  # of the way that braking takes
                gap = share * own**2 / (2.0 * 10.35)
                if kind == "oncoming":
                    gap *= 2.0
                for speed in (4.0, 10.0) if kind not in ("wall", "post", "rear") else (0.0,):
                    for width in (3.5, 7.0):
                        yield kind, own, gap, speed, width
