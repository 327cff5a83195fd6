"""The hard-constraint NLP."""

from __future__ import annotations

from dataclasses import dataclass

from repair.settings import setting

__all__ = ["CasadiConfig"]


@dataclass
class CasadiConfig:
    """The hard-constraint NLP."""

    solver: str = setting("ipopt", "CasADi's solver of the NLP", choices=("ipopt", "sqpmethod"))
    helpers: list[str] | None = setting(
        None,
        "backends that are asked for a curve to start from where it finds nothing; null: ego and shooting, "
        "in the cycles of a Repairer nobody; [] is faster, and some F-TTR are earlier",
        registry="backend",
    )
    obstacles: str = setting(
        "hull",
        "obstacle rows at all times by the convex hull, or at samples only",
        choices=("hull", "sampled"),
    )
    w_acceleration: float = setting(1.0, "cost of acceleration squared", low=0.0, high=1e6)
    w_jerk: float = setting(0.1, "cost of jerk squared", low=1e-9, high=1e6)
    w_reference: float = setting(0.05, "cost of the distance to the reference squared", low=0.0, high=1e6)
    heading: float = setting(
        0.7, "largest angle between the driven path and the axis [rad]", low=0.01, high=1.4
    )
    overhang: float | None = setting(
        None,
        "half length of the body whose ends must stay on the road [m]; null: the vehicle's, to the next cm",
        low=0.0,
        high=20.0,
    )
    rounds: int = setting(
        8, "solves around the own solution until the exact constraints are kept", low=1, high=100
    )
    max_iterations: int | None = setting(
        None, "of the solver, in each round; null: 200 of IPOPT, 80 of the SQP", low=1, high=100_000
    )
    tolerance: float = setting(1e-8, "of the solver", low=1e-12, high=1.0)
