"""Farkas' lemma for a leaf: a weighted sum of rows that no motion can keep, in exact arithmetic.

A row says that g . P(t) - h >= 0 of the reference point, or n . V(t) >= 0 of its velocity. With P and V of a
double integrator from the start, the sum is what it is without acceleration, plus the integral of
w(s) . a(s); w(s) is the sum of m g (t - s) over the rows with t > s, to which velocities contribute m n. Over
each piece between two instants w is linear in s and the accelerations are the same set, so that the largest
w . a is a convex function of s, and the trapezoidal rule no less than its integral. Linear parts are
fractions; the largest w . a is rounded up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

from repair.certify.late.assumed import OFF, Assumed, Headings, pushes

__all__ = ["Row", "kept_by_none"]

_UP = 1.0 + 1e-11  # upwards, far more than rounding
_HALVES = 2  # nodes of the trapezoidal rule in a piece, less one


class Row(NamedTuple):
    """One row with its multiplier.

    Attributes
    ----------
    instant : int
    moving : bool
        Of the velocity.
    x, y, level : Fraction
        g, or n; h.
    weight : Fraction
    """

    instant: int
    moving: bool
    x: Fraction
    y: Fraction
    level: Fraction
    weight: Fraction


def kept_by_none(
    m: Assumed, instants: Sequence[float], rows: Sequence[Row], low: Sequence[float], high: Sequence[float],
    seen: Headings,
) -> bool:  # fmt: skip
    """Whether no motion keeps all rows, by their weighted sum.

    Parameters
    ----------
    m : Assumed
    instants : sequence of float
    rows : sequence of Row
        With weights above 0.
    low, high : sequences of float
        Where the heading is at the instants.
    seen : Headings
        What holds of all motions.
    """
    if not rows or any(row.weight <= 0 for row in rows):
        return False
    times = [Fraction(t) for t in instants]
    vx, vy = Fraction(m.vx), Fraction(m.vy)
    held = Fraction(0)
    slope = [[Fraction(0), Fraction(0)] for _ in times]
    value = [[Fraction(0), Fraction(0)] for _ in times]
    for row in rows:
        x, y, t = row.weight * row.x, row.weight * row.y, times[row.instant]
        size = Fraction(math.hypot(float(x), float(y)) * _UP)
        if row.moving:
            held += x * vx + y * vy + size * Fraction(OFF["speed"])
            _add(value[row.instant], x, y)
        else:
            held += (x * vx + y * vy) * t - row.weight * row.level
            held += size * (Fraction(OFF["place"]) + Fraction(OFF["speed"]) * t)
            _add(slope[row.instant], x, y)
            _add(value[row.instant], x * t, y * t)
    s, v = [Fraction(0), Fraction(0)], [Fraction(0), Fraction(0)]
    for k in range(len(times) - 1, 0, -1):  # the piece that ends at this instant
        _add(s, *slope[k])
        _add(v, *value[k])
        if not any((*s, *v)):
            continue
        begin, end = times[k - 1], times[k]
        middle, half = _course(k, low, high, seen)
        bounds = [_cap(bound, m.disc, half) for bound in pushes(m, instants[k])]
        most = [
            _largest(float(v[0] - s[0] * t), float(v[1] - s[1] * t), m.disc, middle, bounds)
            for t in (begin + (end - begin) * Fraction(i, _HALVES) for i in range(_HALVES + 1))
        ]
        area = 0.5 * (most[0] + most[-1]) + sum(most[1:-1])
        held += (end - begin) / _HALVES * Fraction(area * _UP)
    return held < 0


def _add(to: list[Fraction], x: Fraction, y: Fraction) -> None:
    to[0] += x
    to[1] += y


def _course(k: int, low: Sequence[float], high: Sequence[float], seen: Headings) -> tuple[float, float]:
    """Middle and half width of the courses in the piece that ends at an instant.

    In a piece in which the body turns by b at most, a heading that is at least l0 at its start and l1 at its
    end is at least (l0 + l1 - b) / 2 throughout.
    """
    turned = seen.turned[k] - seen.turned[k - 1]
    left = 0.5 * (low[k - 1] + low[k] - turned) - seen.slip[k]
    right = 0.5 * (high[k - 1] + high[k] + turned) + seen.slip[k]
    left, right = max(left, seen.course - seen.spread[k]), min(right, seen.course + seen.spread[k])
    return 0.5 * (left + right), max(0.5 * (right - left), 0.0) + 1e-9


def _cap(bound: float, disc: float, half: float) -> float:
    """Largest e . a of |a| <= disc, where it is at most ``bound`` along a direction within ``half`` of e."""
    return disc * math.sin(min(math.asin(min(bound / disc, 1.0)) + half, 0.5 * math.pi)) * _UP


def _largest(x: float, y: float, disc: float, course: float, bounds: Sequence[float]) -> float:
    """The largest of w . a: at the rim of the disc, or at the end of the chord that a bound cuts off."""
    size = math.hypot(x, y)
    c, s = math.cos(course), math.sin(course)
    along, across = c * x + s * y, abs(c * y - s * x)
    bound = min(bounds[0] if along > 0.0 else bounds[1], disc)
    if disc * abs(along) <= bound * size:
        return disc * size * _UP + 1e-15
    rest = math.sqrt(max(disc * disc - bound * bound, 0.0))
    return (bound * abs(along) + rest * across) * _UP + 1e-15
