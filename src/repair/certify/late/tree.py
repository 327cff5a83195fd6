"""The tree of a proof: its parts cover all motions, and each ends in rows that no motion keeps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from operator import index
from typing import Any

from repair.certify.late.assumed import Assumed, Headings, headings
from repair.certify.late.places import convex, met_throughout
from repair.certify.late.sums import Row, kept_by_none

__all__ = ["Wrong", "leaves"]

_SURE = 1e-10  # [rad]


class Wrong(Exception):
    """The proof does not hold; the sentence says where."""


@dataclass(frozen=True)
class _Place:
    """A polygon of forbidden places at an instant, for headings."""

    instant: int
    low: float
    high: float
    corners: list[tuple[float, float]]


@dataclass(frozen=True)
class _Part:
    """Of the tree: rows about places (place, side, sign), where the heading is, and what is said of it."""

    rows: frozenset[tuple[int, int, int]]
    low: tuple[float, ...]
    high: tuple[float, ...]
    said: Mapping[str, Any]


def leaves(m: Assumed, proof: Mapping[str, Any]) -> int:
    """Number of leaves of a proof that holds.

    Parameters
    ----------
    m : Assumed
    proof : mapping
        As the file has it.

    Raises
    ------
    Wrong
        If it does not hold.
    KeyError, IndexError, TypeError, ValueError, AttributeError
        If it is no proof at all.
    """
    instants = [float(t) for t in proof["instants_s"]]
    if instants[0] != 0.0 or any(b <= a for a, b in pairwise(instants)):
        raise Wrong("its instants do not begin at the reaction and grow")
    if not (m.front > 0.0 and m.back > 0.0 and m.side > 0.0):
        raise Wrong("the body does not contain its reference point")
    places = [_place(m, one, len(instants)) for one in proof["places"]]
    seen = headings(m, instants)
    count = 0
    stack = [_Part(frozenset(), tuple(seen.low), tuple(seen.high), proof["tree"])]
    while stack:
        part = stack.pop()
        if "close" in part.said:
            rows = [_row(m, part, places, seen, one) for one in part.said["close"]]
            if not kept_by_none(m, instants, rows, part.low, part.high, seen):
                raise Wrong("a leaf does not follow from its multipliers")
            count += 1
        elif part.said.get("empty") is True:
            if not any(a > b for a, b in zip(part.low, part.high, strict=True)):
                raise Wrong("a leaf is said to have no heading, and has one")
            count += 1
        elif "cut" in part.said:
            stack += _beyond(part, places)
        else:
            stack += _halves(part, seen)
    return count


def _place(m: Assumed, one: Mapping[str, Any], count: int) -> _Place:
    shape, corners = ([(float(x), float(y)) for x, y in one[name]] for name in ("shape", "corners"))
    low, high = map(float, one["headings"])
    instant, pieces = index(one["instant"]), index(one["pieces"])
    if not 0 <= instant < count or not convex(shape) or not convex(corners) or not 1 <= pieces <= 1000:
        raise Wrong("forbidden places are no convex polygon at an instant")
    body = [(m.front, m.side), (-m.back, m.side), (-m.back, -m.side), (m.front, -m.side)]
    if not all(met_throughout(corner, shape, body, low, high, pieces) for corner in corners):
        raise Wrong(f"obstacle {one['obstacle']} is not met from a place that is said to be forbidden")
    return _Place(instant, low, high, corners)


def _beyond(part: _Part, places: Sequence[_Place]) -> list[_Part]:
    """The parts beyond each side of forbidden places: in the order given, and not beyond the sides before."""
    number, sides, children = index(part.said["cut"]), list(part.said["sides"]), part.said["children"]
    place = places[number]
    k = place.instant
    low, high = part.low[k], part.high[k]
    around = place.high - place.low >= 2.0 * math.pi
    if not around and not (place.low <= low - _SURE and high + _SURE <= place.high):
        raise Wrong("places are forbidden for fewer headings than there are")
    if sorted(sides) != list(range(len(place.corners))) or len(children) != len(sides):
        raise Wrong("a side of forbidden places is left out")
    made, rows = [], part.rows
    for side, said in zip(sides, children, strict=True):
        made.append(_Part(rows | {(number, side, 1)}, part.low, part.high, said))
        rows = rows | {(number, side, -1)}
    return made


def _halves(part: _Part, seen: Headings) -> list[_Part]:
    """The parts with the heading at an instant on either side of an angle; near it, it cannot be far off."""
    k, at, children = index(part.said["split"]), float(part.said["at"]), part.said["children"]
    if not 0 <= k < len(part.low) or len(children) != 2:
        raise Wrong("headings are not split in two")
    turned = [abs(t - seen.turned[k]) + _SURE for t in seen.turned]
    right = _Part(
        part.rows,
        part.low,
        tuple(min(h, at + t) for h, t in zip(part.high, turned, strict=True)),
        children[0],
    )
    left = _Part(
        part.rows,
        tuple(max(w, at - t) for w, t in zip(part.low, turned, strict=True)),
        part.high,
        children[1],
    )
    return [right, left]


def _row(m: Assumed, part: _Part, places: Sequence[_Place], seen: Headings, one: Sequence[Any]) -> Row:
    """A row of a leaf, which has to hold there."""
    if one[0] == "place":
        number, side, sign, weight = index(one[1]), index(one[2]), index(one[3]), float(one[4])
        if (number, side, sign) not in part.rows:
            raise Wrong("a leaf uses a side that is not on the way to it")
        place = places[number]
        (ax, ay), (bx, by) = place.corners[side], place.corners[(side + 1) % len(place.corners)]
        x, y = Fraction(by) - Fraction(ay), Fraction(ax) - Fraction(bx)
        level = x * Fraction(ax) + y * Fraction(ay)
        factor = Fraction(weight) / Fraction(math.hypot(float(x), float(y)))
        return Row(place.instant, False, sign * x, sign * y, sign * level, factor)
    if one[0] != "course":
        raise Wrong(f"a row about {one[0]!r}, of which nothing is known")
    k, side, angle, weight = index(one[1]), index(one[2]), float(one[3]), float(one[4])
    low, high = part.low[k] - seen.slip[k], part.high[k] + seen.slip[k]
    if high - low >= math.pi - _SURE:
        raise Wrong("a course is bounded that may be any")
    if side not in (0, 1) or (side == 0 and angle > low - _SURE) or (side == 1 and angle < high + _SURE):
        raise Wrong("a course is bounded by an angle that is not certain")
    if max(high, angle) - min(low, angle) >= math.pi - _SURE:
        raise Wrong("a course is bounded by the angle of another one")
    sign = 1 if side == 0 else -1
    x, y = Fraction(-sign * math.sin(angle)), Fraction(sign * math.cos(angle))
    return Row(k, True, x, y, Fraction(0), Fraction(weight))
