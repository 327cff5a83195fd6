"""First contact in continuous time: advancement by a bound on the relative motion.

Between two samples everything moves and turns linearly in time. Over a piece of that interval two shapes
are free of contact where, in its middle, an axis separates them by more than anything can move along that
axis until the ends of the piece. Pieces of which that is not known are halved; what is left when they are
shorter than half a millisecond counts as contact (conservative advancement: Mirtich, *Impulse-based dynamic
simulation of rigid body systems*, 1996; Tang et al., *C2A*, ICRA 2009). So no contact is missed, and one is
reported at most that much too early; who comes closer than that and moves on is the only one who is reported
in vain.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from repair.arrays import Array, Points
from repair.world.touching import TOUCH

__all__ = ["FINEST", "Left", "Motion", "circle_left", "first_touch", "polygons_left", "rectangle_left"]

#: Pieces are halved until they are shorter than this [s].
FINEST = 5e-4

#: What is left of the largest gap [m] after the shape has moved, whatever the axis: of its centre, its way,
#: its direction and its size (half length + i half width), all as the ego sees them, and the ego's size.
Left = Callable[[complex, complex, complex, complex, complex], float]


class Motion(NamedTuple):
    """The ego and a shape from the start to the end of an interval.

    What is linear in time stands here at the start, and beside it by what it changes until the end.

    Attributes
    ----------
    start, span : float
        Start and duration of the interval [s].
    place, way : complex
        The shape's centre less the ego's [m].
    size, growth : complex
        The shape's half length + i half width; the radius, twice, of a circle [m].
    orientation, turn : float
        Of the ego [rad].
    heading, swing : float
        Of the shape [rad].
    reach : float
        How far the shape's farthest point is from its centre where it turns [m].
    spare : float
        By how much the ego may be off the straight way between its samples [m].
    """

    start: float
    span: float
    place: complex
    way: complex
    size: complex
    growth: complex
    orientation: float
    turn: float
    heading: float
    swing: float
    reach: float
    spare: float


def first_touch(pair: Motion, half: complex, left: Left, until: float = float("inf")) -> float | None:
    """Time [s] of the first contact before ``until``, None where there is none.

    Parameters
    ----------
    pair : Motion
    half : complex
        Half length + i half width of the ego [m].
    left : callable
        :func:`rectangle_left`, or what stands for another shape.
    until : float
        [s].
    """
    start, span, place, way, size, growth, orientation, turn, heading, swing, reach, spare = pair
    loose = abs(half) * abs(turn) + reach * abs(swing) + max(abs(growth.real), abs(growth.imag))
    pieces = [(0.0, 1.0)]
    while pieces:
        low, high = pieces.pop()
        begin = start + low * span
        if begin >= until:  # the others are later
            return None
        share, part = 0.5 * (low + high), 0.5 * (high - low)
        axis = cmath.rect(1.0, -(orientation + share * turn))
        own = cmath.rect(1.0, heading + share * swing) * axis
        seen, moved = (place + share * way) * axis, part * way * axis
        if left(seen, moved, own, size + share * growth, half) - part * loose - spare > TOUCH:
            continue
        if (high - low) * span <= FINEST:
            return begin
        pieces += ((share, high), (low, share))  # the earlier one is looked at first
    return None


def rectangle_left(seen: complex, moved: complex, own: complex, size: complex, half: complex) -> float:
    """:data:`Left` of a rectangle."""
    corner, other, back = own * size, own * size.conjugate(), own.conjugate()
    seen_back, moved_back = seen * back, moved * back
    mine, yours = half * back, half.conjugate() * back
    return max(
        abs(seen.real) - half.real - max(abs(corner.real), abs(other.real)) - abs(moved.real),
        abs(seen.imag) - half.imag - max(abs(corner.imag), abs(other.imag)) - abs(moved.imag),
        abs(seen_back.real) - size.real - max(abs(mine.real), abs(yours.real)) - abs(moved_back.real),
        abs(seen_back.imag) - size.imag - max(abs(mine.imag), abs(yours.imag)) - abs(moved_back.imag),
    )


def circle_left(seen: complex, moved: complex, own: complex, size: complex, half: complex) -> float:
    """:data:`Left` of a circle: along the direction from the ego's nearest point."""
    x, y = max(abs(seen.real) - half.real, 0.0), max(abs(seen.imag) - half.imag, 0.0)
    distance = abs(complex(x, y))
    if distance == 0.0:
        return -size.real
    outside = complex(x if seen.real > 0.0 else -x, y if seen.imag > 0.0 else -y)
    return distance - size.real - abs((moved * outside.conjugate()).real) / distance


def polygons_left(parts: tuple[Array, ...]) -> tuple[Left, float]:
    """What is left of the gap to the nearest of convex polygons, and how far they reach [m].

    The gap to each is taken along the axis that leaves most: one of the ego's two, or across an edge
    (separating axes). All polygons are looked at in one go, and how far each extends across its own edges is
    known beforehand.

    Parameters
    ----------
    parts : tuple of (V, 2) arrays
        Convex polygons, seen from the pose of the shape.
    """
    if not parts:
        return (lambda *_: float("inf")), 0.0
    outlines, normals = _laid_out([part[:, 0] + 1j * part[:, 1] for part in parts])
    across = (outlines[:, :, None] * normals.conj()[:, None, :]).real
    low, high = across.min(axis=1), across.max(axis=1)
    reach = float(np.abs(outlines).max())

    def left(seen: complex, moved: complex, own: complex, size: complex, half: complex) -> float:
        turned, placed = normals * own, outlines * own + seen
        shift = (seen * turned.conj()).real
        wide = np.abs(turned.real) * half.real + np.abs(turned.imag) * half.imag
        gaps = np.maximum(low + shift, -high - shift) - wide - np.abs((moved * turned.conj()).real)
        x = np.maximum(placed.real.min(axis=1), -placed.real.max(axis=1)) - half.real - abs(moved.real)
        y = np.maximum(placed.imag.min(axis=1), -placed.imag.max(axis=1)) - half.imag - abs(moved.imag)
        return float(np.maximum(gaps.max(axis=1), np.maximum(x, y)).min())

    return left, reach


def _laid_out(outlines: list[Points]) -> tuple[Points, Points]:
    """Corners (P, V) and normals of edges (P, V), as many for each polygon: some stand there twice."""
    most = max(map(len, outlines))
    corners = np.array([np.append(one, np.repeat(one[-1:], most - len(one))) for one in outlines])
    edges = np.roll(corners, -1, axis=1) - corners
    length = np.abs(edges)
    normals = -1j * edges / np.where(length > 0.0, length, 1.0)
    longest = np.take_along_axis(normals, length.argmax(axis=1)[:, None], axis=1)
    return corners, np.where(length > 0.0, normals, longest)
