"""Whether the ego's rectangle meets other shapes: separating axes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from repair.arrays import Points

__all__ = ["CLOCKWISE", "TOUCH", "rectangles_touch"]

# Shapes closer than this [m] count as touching: rounding must not make us laxer than pycrcc.
TOUCH = 1e-6
# As arrays, because NumPy takes long to convert a plain number.
CLOCKWISE, _TOUCHING = np.array(-1j), np.array(complex(TOUCH, TOUCH))


def rectangles_touch(
    shapes: Points, turn: Points, ego: Points, size: Points, slack: Points | complex = 0.0
) -> npt.NDArray[np.bool_]:
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
    slack : (n,) complex array, optional
        How far apart along both axes counts as a meeting still [m].
    """
    hit = _reached(shapes, ego + slack)
    if np.count_nonzero(hit):  # mostly one of the ego's own axes tells the two apart
        shapes[1], shapes[2] = ego, ego.conj()
        shapes *= turn.conj()
        hit &= _reached(shapes, size + slack)
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
