"""The Bernstein QP baseline."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class QptrConfig:
    """The Bernstein QP baseline."""

    solver: str = "daqp"  # any QP solver that qpsolvers finds: daqp | osqp | clarabel | ...
    degree: int = 5  # of the Bernstein polynomials
    spacing: float = 0.5  # duration of a piece [s]
    continuity: int = 2  # derivatives that are continuous at the joints
    w_jerk: float = 1.0  # cost of jerk squared
    w_deviation: float = 0.1  # cost of the distance to the reference squared
