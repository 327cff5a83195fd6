"""The paper's two-stage soft optimisation."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class DeformWeights:
    """lambda_s, lambda_c, lambda_d."""

    smooth: float = 1.0  # lambda_s
    collision: float = 1000.0  # lambda_c
    feasible: float = 1000.0  # lambda_d


@dataclass
class RefineWeights:
    """lambda_s, lambda_d, lambda_f."""

    smooth: float = 1.0  # lambda_s
    feasible: float = 1000.0  # lambda_d
    fit: float = 1.0  # lambda_f


@dataclass
class EgoConfig:
    """The paper's two-stage soft optimisation."""

    deform: DeformWeights = field(default_factory=DeformWeights)
    refine: RefineWeights = field(default_factory=RefineWeights)
    w_v: float = 1.0  # the paper's weight of speeds beyond the limits
    w_a: float = 1.0  # of accelerations
    w_j: float = 1.0  # of jerks
    elastic: float = 0.95  # the paper's lambda
    joint: float = 1.5  # c_j as a multiple of c_m
    reverse: float = 200.0  # weight of speeds below zero, not scaled by lambda_d: no limit of the paper
    solver: str = "newton"  # two ways to the same minimum
    max_iterations: int = 100  # in each stage (100 in the paper, of L-BFGS)
    tolerance: float = 0.01  # on the gradient (0.01 in the paper)
    rebounds: int = 3  # restarts with a doubled lambda_c while a collision remains
    precondition: bool = True  # L-BFGS with the quadratic part made round: same optimum, faster
    guard: bool = True  # keep the deformed curve where refining it would bring back a collision
