"""CommonRoad files and scenarios made by hand: a road, an ego, whatever else a test puts there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

HEADER = (
    'timeStepSize="{dt}" commonRoadVersion="2020a" benchmarkID="{name}" '
    'author="" affiliation="" source="" date="2024-01-01"'
)


def exact(tag: str, value: object) -> str:
    return f"<{tag}><exact>{value}</exact></{tag}>"


def point(x: object, y: object) -> str:
    return f"<point><x>{x}</x><y>{y}</y></point>"


def state(
    x: object, y: object, *, k: object = 0, heading: object = 0.0, v: object = 10.0,
    leave: Iterable[str] = (), position: str | None = None, tag: str = "initialState",
    acceleration: object = 0.0,
) -> str:  # fmt: skip
    """One state; ``leave`` names elements to leave out, ``position`` replaces the exact point."""
    parts = {
        "position": f"<position>{position or point(x, y)}</position>",
        "orientation": exact("orientation", heading),
        "time": exact("time", k),
        "velocity": exact("velocity", v),
        "acceleration": exact("acceleration", acceleration),
    }
    return f"<{tag}>{''.join(text for name, text in parts.items() if name not in leave)}</{tag}>"


def lanelet(name: int, x: Sequence[object], y: Sequence[float], *, width: float = 3.5, more: str = "") -> str:
    """Along x; ``more``: successors and the like."""
    left = "".join(point(a, b + width / 2) for a, b in zip(x, y, strict=True))
    right = "".join(point(a, b - width / 2) for a, b in zip(x, y, strict=True))
    return (
        f'<lanelet id="{name}"><leftBound>{left}</leftBound><rightBound>{right}</rightBound>{more}</lanelet>'
    )


def strip(name: int, centre: np.ndarray, *, width: float = 4.0, after: Iterable[int] = (),
          before: Iterable[int] = (), more: str = "") -> str:  # fmt: skip
    """A lanelet along any centre line (M, 2), with its successors and predecessors."""
    step = np.gradient(centre, axis=0)
    normal = np.stack([-step[:, 1], step[:, 0]], axis=1) / np.hypot(*step.T)[:, None]
    left, right = ("".join(point(*p) for p in centre + side * 0.5 * width * normal) for side in (1.0, -1.0))
    links = "".join(f'<predecessor ref="{n}"/>' for n in before)
    links += "".join(f'<successor ref="{n}"/>' for n in after)
    bounds = f"<leftBound>{left}</leftBound><rightBound>{right}</rightBound>"
    return f'<lanelet id="{name}">{bounds}{links}{more}</lanelet>'


def car(name: int, start: str, prediction: str = "", *, shape: str | None = None) -> str:
    shape = shape or "<rectangle><length>4.5</length><width>1.8</width></rectangle>"
    body = f"<type>car</type><shape>{shape}</shape>{start}{prediction}"
    return f'<dynamicObstacle id="{name}">{body}</dynamicObstacle>'


def driving(
    name: int, x: float, y: float, v: float, steps: Iterable[int] = range(1, 41), **keys: object
) -> str:
    """A car along x at constant speed."""
    states = "".join(state(x + 0.1 * k * v, y, k=k, v=v, tag="state", **keys) for k in steps)  # type: ignore[arg-type]
    return car(name, state(x, y, v=v), f"<trajectory>{states}</trajectory>")


def problem(name: object = 100, start: str | None = None, goal: str | None = None) -> str:
    if goal is None:
        time = "<time><intervalStart>30</intervalStart><intervalEnd>40</intervalEnd></time>"
        goal = f"<goalState>{time}</goalState>"
    return f'<planningProblem id="{name}">{start or state(20.0, 0.0)}{goal}</planningProblem>'


ROAD = lanelet(1, range(0, 401, 20), [0.0] * 21)
SLOW = driving(30, 45.0, 0.0, 2.0)  # ahead of the ego, slower


def scenario(
    *, road: str = ROAD, obstacles: str = SLOW, problems: str | None = None, dt: object = 0.1,
    name: str = "ZAM_Test-1_1_T-1", prolog: str = "",
) -> str:  # fmt: skip
    """A whole file: by default a straight road, a slower car ahead, one planning problem."""
    header = HEADER.format(dt=dt, name=name)
    place = "<geoNameId>-999</geoNameId><gpsLatitude>999</gpsLatitude><gpsLongitude>999</gpsLongitude>"
    head = f"<location>{place}</location><scenarioTags/>"
    content = f"{head}{road}{obstacles}{problem() if problems is None else problems}"
    return f"<?xml version='1.0' encoding='UTF-8'?>{prolog}<commonRoad {header}>{content}</commonRoad>"


def bend(radius: float, length: float, spacing: float = 2.0) -> np.ndarray:
    """Centre line (M, 2): 30 m straight along x, then a circle (positive radius: to the left)."""
    s = np.arange(0.0, length + spacing, spacing)
    arc = np.maximum(s - 30.0, 0.0) / radius
    x = np.minimum(s, 30.0) + radius * np.sin(arc)
    return np.stack([x, radius * (1.0 - np.cos(arc))], axis=1)
