"""The rows of a sweep or a study: which columns there are, and of which type each is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from repair.errors import RepairError, in_words

__all__ = [
    "COLUMNS", "STUDY", "STUDY_COLUMNS", "SweepSettings", "Table", "as_sweep_row", "combinations",
    "failed_row", "one_line", "strict", "type_of", "volatile",
]  # fmt: skip

COLUMNS = (
    "file", "backend", "reference", "status", "detail", "conflict", "margin_only", "obstacle_id",
    "from_behind", "ttc_s", "contact_ttc_s", "checked_until_s", "decided_by", "f_ttr_s", "ttb_s", "ttr_s",
    "maneuver", "repaired_by", "by_fallback",
    "peak_deceleration_mps2", "peak_acceleration_mps2", "peak_lateral_acceleration_mps2", "min_speed_mps",
    "t_bound_s", "gap_s", "impact_speed_mps", "braking_impact_speed_mps",
    "ending", "ending_maneuver", "ending_detail", "onward", "onward_reached", "onward_detail",
    "largest_residual", "probes", "official_feasible", "official_collision_free", "official_on_road",
    "official_solved", "official_vehicle_model", "official_connected", "official_start", "official_goal",
    "official_egos_apart", "official_valid",
    "road_method", "certificate", "load_time_s", "prepare_time_s", "search_time_s", "solve_time_s",
    "check_time_s", "official_time_s",
)  # fmt: skip

_ONLY_IN_STUDIES = (
    "variation", "ttb_status", "ttr_status", "contact_obstacle_id", "t_end_s", "build_time_s", "other_time_s",
    "evasive_time_s", "row_time_s", "worker_peak_memory_mb",
)  # fmt: skip
#: What is stored for each row of a study; the resolved settings that vary stand beside it.
STUDY_COLUMNS = (*COLUMNS, *_ONLY_IN_STUDIES)

_WHOLE = {"obstacle_id", "contact_obstacle_id"}
_TRUTH = {
    "margin_only", "from_behind", "by_fallback", "onward_reached",
    *(name for name in COLUMNS if name.startswith("official_") and not name.endswith("_s")),
}  # fmt: skip
_FIGURE = ("_s", "_mps", "_mps2", "_mb", "_residual")


def type_of(column: str) -> type:
    """``bool``, ``int``, ``float`` or ``str``: what a column holds where it holds anything."""
    if column in _TRUTH:
        return bool
    if column in _WHOLE:
        return int
    return float if column.endswith(_FIGURE) else str


@dataclass(frozen=True)
class Table:
    """What is stored of each row.

    Attributes
    ----------
    name : str
        Of what is run: the file is called after it.
    made_by : str
        The commands that write it, in words.
    columns : mapping
        Names to types; ``file``, ``backend``, ``reference``, ``variation``, ``status``, ``detail``,
        ``row_time_s`` and ``worker_peak_memory_mb`` are among them.
    """

    name: str
    made_by: str
    columns: Mapping[str, type]

    @property
    def stored_in(self) -> str:
        """The name of the file."""
        return f"{self.name}.sqlite"


STUDY = Table(
    "study", "`repair study` and `repair sweep`", {column: type_of(column) for column in STUDY_COLUMNS}
)


def volatile(column: str) -> bool:
    """Whether a column says how long something took, or how much memory: another one in each run."""
    return column.endswith(("_time_s", "_memory_mb"))


def strict(row: Mapping[str, Any], table: Table = STUDY) -> dict[str, Any]:
    """A row with every column of its table, each of its type or None; no infinity.

    Raises
    ------
    RepairError
        If a value is of another type: a defect of whoever made the row.
    """
    made: dict[str, Any] = {}
    for column, wanted in table.columns.items():
        value = row.get(column)
        if wanted is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if value is not None and (type(value) is not wanted or value in (float("inf"), -float("inf"))):
            raise RepairError(
                f"column {column} holds {in_words(value)}; it takes {wanted.__name__} or nothing"
            )
        made[column] = value
    return made


def as_sweep_row(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row of a study as ``sweep.csv`` has always had it: infinite times by CriMe's convention, in words."""
    made = {column: row[column] for column in COLUMNS}
    for name in ("ttb", "ttr"):
        status = row[f"{name}_status"]
        if status not in (None, "found"):
            made[f"{name}_s"] = "inf" if status == "no_conflict" else "-inf"
    return made


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
        Wall time for one row [s].
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


def failed_row(
    file: str, backend: str, reference: str, status: str, detail: str, table: Table = STUDY
) -> dict[str, Any]:
    """The row of what could not be run, with the reason."""
    row: dict[str, Any] = dict.fromkeys(table.columns)
    row.update(file=file, backend=backend, reference=reference, status=status, detail=detail)
    return row


def one_line(error: BaseException) -> str:
    """An error's own words, on one line and not too long."""
    return " ".join(str(error).split())[:300]
