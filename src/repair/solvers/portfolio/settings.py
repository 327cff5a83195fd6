"""Several backends as one."""

from __future__ import annotations

from dataclasses import dataclass

from repair.settings import setting

__all__ = ["PortfolioConfig"]


@dataclass
class PortfolioConfig:
    """Several backends as one."""

    members: list[str] = setting(
        # qptr is the cheapest, and of 99 conflicts it was in none later than both ego and shooting
        # (python -m benchmarks.portfolio)
        factory=lambda: ["ego", "shooting", "qptr", "casadi"],
        says="the backends that are asked, in this order: the cheap ones first",
        registry="backend",
    )
    bound: bool = setting(
        False, "once something is found, the bound (bound.*) is asked for what is proven too late"
    )
