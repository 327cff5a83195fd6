"""Direct shooting."""

from __future__ import annotations

from dataclasses import dataclass

from repair.settings import setting

__all__ = ["ShootingConfig"]


@dataclass
class ShootingConfig:
    """Direct shooting by the cross-entropy method."""

    population: int = setting(96, "trajectories around each mean and iteration", low=8, high=100_000)
    elite: int = setting(12, "of these the best, from which the next mean is made", low=2, high=10_000)
    means: int = setting(4, "manoeuvres that are followed side by side", low=1, high=100)
    iterations: int = setting(14, "at most", low=0, high=10_000)
    patience: int = setting(
        3,
        "iterations in a row without progress, after which no more are made; along the path one",
        low=1,
        high=10_000,
    )
    seed: int = setting(0, "of the random numbers; each solve begins with it again", low=0, high=2**31)
    slack: float = setting(
        0.5,
        "share of the drivability checker's tolerances by which the steering may be faster than the "
        "vehicle's",
        low=0.0,
        high=1.0,
    )
