"""Mutations of CommonRoad scenario files."""

from __future__ import annotations

import copy
import math
import random
from xml.etree import ElementTree as ET

from tests.fuzz.elements import (
    ODD_NAMES,
    ODD_NUMBERS,
    Element,
    any_of,
    is_number,
    make_leaf,
    make_point,
    number_leaves,
)

_STEPS = (
    "0", "-0.1", "nan", "inf", "-inf", "", "abc", "1e-9", "1e9", "1e-320", "1e308", "0.25", "5", "0.001",
    "1,0", "10",
)  # fmt: skip

_MOVING = ("dynamicObstacle", "obstacle")
_BODIES = (*_MOVING, "staticObstacle")
_STATES = ("initialState", "state", "goalState")
_BOUNDS = ("leftBound", "rightBound")


def swap_ids(rng: random.Random, root: Element) -> None:
    owners = [e for e in root.iter() if "id" in e.attrib]
    if len(owners) > 1:
        first, second = rng.sample(owners, 2)
        first.attrib["id"], second.attrib["id"] = second.attrib["id"], first.attrib["id"]


def same_id(rng: random.Random, root: Element) -> None:
    owners = [e for e in root.iter() if "id" in e.attrib]
    if len(owners) > 1:
        first, second = rng.sample(owners, 2)
        first.attrib["id"] = second.attrib["id"]


def odd_reference(rng: random.Random, root: Element) -> None:
    element = rng.choice([e for e in root.iter() if "ref" in e.attrib] or [root])
    ids = [e.attrib["id"] for e in root.iter() if "id" in e.attrib]
    element.attrib["ref"] = rng.choice(["-1", "999999", "x", "", *rng.sample(ids, min(3, len(ids)))])


def shift_times(rng: random.Random, root: Element) -> None:
    """Time steps of one element, or of all, moved: negative, or far away."""
    owner = any_of(rng, root, *_BODIES, "planningProblem") if rng.random() < 0.7 else root
    shift = rng.choice([-1, -3, -1000, 1, 5, 10**6, 10**9])
    for time in (root if owner is None else owner).iter("time"):
        for leaf in time.iter():
            if not len(leaf) and is_number(leaf.text):
                value = float(leaf.text or 0)
                leaf.text = str(int(value) + shift) if math.isfinite(value) else leaf.text


def odd_time(rng: random.Random, root: Element) -> None:
    time = any_of(rng, root, "time")
    if time is not None:
        for leaf in [e for e in time.iter() if not len(e)]:
            leaf.text = rng.choice(
                ["-1", "-3", "1e9", "1000000000", "nan", "1.5", "", "x", "0", "99999999999999999999"]
            )


def time_interval(rng: random.Random, root: Element) -> None:
    time = any_of(rng, root, "time")
    if time is not None:
        low, high = rng.choice(
            [("0", "3"), ("5", "2"), ("-5", "5"), ("0", "1000000000"), ("nan", "4"), ("0", "")]
        )
        time[:] = [make_leaf("intervalStart", low), make_leaf("intervalEnd", high)]


def drop_from_states(rng: random.Random, root: Element) -> None:
    """No yaw, speed, time or position: in one state, in all states of an owner, or everywhere."""
    name = rng.choice(["orientation", "velocity", "time", "position", "acceleration", "yawRate", "slipAngle"])
    owner = rng.choice(
        [root, any_of(rng, root, *_BODIES), any_of(rng, root, "planningProblem"), any_of(rng, root, *_STATES)]
    )
    for state in (root if owner is None else owner).iter():
        if state.tag in _STATES:
            for child in [c for c in state if c.tag == name]:
                state.remove(child)


def uncertain_value(rng: random.Random, root: Element) -> None:
    element = any_of(rng, root, "orientation", "velocity", "acceleration", "yawRate")
    if element is not None:
        low, high = rng.choice(
            [("-0.1", "0.2"), ("3", "8"), ("0.2", "-0.2"), ("-9", "9"), ("nan", "1"), ("0", "0"), ("", "1")]
        )
        element[:] = [make_leaf("intervalStart", low), make_leaf("intervalEnd", high)]


def uncertain_position(rng: random.Random, root: Element) -> None:
    states = [e for e in root.iter() if e.tag in _STATES and e.find("position/point") is not None]
    chosen = states if rng.random() < 0.2 else rng.sample(states, min(1, len(states)))
    for state in chosen:
        position = state.find("position")
        point = position.find("point")
        x, y = (float(v) if is_number(v) else 0.0 for v in (point.findtext("x"), point.findtext("y")))
        position[:] = [_area(rng, x, y)]


def _area(rng: random.Random, x: float, y: float) -> Element:
    kind = rng.choice(["circle", "rectangle", "polygon", "line", "dot"])
    if kind == "circle":
        made = Element("circle")
        made.extend(
            [make_leaf("radius", rng.choice(["0.5", "3", "0", "-1", "1e9"])), make_point(x, y, "center")]
        )
        return made
    if kind == "rectangle":
        made = Element("rectangle")
        sizes = [make_leaf(name, rng.choice(["1", "4", "0", "-2", "1e6"])) for name in ("length", "width")]
        made.extend(
            [
                *sizes,
                make_leaf("orientation", rng.choice(["0", "1.2", "99", "nan"])),
                make_point(x, y, "center"),
            ]
        )
        return made
    outlines = {"polygon": [(-1, -1), (1, -1), (0, 2)], "line": [(0, 0), (1, 1), (2, 2)], "dot": [(0, 0)] * 3}
    made = Element("polygon")
    made.extend([make_point(x + dx, y + dy) for dx, dy in outlines[kind]])
    return made


def odd_shape(rng: random.Random, root: Element) -> None:
    element = any_of(rng, root, "rectangle", "circle", "polygon")
    if element is None:
        return
    if element.tag == "polygon":
        element[:] = list(element)[: rng.choice([0, 1, 2])] if rng.random() < 0.5 else list(element)[::-1]
    for leaf in element:
        if not len(leaf) and rng.random() < 0.6:
            leaf.text = rng.choice(["0", "-1", "1e6", "1e-9", "nan", "inf", "1e200", ""])


def no_prediction(rng: random.Random, root: Element) -> None:
    owners = [e for e in root.iter() if e.tag in _MOVING]
    for owner in owners if rng.random() < 0.3 else rng.sample(owners, min(1, len(owners))):
        for child in [c for c in owner if c.tag in ("trajectory", "occupancySet")]:
            if rng.random() < 0.7:
                owner.remove(child)
            else:
                child[:] = list(child)[: rng.choice([0, 1])]


def gap_in_prediction(rng: random.Random, root: Element) -> None:
    trajectory = any_of(rng, root, "trajectory", "occupancySet")
    if trajectory is not None and len(trajectory) > 3:
        low = rng.randrange(len(trajectory) - 1)
        trajectory[low : low + rng.randrange(1, 6)] = []


def obstacle_on_the_ego(rng: random.Random, root: Element) -> None:
    body, start = any_of(rng, root, *_BODIES), root.find("planningProblem/initialState")
    state = None if body is None else body.find("initialState")
    if state is not None and start is not None:
        state[:] = [copy.deepcopy(c) for c in start]


def odd_bound(rng: random.Random, root: Element) -> None:
    """Zero length, duplicate points, one point, reversed, unequal numbers of points, swapped sides."""
    lanelet = any_of(rng, root, "lanelet")
    bounds = [] if lanelet is None else [b for b in lanelet if b.tag in _BOUNDS]
    if len(bounds) < 2:
        return
    kind = rng.choice(
        ["zero", "duplicate", "one", "none", "reversed", "unequal", "swapped", "same", "zigzag", "all_zero"]
    )
    if kind == "swapped":
        bounds[0].tag, bounds[1].tag = bounds[1].tag, bounds[0].tag
    if kind == "same":
        bounds[0][:] = [copy.deepcopy(p) for p in bounds[1]]
    if kind == "all_zero":
        bounds = [b for b in root.iter() if b.tag in _BOUNDS]
    for bound in bounds:
        points = [p for p in bound if p.tag == "point"]
        if not points:
            continue
        if kind in ("zero", "all_zero"):
            bound[:] = [copy.deepcopy(points[0]) for _ in points]
        elif kind == "duplicate":
            bound[:] = [copy.deepcopy(p) for p in points for _ in range(rng.randrange(1, 4))]
        elif kind in ("one", "none"):
            bound[:] = points[:1] if kind == "one" else []
        elif kind == "reversed":
            bound[:] = points[::-1]
        elif kind == "zigzag":
            bound[:] = [*points, *points[::-1], *points]
    if kind == "unequal":
        bounds[0][:] = list(bounds[0])[:-1]


def odd_topology(rng: random.Random, root: Element) -> None:
    lanelets = [e for e in root.iter("lanelet") if "id" in e.attrib]
    if not lanelets:
        return
    lanelet = rng.choice(lanelets)
    tag = rng.choice(["successor", "predecessor", "adjacentLeft", "adjacentRight"])
    target = rng.choice([lanelet, *lanelets]).attrib["id"] if rng.random() < 0.8 else "424242"
    attributes = {"ref": target}
    if tag.startswith("adjacent"):
        attributes["drivingDir"] = rng.choice(["same", "opposite", "", "sideways"])
    lanelet.append(ET.Element(tag, attributes))


def no_goal(rng: random.Random, root: Element) -> None:
    for problem in root.iter("planningProblem"):
        for goal in problem.findall("goalState"):
            if rng.random() < 0.5:
                problem.remove(goal)
            else:
                for child in [c for c in goal if rng.random() < 0.5]:
                    goal.remove(child)


def odd_goal(rng: random.Random, root: Element) -> None:
    goal = any_of(rng, root, "goalState")
    if goal is None:
        return
    position = goal.find("position")
    if position is None:
        position = ET.SubElement(goal, "position")
    kind = rng.choice(["far", "lanelet", "area", "point"])
    if kind == "lanelet":
        ids = [e.attrib.get("id", "1") for e in root.iter("lanelet")]
        position[:] = [Element("lanelet", {"ref": rng.choice([*ids, "424242"])})]
    elif kind == "point":
        position[:] = [make_point(1.0, 2.0)]
    else:
        position[:] = [_area(rng, *((1e7, -1e7) if kind == "far" else (0.0, 0.0)))]


def second_problem(rng: random.Random, root: Element) -> None:
    problem = root.find("planningProblem")
    if problem is not None:
        twin = copy.deepcopy(problem)
        twin.attrib["id"] = rng.choice([problem.attrib.get("id", "1"), "424242", "-7", "0", "x"])
        root.append(twin)


def odd_start(rng: random.Random, root: Element) -> None:
    state = root.find("planningProblem/initialState")
    numbers = [] if state is None else number_leaves(state)
    if numbers:
        changed = rng.choice(numbers)
        changed.text = rng.choice(
            [*ODD_NUMBERS, "50", "-20", "150", "3.14", repr(float(changed.text or 0) + 3.0)]
        )


def odd_time_step(rng: random.Random, root: Element) -> None:
    root.attrib["timeStepSize"] = rng.choice(_STEPS)
    if rng.random() < 0.1:
        del root.attrib["timeStepSize"]


def odd_header(rng: random.Random, root: Element) -> None:
    name = rng.choice(["commonRoadVersion", "benchmarkID", "date", "author", "source", "tags"])
    root.attrib[name] = rng.choice([*ODD_NAMES, "2017a", "2018b", "2020a", "9999z"])
    if rng.random() < 0.2:
        del root.attrib[name]


SCENARIO = (
    swap_ids, same_id, odd_reference, shift_times, odd_time, time_interval, drop_from_states, uncertain_value,
    uncertain_position, odd_shape, no_prediction, gap_in_prediction, obstacle_on_the_ego, odd_bound,
    odd_topology, no_goal, odd_goal, second_problem, odd_start, odd_time_step, odd_header,
)  # fmt: skip
