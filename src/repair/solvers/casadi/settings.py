"""The hard-constraint NLP."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class CasadiConfig:
    """The hard-constraint NLP."""

    solver: str = "ipopt"  # ipopt | sqpmethod
    obstacles: str = "hull"  # hull | sampled
    w_acceleration: float = 1.0  # cost of acceleration squared
    w_jerk: float = 0.1  # cost of jerk squared
    w_reference: float = 0.05  # cost of the distance to the reference squared
    heading: float = 0.7  # largest angle between the driven path and the axis [rad]
    overhang: float = 2.15  # half length of the body whose ends must stay on the road [m]
    rounds: int = 8  # solves around the own solution until the exact constraints are kept
    max_iterations: int = 200  # of the solver, in each round
    tolerance: float = 1e-8  # of the solver
