"""What a policy decides, and by what."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from repair.curves.base import Curve
from repair.simulate.eyes import Sight
from repair.simulate.watch import Found

__all__ = ["BRAKE", "KEEP", "Action", "Policy", "Releasing", "lasts", "repair_by", "without"]


@dataclass(frozen=True)
class Action:
    """What is driven from now on.

    Attributes
    ----------
    kind : str
        ``keep``, ``repair`` or ``brake``.
    curve : Curve or None
        With ``repair``: its time 0 is now.
    f_ttr : float or None
        Until when the policy could have waited [s], where it knows.
    until : float
        How long the curve is verified among what is believed [s].
    """

    kind: str
    curve: Curve | None = None
    f_ttr: float | None = None
    until: float = 0.0


KEEP, BRAKE = Action("keep"), Action("brake")


class Policy(Protocol):
    """Says when to leave what is driven. It is asked once in a cycle, and made anew for each drive."""

    def decide(self, sight: Sight) -> Action:
        """What to do where a conflict is ahead of what is driven."""
        ...

    def release(self, sight: Sight) -> Action:
        """What to do while it brakes and the plan is not clear: ``brake`` goes on with that."""
        ...


def repair_by(found: Found) -> Action:
    """Drive what was found."""
    return Action("repair", found.curve, found.f_ttr, found.until)


def lasts(found: Found, period: float) -> bool:
    """Whether a repair is there that can be waited for until the next cycle."""
    return found.f_ttr is not None and found.f_ttr >= period - 1e-9


def without(sight: Sight) -> Action:
    """Where nothing is found: full braking along the path, so late that the ego is at rest at the conflict.

    It then stands before the place of the conflict by half of the way that this takes, and an earlier start
    would gain nothing against what is believed. Who is struck from behind is not helped by it.
    """
    conflict = sight.conflict
    if conflict.from_behind:
        return KEEP
    at = min(conflict.time, conflict.contact_time)
    slowing = sight.ego.velocity / sight.eyes.grounds.config.evasive.a_brake
    return KEEP if at - slowing >= sight.period - 1e-9 else BRAKE


class Releasing:
    """Who brakes repairs again as soon as a repair that begins at once is found."""

    def release(self, sight: Sight) -> Action:
        """That repair, or braking."""
        if sight.looked is None:
            return BRAKE
        found = sight.first
        return BRAKE if found.curve is None else repair_by(found)
