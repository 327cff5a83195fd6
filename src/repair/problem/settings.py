"""The repair problem, the same for every backend, and its limits."""

from __future__ import annotations

from dataclasses import dataclass

from repair.settings import setting

__all__ = ["LimitsConfig", "RepairConfig"]


@dataclass
class LimitsConfig:
    """What a repaired trajectory may do; null means the vehicle's own limit."""

    v_max: float | None = setting(None, "speed [m/s]; null: the vehicle's", low=0.1, high=200.0)
    v_lat: float = setting(8.0, "speed sideways, across the driven path [m/s]", low=1e-3, high=100.0)
    a_min: float | None = setting(None, "braking [m/s²]; null: minus a_total", low=-100.0, high=-1e-3)
    a_max: float | None = setting(
        None,
        "accelerating [m/s²]; null: what the engine gives at the initial speed",
        low=1e-3,
        high=100.0,
    )
    a_lat: float | None = setting(None, "lateral acceleration [m/s²]; null: a_total", low=1e-3, high=100.0)
    a_total: float | None = setting(
        None, "friction circle [m/s²]; null: 0.9 of the vehicle's", low=1e-3, high=100.0
    )
    j_lon: float = setting(
        60.0,
        "jerk along the path [m/s³], at most what the drivability checker can follow",
        low=1e-2,
        high=1e6,
    )
    j_lat: float = setting(60.0, "jerk sideways [m/s³]", low=1e-2, high=1e6)


@dataclass
class RepairConfig:
    """The repair problem, the same for every backend."""

    horizon: float | None = setting(
        None, "end of the repair [s]; null: TTC + after_conflict", low=1e-3, high=1e3
    )
    after_conflict: float = setting(
        3.0, "how long a repair goes on after the conflict [s]", low=0.1, high=1e3
    )
    clearance: float = setting(0.3, "the paper's s_f [m]", low=0.0, high=50.0)
    margin: float = setting(0.1, "distance hard backends keep from the inflated box [m]", low=0.0, high=50.0)
    reserve: float = setting(
        0.015,
        "share of the acceleration limits that backends leave unused: they look at samples, the check at all",
        low=0.0,
        high=0.5,
    )
    relax: list[float] = setting(
        factory=lambda: [-0.1, -0.3, -0.6, -1.3, -2.5],
        # Down to the vehicles' own extents, then into the boxes, which are wider than turning vehicles are.
        says="margins [m] that hard backends try next where none of the manoeuvres is feasible; not where a "
        "helper that needs no way to be shown has found nothing",
    )
    widen: list[float] = setting(
        factory=lambda: [0.3, 0.6],
        # A box in (s, l) is narrower than the vehicle in a bend or at an angle to the path.
        says="what is added to margin and clearance [m], one after the other, where a curve came too close",
        low=0.0,
        high=50.0,
    )
    narrow: list[float] = setting(
        factory=lambda: [0.1, 0.3, 0.6],
        # The corners of a vehicle at an angle to the road are nearer to its edge than half the width.
        says="by what the road is narrowed [m], one after the other, where a curve left it",
        low=0.0,
        high=50.0,
    )
    ease: list[float] = setting(
        factory=lambda: [0.05, 0.1, 0.2],
        # Soft limits are exceeded a little where they matter most.
        says="share of the acceleration limits left unused, one after the other, where a curve exceeded them",
        low=0.0,
        high=0.9,
    )
    lateral: str = setting(
        "road",
        "how far a repair may leave its path sideways",
        choices=("none", "lane", "same_direction", "road"),
    )
    road_ends: bool = setting(
        True,
        "where the path leaves the road, at its end above all, repairs stop or go around as for an obstacle",
        only_with=("checker.road", (True,)),
    )
    rejoin: bool = setting(False, "after the evasive part, drive back to the reference where there is room")
    goal: bool = setting(False, "go on until the planning problem's goal is reached")
    degree: int = setting(3, "of the B-spline", low=3, high=5)
    spacing: float = setting(0.2, "knot spacing [s]", low=0.02, high=5.0)
