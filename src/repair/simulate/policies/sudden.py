"""Those that act on what they see, or do not act."""

from __future__ import annotations

from dataclasses import dataclass

from repair.simulate.eyes import Sight
from repair.simulate.policies.base import BRAKE, KEEP, Action, Releasing, repair_by, without

__all__ = ["AtOnce", "BelowTtc", "Brake", "Never"]


@dataclass
class AtOnce(Releasing):
    """Repair at first sight of a conflict, with t_rep = 0. Where nothing is found it brakes in the end."""

    def decide(self, sight: Sight) -> Action:
        """The repair that begins at once."""
        found = sight.first
        return without(sight) if found.curve is None else repair_by(found)


@dataclass
class BelowTtc(AtOnce):
    """As :class:`AtOnce`, where the time to collision is below a threshold.

    Attributes
    ----------
    threshold : float
        [s].
    """

    threshold: float = 2.0

    def decide(self, sight: Sight) -> Action:
        """Nothing above it."""
        return super().decide(sight) if sight.conflict.time <= self.threshold + 1e-9 else KEEP


@dataclass
class Brake:
    """Full braking along the path when the Time-To-Brake is about to run out."""

    def decide(self, sight: Sight) -> Action:
        """Wait while braking from the next cycle on helps."""
        if sight.brakes(sight.period):
            return KEEP
        return BRAKE if sight.brakes(0.0) else without(sight)

    def release(self, sight: Sight) -> Action:
        """It goes on until the plan is clear."""
        return BRAKE


@dataclass
class Never:
    """The plan, whatever happens."""

    def decide(self, sight: Sight) -> Action:
        """Nothing."""
        return KEEP

    def release(self, sight: Sight) -> Action:
        """It never brakes."""
        return KEEP
