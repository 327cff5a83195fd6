"""The paper's two-stage soft optimisation."""

from __future__ import annotations

from dataclasses import dataclass, field

from repair.settings import setting

__all__ = ["DeformWeights", "EgoConfig", "RefineWeights"]


@dataclass
class DeformWeights:
    """lambda_s, lambda_c, lambda_d."""

    smooth: float = setting(1.0, "lambda_s", low=0.0, high=1e6)
    collision: float = setting(1000.0, "lambda_c", low=0.0, high=1e6)
    feasible: float = setting(1000.0, "lambda_d", low=0.0, high=1e6)


@dataclass
class RefineWeights:
    """lambda_s, lambda_d, lambda_f."""

    smooth: float = setting(1.0, "lambda_s", low=0.0, high=1e6)
    feasible: float = setting(1000.0, "lambda_d", low=0.0, high=1e6)
    fit: float = setting(1.0, "lambda_f", low=0.0, high=1e6)


@dataclass
class EgoConfig:
    """The paper's two-stage soft optimisation."""

    deform: DeformWeights = field(default_factory=DeformWeights)
    refine: RefineWeights = field(default_factory=RefineWeights)
    w_v: float = setting(1.0, "the paper's weight of speeds beyond the limits", low=0.0, high=1e6)
    w_a: float = setting(1.0, "of accelerations", low=0.0, high=1e6)
    w_j: float = setting(1.0, "of jerks", low=0.0, high=1e6)
    elastic: float = setting(0.95, "the paper's lambda", low=0.1, high=0.9999)
    joint: float = setting(1.5, "c_j as a multiple of c_m", low=1.0, high=100.0)
    reverse: float = setting(
        200.0,
        "weight of speeds below zero, not scaled by lambda_d: no limit of the paper",
        low=0.0,
        high=1e6,
    )
    solver: str = setting("newton", "two ways to the same minimum", choices=("newton", "lbfgs"))
    max_iterations: int = setting(100, "in each stage (100 in the paper, of L-BFGS)", low=1, high=100_000)
    tolerance: float = setting(0.01, "on the gradient (0.01 in the paper)", low=1e-12, high=1e3)
    rebounds: int = setting(3, "doublings of lambda_c at most, while a collision remains", low=0, high=20)
    precondition: bool = setting(
        True,
        "L-BFGS with the quadratic part made round: same optimum, faster",
        only_with=("ego.solver", ("lbfgs",)),
    )
    guard: bool = setting(True, "keep the deformed curve where refining it would bring back a collision")
