"""What a sweep does with each file, and the row that comes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

__all__ = ["COLUMNS", "SweepSettings", "combinations", "failed_row", "one_line"]

COLUMNS = (
    "file", "backend", "reference", "status", "detail", "conflict", "margin_only", "obstacle_id",
    "from_behind", "ttc_s", "contact_ttc_s", "checked_until_s", "decided_by", "f_ttr_s", "ttb_s", "ttr_s",
    "maneuver", "repaired_by", "by_fallback",
    "peak_deceleration_mps2", "peak_acceleration_mps2", "peak_lateral_acceleration_mps2", "min_speed_mps",
    "ending", "ending_maneuver", "ending_detail", "onward", "onward_reached", "onward_detail",
    "largest_residual", "probes", "official_feasible", "official_collision_free", "official_on_road",
    "official_solved", "official_vehicle_model", "official_connected", "official_start", "official_goal",
    "official_egos_apart", "official_valid",
    "road_method", "certificate", "load_time_s", "prepare_time_s", "search_time_s", "solve_time_s",
    "check_time_s", "official_time_s",
)  # fmt: skip


@dataclass(frozen=True)
class SweepSettings:
    """What a sweep does with each file.

    Attributes
    ----------
    backends, references : sequence of str
    preset : str or None
    overrides : sequence of str
        ``key=value``, for all backends.
    official : bool
        Write each trajectory as a solution file and have CommonRoad's checker judge it.
    certify : bool
        Write each result and recompute its margins from the files (:func:`repair.certify.recompute.certify`).
    timeout : float
        Wall time for one file [s], all backends and references together.
    jobs : int
        Worker processes.
    """

    backends: Sequence[str] = ("ego",)
    references: Sequence[str] = ("planner",)
    preset: str | None = None
    overrides: Sequence[str] = ()
    official: bool = True
    certify: bool = False
    timeout: float = 300.0
    jobs: int = 1


def combinations(settings: SweepSettings) -> list[tuple[str, str]]:
    """Backend and reference of every row of a file."""
    return [(backend, reference) for reference in settings.references for backend in settings.backends]


def failed_row(file: str, backend: str, reference: str, status: str, detail: str) -> dict[str, Any]:
    """The row of what could not be run, with the reason."""
    row: dict[str, Any] = dict.fromkeys(COLUMNS)
    row.update(file=file, backend=backend, reference=reference, status=status, detail=detail)
    return row


def one_line(error: BaseException) -> str:
    """An error's own words, on one line and not too long."""
    return " ".join(str(error).split())[:300]
