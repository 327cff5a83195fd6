"""An obstacle that is touched, or whose margin is entered, as a violation."""

from __future__ import annotations

from typing import TYPE_CHECKING

from repair.check.verdict import Reason, Violation

if TYPE_CHECKING:
    from repair.world.collision import Contact

__all__ = ["met"]


def met(near: Contact | None, contact: Contact | None, margin: float) -> Violation | None:
    """The first of both.

    Parameters
    ----------
    near : Contact or None
        First contact of the ego enlarged by a margin.
    contact : Contact or None
        First contact of the ego itself.
    margin : float
        [m].
    """
    if contact is not None and (near is None or contact.time <= near.time):
        behind = " from behind" if contact.from_behind else ""
        detail = f"obstacle {contact.obstacle_id}{behind}"
        return Violation(Reason.COLLISION, contact.time, detail, contact.obstacle_id)
    if near is None:
        return None
    detail = f"obstacle {near.obstacle_id} within {margin:g} m"
    if contact is not None:
        detail += f", contact with obstacle {contact.obstacle_id} at {contact.time:.2f} s"
    return Violation(Reason.MARGIN, near.time, detail, near.obstacle_id)
