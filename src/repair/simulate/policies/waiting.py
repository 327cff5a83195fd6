"""Those that wait for as long as a repair is left."""

from __future__ import annotations

from dataclasses import dataclass

from repair.simulate.eyes import Sight
from repair.simulate.policies.base import KEEP, Action, Releasing, lasts, repair_by, without

__all__ = ["AtFttr", "Graded"]


@dataclass
class AtFttr(Releasing):
    """Keep the plan until the F-TTR is about to run out, then commit to the repair.

    What runs out before the next cycle is committed to now. Where nothing is found it brakes in the end.
    """

    def decide(self, sight: Sight) -> Action:
        """Wait while a repair is left for the next cycle."""
        found = sight.cycle
        if lasts(found, sight.period):
            return Action("keep", f_ttr=found.f_ttr)
        return without(sight) if found.curve is None else repair_by(found)


@dataclass
class Graded(AtFttr):
    """Wait on the F-TTR of a gentle repair, commit gently when that runs out, the hard one as a last resort.

    Gentle is a friction limit of ``simulate.gentle``, and to be clear of everybody being elsewhere by
    ``simulate.error``. Limits at which no repair is found are passed over, and not gone back to before the
    conflict is over; after the last of them the policy is that of :class:`AtFttr`. So it is while it is
    doubtful whether there will be a contact at all (:meth:`repair.simulate.eyes.Sight.sure`).

    Once off its plan it gains nothing by waiting: what it drives is repaired at once.

    Attributes
    ----------
    level : int
        The limit that is waited on.
    since : float
        When a conflict was last seen [s].
    """

    level: int = 0
    since: float = -1.0

    def decide(self, sight: Sight) -> Action:
        """Wait while a gentle repair is left for the next cycle."""
        if sight.mode != "plan":
            now = sight.first
            return super().decide(sight) if now.curve is None else repair_by(now)
        if sight.now > self.since + 1.5 * sight.period:
            self.level = 0
        self.since = sight.now
        while self.level < len(sight.eyes.gentle):
            found = sight.gently(self.level)
            if found is None:
                return KEEP
            if lasts(found, sight.period):
                return Action("keep", f_ttr=found.f_ttr)
            if found.curve is not None:
                if sight.sure():
                    return repair_by(found)
                break
            if not found.complete:  # the deadline came before anybody knew
                break
            self.level += 1
        return super().decide(sight)
