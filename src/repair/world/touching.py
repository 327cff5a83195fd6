"""Whether the ego's rectangle meets other shapes: separating axes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, Points

__all__ = ["CLOCKWISE", "TOUCH", "polygon_touches", "rectangles_touch"]

# Shapes closer than this [m] count as touching: rounding must not make us laxer than pycrcc.
TOUCH = 1e-6
# As arrays, because NumPy takes long to convert a plain number.
CLOCKWISE, _TOUCHING = np.array(-1j), np.array(complex(TOUCH, TOUCH))


def rectangles_touch(shapes: Points, turn: Points, ego: Points, size: Points) -> npt.NDArray[np.bool_]:
    """Whether the ego and rectangles meet: separating axes.

    Parameters
    ----------
    shapes : (3, n) complex array
        Centres of the rectangles, and half diagonals of either direction, seen from the ego; overwritten.
    turn : (n,) complex array
        Their directions, seen from the ego.
    ego : () complex array
        Half length and, as imaginary part, half width of the ego.
    size : (n,) complex array
        The same of the rectangles.
    """
    hit = _reached(shapes, ego)
    if np.count_nonzero(hit):  # mostly one of the ego's own axes tells the two apart
        shapes[1], shapes[2] = ego, ego.conj()
        shapes *= turn.conj()
        hit &= _reached(shapes, size)
    return hit


def _reached(shapes: Points, half: Points) -> npt.NDArray[np.bool_]:
    """Whether rectangles (3, n), as in :func:`rectangles_touch`, meet one that lies along the axes.

    Asked are these axes only; ``half`` (n,) or () holds that one's half length and half width.
    """
    offset, one, other = np.abs(shapes.view(np.float64))  # the real and the imaginary parts in turn
    reach = np.maximum(one, other)
    both = reach.view(np.complex128)
    both += half + _TOUCHING
    meets = offset <= reach
    reached: npt.NDArray[np.bool_] = meets[::2] & meets[1::2]
    return reached


def polygon_touches(polygon: Array, pose: tuple[float, float, float, float], half: Array) -> bool:
    """Whether the ego meets a convex polygon: separating axes.

    Parameters
    ----------
    polygon : (V, 2) array
        Its corners, in either direction, closed or not [m].
    pose : tuple
        Of the ego: ``x, y`` [m] and ``cos, sin`` of its orientation.
    half : (2,) array
        Half length and half width of the ego [m].
    """
    x, y, cos, sin = pose
    points = (polygon - (x, y)) @ np.array([[cos, -sin], [sin, cos]])  # seen from the ego
    if (points.min(axis=0) > np.add(half, TOUCH)).any() or (points.max(axis=0) < -np.add(half, TOUCH)).any():
        return False
    edges = np.roll(points, -1, axis=0) - points
    size = np.hypot(edges[:, 0], edges[:, 1])
    normals = np.column_stack((-edges[:, 1], edges[:, 0]))[size > 0] / size[size > 0, None]
    projected = points @ normals.T
    reach = np.abs(normals) @ np.asarray(half) + TOUCH
    return bool(((projected.min(axis=0) <= reach) & (projected.max(axis=0) >= -reach)).all())
