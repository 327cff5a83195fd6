"""Mutations of CommonRoad scenario files, solution files and configurations.

A mutation takes a seeded generator and what it is to damage, and is found by its name in
:data:`XML_MUTATIONS`, :data:`BYTE_MUTATIONS` or :func:`config_text`. The same seed gives the same file.
"""

from __future__ import annotations

import copy
import math
import random
from collections.abc import Callable
from xml.etree import ElementTree as ET

import yaml

from repair.config import CHOICES, RANGES

__all__ = ["BYTE_MUTATIONS", "XML_MUTATIONS", "config_text", "damage_bytes", "damage_xml"]

Element = ET.Element
XmlMutation = Callable[[random.Random, Element], None]

NUMBERS = (
    "nan", "inf", "-inf", "1e308", "-1e308", "1e999", "1e-320", "-5", "0", "-0", str(10**30), str(-(10**30)), "2147483648",
    "1e9", "-1e9", "1e5", "1e-9", "1_0", "3.7", "-1", "1", "17", "１２",
)  # fmt: skip
# Numbers three times as often as what is none: the latter mostly ends in commonroad-io already.
ODD_NUMBERS = (*NUMBERS * 3, "", " ", "abc", "1,5", "0x10", "7 8", "None", "true")
ODD_STEPS = ("0", "-0.1", "nan", "inf", "-inf", "", "abc", "1e-9", "1e9", "1e-320", "1e308", "0.25", "5", "0.001", "1,0")
ODD_NAMES = ("", "../../x", "a/b", "\u00e4\u00f6-1", "x" * 3000, "DEU_X-1_1_T-1", "C-", "-1_1", "_", "ZAM", "DEU_A-b_c_T-d")
ODD_CONFIG = (
    "nan", ".nan", ".inf", "-.inf", "null", "~", "true", "[]", "{}", "[1, 2]", "{a: {b: [c]}}", "''", "text", "-1",
    "0", "1e300", "-1e300", "1e-300", "99999999999999999999", "2001-01-01", "0x10", "1:30", "${search.delta_t}",
    "${missing}", "${", "???", "!!python/object:os.system x", "!!binary aGk=", "*unknown", "'\\x00'",
)  # fmt: skip


# -- looking around --------------------------------------------------------------------------------


def _parents(root: Element) -> dict[Element, Element]:
    return {child: parent for parent in root.iter() for child in parent}


def _any(rng: random.Random, root: Element, *tags: str) -> Element | None:
    found = [e for e in root.iter() if e.tag in tags]
    return rng.choice(found) if found else None


def _is_number(text: str | None) -> bool:
    try:
        float(text or "")
    except ValueError:
        return False
    return True


def _numbers(root: Element) -> list[Element]:
    return [e for e in root.iter() if not len(e) and _is_number(e.text)]


def _detach(root: Element, element: Element) -> None:
    parent = _parents(root).get(element)
    if parent is not None:
        parent.remove(element)


def _leaf(tag: str, text: str) -> Element:
    made = Element(tag)
    made.text = text
    return made


def _point(x: float, y: float, tag: str = "point") -> Element:
    made = Element(tag)
    made.extend([_leaf("x", repr(x)), _leaf("y", repr(y))])
    return made


_MOVING = ("dynamicObstacle", "obstacle")
_BODIES = (*_MOVING, "staticObstacle")
_STATES = ("initialState", "state", "goalState")
_BOUNDS = ("leftBound", "rightBound")


# -- of any XML ------------------------------------------------------------------------------------


def delete_element(rng: random.Random, root: Element) -> None:
    parents = _parents(root)
    # First a tag, then one of its elements: or nearly all would be points of lanelets.
    tag = rng.choice(sorted({e.tag for e in parents}))
    for victim in rng.sample([e for e in parents if e.tag == tag], 1):
        parents[victim].remove(victim)


def delete_all_of_a_kind(rng: random.Random, root: Element) -> None:
    tag = rng.choice(sorted({e.tag for e in root.iter()} - {root.tag}))
    for child, parent in _parents(root).items():
        if child.tag == tag and child in parent:
            parent.remove(child)


def duplicate_element(rng: random.Random, root: Element) -> None:
    parents = _parents(root)
    tag = rng.choice(sorted({e.tag for e in parents}))
    twin = rng.choice([e for e in parents if e.tag == tag])
    parents[twin].insert(list(parents[twin]).index(twin), copy.deepcopy(twin))


def move_element(rng: random.Random, root: Element) -> None:
    parents = _parents(root)
    tag = rng.choice(sorted({e.tag for e in parents}))
    moved = rng.choice([e for e in parents if e.tag == tag])
    inside = set(moved.iter())
    places = [e for e in root.iter() if e not in inside and len(e)]
    parents[moved].remove(moved)
    place = rng.choice(places or [root])
    place.insert(rng.randrange(len(place) + 1), moved)


def shuffle_children(rng: random.Random, root: Element) -> None:
    element = rng.choice([e for e in root.iter() if len(e) > 1])
    children = list(element)
    rng.shuffle(children)
    element[:] = children


def rename_tag(rng: random.Random, root: Element) -> None:
    tag = rng.choice(sorted({e.tag for e in root.iter()}))
    new = rng.choice(["x", tag.upper(), tag[:-1] or "y", "point", "exact", "commonRoad", "planningProblem"])
    chosen = [e for e in root.iter() if e.tag == tag]
    for element in chosen if rng.random() < 0.3 else rng.sample(chosen, 1):
        element.tag = new


def odd_number(rng: random.Random, root: Element) -> None:
    parents, numbers = _parents(root), _numbers(root)
    group = rng.choice(sorted({parents[e].tag for e in numbers if e in parents}))
    rng.choice([e for e in numbers if e in parents and parents[e].tag == group]).text = rng.choice(ODD_NUMBERS)


def many_odd_numbers(rng: random.Random, root: Element) -> None:
    numbers = _numbers(root)
    for element in rng.sample(numbers, min(len(numbers), rng.choice([3, 10, 100]))):
        element.text = rng.choice(ODD_NUMBERS)


def scale_number(rng: random.Random, root: Element) -> None:
    element = rng.choice(_numbers(root))
    element.text = repr(float(element.text or 0.0) * rng.choice([-1.0, 0.0, 1e-6, 10.0, 1e3, 1e6]))


def odd_attribute(rng: random.Random, root: Element) -> None:
    name = rng.choice(sorted({a for e in root.iter() for a in e.attrib}))
    element = rng.choice([e for e in root.iter() if name in e.attrib])
    if rng.random() < 0.4:
        del element.attrib[name]
    else:
        element.attrib[name] = rng.choice((*ODD_NUMBERS, *ODD_NAMES))


def deep_nesting(rng: random.Random, root: Element) -> None:
    element = rng.choice(list(root.iter()))
    for _ in range(rng.choice([50, 500])):
        inner = Element(element.tag)
        element.append(inner)
        element = inner


def text_in_place_of_children(rng: random.Random, root: Element) -> None:
    tag = rng.choice(sorted({e.tag for e in root.iter() if len(e) and e is not root}))
    element = rng.choice([e for e in root.iter() if e.tag == tag and len(e)])
    element[:] = []
    element.text = rng.choice(["", "7", "text"])


# -- of scenarios ----------------------------------------------------------------------------------


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
    owner = _any(rng, root, *_BODIES, "planningProblem") if rng.random() < 0.7 else root
    shift = rng.choice([-1, -3, -1000, 1, 5, 10**6, 10**9])
    for time in (root if owner is None else owner).iter("time"):
        for leaf in time.iter():
            if not len(leaf) and _is_number(leaf.text):
                value = float(leaf.text or 0)
                leaf.text = str(int(value) + shift) if math.isfinite(value) else leaf.text


def odd_time(rng: random.Random, root: Element) -> None:
    time = _any(rng, root, "time")
    if time is not None:
        for leaf in [e for e in time.iter() if not len(e)]:
            leaf.text = rng.choice(["-1", "-3", "1e9", "1000000000", "nan", "1.5", "", "x", "0", "99999999999999999999"])


def time_interval(rng: random.Random, root: Element) -> None:
    time = _any(rng, root, "time")
    if time is not None:
        low, high = rng.choice([("0", "3"), ("5", "2"), ("-5", "5"), ("0", "1000000000"), ("nan", "4"), ("0", "")])
        time[:] = [_leaf("intervalStart", low), _leaf("intervalEnd", high)]


def drop_from_states(rng: random.Random, root: Element) -> None:
    """No yaw, speed, time or position: in one state, in all states of an owner, or everywhere."""
    name = rng.choice(["orientation", "velocity", "time", "position", "acceleration", "yawRate", "slipAngle"])
    owner = rng.choice([root, _any(rng, root, *_BODIES), _any(rng, root, "planningProblem"), _any(rng, root, *_STATES)])
    for state in (root if owner is None else owner).iter():
        if state.tag in _STATES:
            for child in [c for c in state if c.tag == name]:
                state.remove(child)


def uncertain_value(rng: random.Random, root: Element) -> None:
    element = _any(rng, root, "orientation", "velocity", "acceleration", "yawRate")
    if element is not None:
        low, high = rng.choice([("-0.1", "0.2"), ("3", "8"), ("0.2", "-0.2"), ("-9", "9"), ("nan", "1"), ("0", "0"), ("", "1")])
        element[:] = [_leaf("intervalStart", low), _leaf("intervalEnd", high)]


def uncertain_position(rng: random.Random, root: Element) -> None:
    states = [e for e in root.iter() if e.tag in _STATES and e.find("position/point") is not None]
    chosen = states if rng.random() < 0.2 else rng.sample(states, min(1, len(states)))
    for state in chosen:
        position = state.find("position")
        point = position.find("point")
        x, y = (float(v) if _is_number(v) else 0.0 for v in (point.findtext("x"), point.findtext("y")))
        position[:] = [_area(rng, x, y)]


def _area(rng: random.Random, x: float, y: float) -> Element:
    kind = rng.choice(["circle", "rectangle", "polygon", "line", "dot"])
    if kind == "circle":
        made = Element("circle")
        made.extend([_leaf("radius", rng.choice(["0.5", "3", "0", "-1", "1e9"])), _point(x, y, "center")])
        return made
    if kind == "rectangle":
        made = Element("rectangle")
        sizes = [_leaf(name, rng.choice(["1", "4", "0", "-2", "1e6"])) for name in ("length", "width")]
        made.extend([*sizes, _leaf("orientation", rng.choice(["0", "1.2", "99", "nan"])), _point(x, y, "center")])
        return made
    corners = {"polygon": [(-1, -1), (1, -1), (0, 2)], "line": [(0, 0), (1, 1), (2, 2)], "dot": [(0, 0)] * 3}[kind]
    made = Element("polygon")
    made.extend([_point(x + dx, y + dy) for dx, dy in corners])
    return made


def odd_shape(rng: random.Random, root: Element) -> None:
    element = _any(rng, root, "rectangle", "circle", "polygon")
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
    trajectory = _any(rng, root, "trajectory", "occupancySet")
    if trajectory is not None and len(trajectory) > 3:
        low = rng.randrange(len(trajectory) - 1)
        trajectory[low : low + rng.randrange(1, 6)] = []


def obstacle_on_the_ego(rng: random.Random, root: Element) -> None:
    body, start = _any(rng, root, *_BODIES), root.find("planningProblem/initialState")
    state = None if body is None else body.find("initialState")
    if state is not None and start is not None:
        state[:] = [copy.deepcopy(c) for c in start]


def odd_bound(rng: random.Random, root: Element) -> None:
    """Zero length, duplicate points, one point, reversed, unequal numbers of points, swapped sides."""
    lanelet = _any(rng, root, "lanelet")
    bounds = [] if lanelet is None else [b for b in lanelet if b.tag in _BOUNDS]
    if len(bounds) < 2:
        return
    kind = rng.choice(["zero", "duplicate", "one", "none", "reversed", "unequal", "swapped", "same", "zigzag", "all_zero"])
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
    goal = _any(rng, root, "goalState")
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
        position[:] = [_point(1.0, 2.0)]
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
    numbers = [] if state is None else _numbers(state)
    if numbers:
        changed = rng.choice(numbers)
        changed.text = rng.choice([*ODD_NUMBERS, "50", "-20", "150", "3.14", repr(float(changed.text or 0) + 3.0)])


def odd_time_step(rng: random.Random, root: Element) -> None:
    root.attrib["timeStepSize"] = rng.choice(ODD_STEPS)
    if rng.random() < 0.1:
        del root.attrib["timeStepSize"]


def odd_header(rng: random.Random, root: Element) -> None:
    name = rng.choice(["commonRoadVersion", "benchmarkID", "date", "author", "source", "tags"])
    root.attrib[name] = rng.choice([*ODD_NAMES, "2017a", "2018b", "2020a", "9999z"])
    if rng.random() < 0.2:
        del root.attrib[name]


def jitter(rng: random.Random, root: Element) -> None:
    """Noise on many numbers: bounds that cross, bodies that jump."""
    noise, share = rng.choice([0.001, 0.02, 0.3]), rng.choice([0.02, 0.3, 1.0])
    for leaf in _numbers(root):
        if leaf.text and not leaf.text.isdigit() and rng.random() < share:
            leaf.text = repr(float(leaf.text) * (1.0 + rng.gauss(0.0, noise)))


def scale_world(rng: random.Random, root: Element) -> None:
    """Roads of a millimetre's or a hundred kilometres' length; a mirrored one, left and right swapped."""
    x, y = rng.choice([(1e-3, 1e-3), (0.1, 0.1), (10.0, 10.0), (1e3, 1e3), (1.0, -1.0), (1.0, 0.0), (0.1, 10.0)])
    for leaf in root.iter():
        if leaf.tag in ("x", "y") and _is_number(leaf.text):
            leaf.text = repr(float(leaf.text or 0) * (x if leaf.tag == "x" else y))


def translate(rng: random.Random, root: Element) -> None:
    """The whole scenario somewhere else, as in UTM coordinates: nothing may depend on where."""
    shift = rng.choice([1e3, 5e5, 5e6, -1e8])
    for leaf in root.iter():
        if leaf.tag in ("x", "y") and _is_number(leaf.text):
            leaf.text = repr(float(leaf.text or 0) + shift)


XML_MUTATIONS: dict[str, XmlMutation] = {
    f.__name__: f
    for f in (
        delete_element, delete_all_of_a_kind, duplicate_element, move_element, shuffle_children, rename_tag,
        odd_number, many_odd_numbers, scale_number, odd_attribute, deep_nesting, text_in_place_of_children, swap_ids,
        same_id, odd_reference, shift_times, odd_time, time_interval, drop_from_states, uncertain_value,
        uncertain_position, odd_shape, no_prediction, gap_in_prediction, obstacle_on_the_ego, odd_bound, odd_topology,
        no_goal, odd_goal, second_problem, odd_start, odd_time_step, odd_header, translate, jitter, scale_world,
    )
}  # fmt: skip
_GENERIC = (
    "delete_element", "delete_all_of_a_kind", "duplicate_element", "move_element", "shuffle_children", "rename_tag",
    "odd_number", "many_odd_numbers", "scale_number", "odd_attribute", "deep_nesting", "text_in_place_of_children",
    "jitter", "scale_world", "translate",
)  # fmt: skip


def damage_xml(rng: random.Random, data: bytes, name: str | None = None) -> tuple[bytes, str]:
    """One to three XML mutations; ``name`` fixes the first. Returns the file and what was done to it.

    Parameters
    ----------
    rng : random.Random
    data : bytes
        A well-formed XML file.
    name : str, optional
        Key of :data:`XML_MUTATIONS`; ``generic`` for one that suits any XML file.
    """
    root = ET.fromstring(data)
    first = rng.choice(_GENERIC) if name == "generic" else name or rng.choice(sorted(XML_MUTATIONS))
    pool = _GENERIC if name == "generic" else sorted(XML_MUTATIONS)
    names = [first] + [rng.choice(pool) for _ in range(rng.choice([0, 0, 1, 2]))]
    done = []
    for each in names:
        try:
            XML_MUTATIONS[each](rng, root)
            done.append(each)
        except IndexError:  # nothing is left that this one could damage
            pass
    return ET.tostring(root, encoding="utf-8", xml_declaration=True), "+".join(done) or "unchanged"


# -- bytes -----------------------------------------------------------------------------------------


def truncate(rng: random.Random, data: bytes) -> bytes:
    return data[: rng.randrange(len(data))]


def flip_bytes(rng: random.Random, data: bytes) -> bytes:
    damaged = bytearray(data)
    for _ in range(rng.choice([1, 3, 30])):
        damaged[rng.randrange(len(damaged))] = rng.randrange(256)
    return bytes(damaged)


def change_digits(rng: random.Random, data: bytes) -> bytes:
    damaged = bytearray(data)
    digits = [i for i, b in enumerate(data) if b in b"0123456789.-"]
    for i in rng.sample(digits, min(len(digits), rng.choice([5, 50]))):
        damaged[i] = rng.choice(b"0123456789.-e")
    return bytes(damaged)


def delete_span(rng: random.Random, data: bytes) -> bytes:
    start = rng.randrange(len(data))
    return data[:start] + data[start + rng.choice([1, 20, 2000]) :]


def repeat_span(rng: random.Random, data: bytes) -> bytes:
    start = rng.randrange(len(data))
    end = start + rng.choice([1, 20, 2000])
    return data[:end] + data[start:end] + data[end:]


def wrong_encoding(rng: random.Random, data: bytes) -> bytes:
    text = data.decode("utf-8", "replace")
    kind = rng.randrange(6)
    if kind == 0:
        return text.encode("utf-16")
    if kind == 1:
        return data.replace(b"UTF-8", b"no-such-code").replace(b"utf-8", b"no-such-code")
    if kind == 2:
        return data[: len(data) // 2] + b"\xff\xfe\x00\x80" + data[len(data) // 2 :]
    if kind == 3:
        return b"\xef\xbb\xbf" + data
    if kind == 4:
        return data.replace(b">", b">\x00", 3)
    return text.encode("utf-32")


def not_a_scenario(rng: random.Random, data: bytes) -> bytes:
    return rng.choice(
        [b"", b" \n", b"\x00" * 100, b"<html><body/></html>", b"{}", b"PK\x03\x04", data[::-1], b"<commonRoad/>",
         b"<commonRoad timeStepSize='0.1'/>", data + data, rng.randbytes(500)]
    )  # fmt: skip


def _after_declaration(data: bytes, doctype: bytes) -> bytes:
    end = data.find(b"?>") + 2 if data.lstrip().startswith(b"<?xml") else 0
    return data[:end] + doctype + data[end:]


def _use_entity(data: bytes, name: bytes) -> bytes:
    at = data.find(b"</x>")
    return data[:at] + b"&" + name + b";" + data[at:] if at > 0 else data


def entity_bomb(rng: random.Random, data: bytes) -> bytes:
    lines = [b'<!ENTITY e0 "1111111111">'] + [
        b'<!ENTITY e%d "%s">' % (k, b"&e%d;" % (k - 1) * rng.choice([10, 50])) for k in range(1, rng.choice([5, 9]))
    ]
    return _use_entity(_after_declaration(data, b"<!DOCTYPE x [" + b"".join(lines) + b"]>"), b"e%d" % (len(lines) - 1))


def external_entity(rng: random.Random, data: bytes) -> bytes:
    where = rng.choice([b"file:///etc/hostname", b"file:///dev/zero", b"http://127.0.0.1:9/x", b"nothing.txt"])
    kind = rng.choice([b'<!DOCTYPE x SYSTEM "%s">', b'<!DOCTYPE x [<!ENTITY e SYSTEM "%s">]>',
                       b'<!DOCTYPE x [<!ENTITY %% p SYSTEM "%s"> %%p;]>'])  # fmt: skip
    return _use_entity(_after_declaration(data, kind % where), b"e")


BYTE_MUTATIONS: dict[str, Callable[[random.Random, bytes], bytes]] = {
    f.__name__: f
    for f in (
        truncate, flip_bytes, change_digits, delete_span, repeat_span, wrong_encoding, not_a_scenario, entity_bomb,
        external_entity,
    )
}  # fmt: skip


def damage_bytes(rng: random.Random, data: bytes, name: str) -> tuple[bytes, str]:
    """One byte-level mutation, by name."""
    return BYTE_MUTATIONS[name](rng, data), name


# -- configurations --------------------------------------------------------------------------------


def config_text(rng: random.Random, name: str) -> bytes:
    """A YAML file: ``extremes`` is valid throughout, ``types`` has wrong types and keys, ``garbage`` anything."""
    if name == "extremes":
        return yaml.safe_dump(_nested(dict(_extreme(rng) for _ in range(rng.randrange(1, 4))))).encode()
    if name == "types":
        keys = rng.sample([*RANGES, *CHOICES, "seed", "backend", "scenario", "for_backend", "search", "nothing.here"], 2)
        lines = []
        for key in keys:
            *sections, last = key.split(".")
            lines += ["  " * depth + f"{section}:" for depth, section in enumerate(sections)]
            lines.append("  " * len(sections) + f"{last}: {rng.choice(ODD_CONFIG)}")
        return "\n".join(lines).encode()
    return _garbage(rng)


def _extreme(rng: random.Random) -> tuple[str, object]:
    if rng.random() < 0.2:
        key = rng.choice([k for k in sorted(CHOICES) if k not in ("driver", "reference.source", "casadi.solver")])
        return key, rng.choice(CHOICES[key])
    key = rng.choice([k for k in sorted(RANGES) if not k.startswith(("casadi", "qptr", "evasive"))])
    low, high = RANGES[key]
    whole = float(low).is_integer() and float(high).is_integer() and key in _WHOLE
    value = rng.choice([low, high, low + 0.1 * (high - low), low + 0.01 * (high - low)])
    return key, int(value) if whole else float(value)


_WHOLE = {"repair.degree", "ego.max_iterations", "ego.rebounds", "checker.substeps"}


def _nested(flat: dict[str, object]) -> dict[str, object]:
    made: dict[str, object] = {}
    for key, value in flat.items():
        section, _, last = key.partition(".")
        if last:
            inner = made.setdefault(section, {})
            assert isinstance(inner, dict)
            inner[last] = value
        else:
            made[section] = value
    return made


def _garbage(rng: random.Random) -> bytes:
    bomb = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    bomb += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 9)]
    return rng.choice(
        [
            b"", b"\n", b"- 1\n- 2\n", b"text", b"7", b"search", b"search:", b"search: [1]", b"\tsearch: 1", b"{",
            b"[" * 5000, b"{a: " * 3000, b"a: b: c", b"\xff\xfe\xfd", b"\x00", "\n".join(bomb).encode(),
            b"search: &s\n  delta_t: 0.2\n  <<: *s", b"? [a, b]\n: 1", b"1: 2", b"null: 1", b"search: {1: 2}",
            b"search:\n  delta_t: 0.1\n  delta_t: 0.2", b"--- {}\n--- {}", b"!!set {a}", b"!!python/object/apply:os.getcwd []",
            b"for_backend: {ego: 3}", b"for_backend: {ego: {backend: casadi}}", b"for_backend: {ego: {for_backend: {ego: {}}}}",
            b"for_backend: {ego: {search: 1}}", b"for_backend: 3", b"scenario: [1]", b"backend: [ego]", b"backend: nothing",
            b"search: ${scene}", b"search: {delta_t: '${search.delta_t}'}", b"seed: ${oc.env:HOME}", b"driver: ???",
            b"<xml/>", rng.randbytes(200),
        ]
    )  # fmt: skip
