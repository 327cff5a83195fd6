"""The repair problem, the same for every backend, and its limits."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class LimitsConfig:
    """What a repaired trajectory may do; null means the vehicle's own limit."""

    v_max: float | None = None  # speed [m/s]; null: the vehicle's
    v_lat: float = 3.0  # speed sideways, across the driven path [m/s]
    a_min: float | None = None  # braking [m/s²]; null: minus a_total
    a_max: float | None = None  # accelerating [m/s²]; null: what the engine gives at the initial speed
    a_lat: float | None = None  # lateral acceleration [m/s²]; null: a_total
    a_total: float | None = None  # friction circle [m/s²]; null: 0.9 of the vehicle's
    j_lon: float = 60.0  # jerk along the path [m/s³], at most what the drivability checker can follow
    j_lat: float = 60.0  # jerk sideways [m/s³]


@dataclass
class RepairConfig:
    """The repair problem, the same for every backend."""

    horizon: float | None = None  # end of the repair [s]; null: TTC + after_conflict
    after_conflict: float = 3.0  # [s]
    clearance: float = 0.3  # the paper's s_f [m]
    margin: float = 0.1  # distance hard backends keep from the inflated box [m]
    # Margins [m] that hard backends try next where none of the manoeuvres is feasible: down to the
    # vehicles' own extents, then into the boxes, which are wider than turning vehicles are.
    relax: list[float] = field(default_factory=lambda: [-0.1, -0.5, -1.2, -2.5])
    lateral: str = "road"  # none | lane | same_direction | road
    degree: int = 3  # of the B-spline
    spacing: float = 0.2  # knot spacing [s]
