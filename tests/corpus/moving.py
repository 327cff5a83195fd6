"""A scenario file moved, turned, mirrored: the same situation at another place.

commonroad-io's own ``translate_rotate`` (2024.3) is not used: it cannot move environment obstacles and the
states of a point mass (AttributeError for both), leaves where they were the occupancies that were asked for
before and the tree by which lanelets are looked up (after it ``find_lanelet_by_position`` finds nothing), and
does not mirror. Here the numbers of the file are changed, by what they mean in it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from xml.etree import ElementTree

import shapely

__all__ = ["CHANGES", "changed", "mirrored", "moved"]

Element = ElementTree.Element
_STATES = frozenset({"initialState", "state", "goalState"})
_ACROSS = ("yawRate", "slipAngle", "steeringAngle", "steeringAngleSpeed", "hitchAngle", "yawAcceleration",
           "slipAngleRate", "rollAngle", "rollRate", "curvature", "curvatureRate")  # fmt: skip
_SIDES = {
    "leftBound": "rightBound", "adjacentLeft": "adjacentRight",
    "successorsLeft": "successorsRight", "isLeftOf": "isRightOf",
}  # fmt: skip
_SIDES |= {right: left for left, right in _SIDES.items()}


class _NotMoved(ValueError):
    """What is in the file has no meaning that could be moved."""


def _bodies(root: Element) -> set[Element]:
    """All elements inside of shapes that are given about their obstacle's own position."""
    return {
        element
        for owner in root
        if owner.tag in ("staticObstacle", "dynamicObstacle", "obstacle")
        for shape in owner.findall("shape")
        for element in shape.iter()
    }


def _number(element: Element | None) -> float:
    return float((element.text if element is not None else None) or 0.0)


def _points(root: Element) -> Iterator[tuple[Element, Element, Element]]:
    for element in root.iter():
        x, y = element.find("x"), element.find("y")
        if x is not None and y is not None:
            yield element, x, y


def _headings(root: Element) -> Iterator[Element]:
    """The elements ``orientation`` of states."""
    for state in root.iter():
        if state.tag in _STATES:
            yield from state.findall("orientation")


def _state_values(root: Element, names: tuple[str, ...]) -> Iterator[Element]:
    for state in root.iter():
        if state.tag in _STATES:
            for name in names:
                yield from state.findall(name)


def _negate(value: Element) -> None:
    """Of an exact value or an interval, its negative."""
    for exact in value.findall("exact"):
        exact.text = repr(-_number(exact))
    low, high = value.find("intervalStart"), value.find("intervalEnd")
    if low is not None and high is not None:
        low.text, high.text = repr(-_number(high)), repr(-_number(low))


def _require_plain(root: Element) -> None:
    """Refuse velocities by component: whether they are the body's or the map's is not settled."""
    if any(True for _ in root.iter("velocityY")):
        raise _NotMoved("states with a velocity across")


def _require_centred(root: Element) -> None:
    """Refuse to turn a body that is not centred on its position.

    commonroad-io turns it about its own centre and leaves the offset as it is: that reading, which counts
    beside the rigid one, depends on the direction of the axes.
    """
    for shape in [
        e for owner in root for e in owner.findall("shape") if owner.find("initialState") is not None
    ]:
        centres = [(_number(c.find("x")), _number(c.find("y"))) for c in shape.iter("center")]
        for polygon in shape.iter("polygon"):
            corners = [(_number(p.find("x")), _number(p.find("y"))) for p in polygon.iter("point")]
            centre = shapely.Polygon(corners).centroid
            centres.append((centre.x, centre.y))
        if any(math.hypot(*centre) > 1e-3 for centre in centres):
            raise _NotMoved("a body off its centre")


def _centred(root: Element, bodies: set[Element]) -> None:
    """Write down the centre (0, 0) that shapes in the plane have where none is given."""
    for shape in root.iter():
        if shape.tag in ("rectangle", "circle") and shape not in bodies and shape.find("center") is None:
            centre = ElementTree.SubElement(shape, "center")
            for name in "xy":
                ElementTree.SubElement(centre, name).text = "0.0"


def moved(turn: float, x0: float, y0: float) -> Callable[[Element], None]:
    """Turned about the origin by ``turn`` [rad], then moved by (x0, y0) [m]."""
    c, s = math.cos(turn), math.sin(turn)

    def change(root: Element) -> None:
        _require_plain(root)
        if turn:
            _require_centred(root)
        bodies = _bodies(root)
        _centred(root, bodies)
        for element, x, y in _points(root):
            if element not in bodies:
                here = _number(x), _number(y)
                x.text, y.text = repr(c * here[0] - s * here[1] + x0), repr(s * here[0] + c * here[1] + y0)
        if not turn:
            return
        for rectangle in root.iter("rectangle"):
            if rectangle not in bodies:
                heading = rectangle.find("orientation")
                if heading is None:
                    heading = ElementTree.SubElement(rectangle, "orientation")
                heading.text = repr(math.remainder(_number(heading) + turn, 2 * math.pi))
        for heading in _headings(root):
            for exact in heading.findall("exact"):
                exact.text = repr(math.remainder(_number(exact) + turn, 2 * math.pi))
            low, high = heading.find("intervalStart"), heading.find("intervalEnd")
            if low is not None and high is not None:  # commonroad-io takes angles within one turn
                first = math.remainder(_number(low) + turn, 2 * math.pi)
                width = _number(high) - _number(low)
                low.text, high.text = repr(first), repr(first + width)

    return change


def mirrored(root: Element) -> None:
    """Left is right: y becomes -y."""
    _require_plain(root)
    for _, _, y in _points(root):
        y.text = repr(-_number(y))
    for rectangle in root.iter("rectangle"):
        for heading in rectangle.findall("orientation"):
            heading.text = repr(-_number(heading))
    for value in _state_values(root, ("orientation", *_ACROSS)):
        _negate(value)
    for lane in root.iter("lanelet"):
        for part in lane:
            part.tag = _SIDES.get(part.tag, part.tag)
    for crossing in root.iter("intersection"):
        for part in crossing.iter():
            part.tag = _SIDES.get(part.tag, part.tag)


CHANGES: dict[str, Callable[[Element], None]] = {
    "moved": moved(0.0, 1234.5, -678.25),
    "turned": moved(2.0, 0.0, 0.0),
    "mirrored": mirrored,
}


def changed(data: bytes, change: Callable[[Element], None]) -> bytes | None:
    """The file after a change; None where something in it cannot be changed so."""
    root = ElementTree.fromstring(data)
    try:
        change(root)
    except _NotMoved:
        return None
    return ElementTree.tostring(root, "utf-8", xml_declaration=True)
