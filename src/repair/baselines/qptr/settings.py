"""The Bernstein QP baseline."""

from __future__ import annotations

from dataclasses import dataclass

from repair.settings import setting

__all__ = ["QptrConfig"]


@dataclass
class QptrConfig:
    """The Bernstein QP baseline."""

    solver: str = setting("daqp", "any QP solver that qpsolvers finds: daqp, osqp, clarabel, ...")
    degree: int = setting(5, "of the Bernstein polynomials", low=3, high=9)
    spacing: float = setting(0.5, "duration of a piece [s]", low=0.05, high=5.0)
    continuity: int = setting(2, "derivatives that are continuous at the joints", low=2, high=3)
    w_jerk: float = setting(1.0, "cost of jerk squared", low=1e-6, high=1e6)
    w_deviation: float = setting(0.1, "cost of the distance to the reference squared", low=0.0, high=1e6)
