"""Published results of driver models beside those of the published reading here."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from repair.arrays import Array
from repair.errors import ScenarioError
from repair.r157.cases import CASES, Points, grid
from repair.r157.drive import drive
from repair.r157.models import MODELS
from repair.report.tables import Section, Table

__all__ = ["compare"]

_OURS = {"CC_human_driver": "CC", **{name: name for name in MODELS}}
_COUNTS = ("scenario", "ego_kmh", "other_kmh", "model", "n_points", "n_collisions")
_CASES = ("scenario", "model", "ego_speed_kmh", "other_speed_kmh", "dx0_m", "lat_vel_mps", "lead_decel_g",
          "front_distance_m", "collision", "impact_ego_speed_mps")  # fmt: skip


def compare(path: Path) -> Table:
    """How far the published reading reproduces results of others.

    Parameters
    ----------
    path : Path
        A CSV of one of two kinds, told apart by its columns: collisions of whole grids by speeds
        (``scenario, ego_kmh, other_kmh, model, n_points, n_collisions``), or single points
        (``scenario, model, ego_speed_kmh, other_speed_kmh, dx0_m, lat_vel_mps, lead_decel_g,
        front_distance_m, collision, impact_ego_speed_mps``).

    Raises
    ------
    ScenarioError
        If the file is neither.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ScenarioError(f"{path} cannot be read: {error}") from error
    columns = set(rows[0]) if rows else set()
    try:
        if columns.issuperset(_COUNTS):
            return _counts(path, rows)
        if columns.issuperset(_CASES):
            return _single(path, rows)
    except (KeyError, ValueError, TypeError) as error:
        raise ScenarioError(f"{path} has a row that cannot be read: {error}") from error
    raise ScenarioError(
        f"{path} holds neither counts of collisions (columns {', '.join(_COUNTS)}) nor single points "
        f"(columns {', '.join(_CASES)})"
    )


def _counts(path: Path, rows: Sequence[Mapping[str, str]]) -> Table:
    """By grid and model: collisions here and there, and the sum of the differences by pair of speeds."""
    said = []
    for case in CASES:
        points = grid(case)
        for name, model in MODELS.items():
            asked = [row for row in rows if row["scenario"] == case and _OURS[row["model"]] == name]
            if not asked:
                continue
            made = drive(points, model(stated=False))
            theirs, ours, apart = 0, 0, 0
            for row in asked:
                pair = (points.ego == float(row["ego_kmh"])) & (points.other == float(row["other_kmh"]))
                if pair.sum() != int(row["n_points"]):
                    raise ValueError(f"{case} at {row['ego_kmh']} km/h has other points than the grid here")
                here, there = int(made.contact[pair].sum()), int(row["n_collisions"])
                theirs, ours, apart = theirs + there, ours + here, apart + abs(here - there)
            share = f"{100.0 * (ours - theirs) / theirs:+.2f} %" if theirs else "–"
            numbers = (f"{one:,}" for one in (len(points), theirs, ours))
            said.append((CASES[case], name, *numbers, share, str(apart)))
    columns = ("case", "model", "points", "collisions there", "here", "difference", "by pair of speeds")
    return Table(f"Collisions beside {path.name}", (Section("Counts", columns, tuple(said)),), (_TIES,))


def _single(path: Path, rows: Sequence[Mapping[str, str]]) -> Table:
    """By case and model: flags, and impact speeds where both collide."""
    said, agree, total = [], 0, 0
    for case in ("cut_in", "cut_out", "deceleration"):
        for name, model in MODELS.items():
            asked = [row for row in rows if row["scenario"] == case and _OURS[row["model"]] == name]
            if not asked:
                continue
            made = drive(_points(case, asked), model(stated=False))
            there = np.array([row["collision"] == "yes" for row in asked])
            both = there & made.contact
            near = np.abs(_column(asked, "impact_ego_speed_mps") - made.speed)[both] < 2e-3
            same = int((there == made.contact).sum())
            agree, total = agree + same, total + len(asked)
            speeds = f"{int(near.sum())} of {int(both.sum())}"
            share = f"{100.0 * same / len(asked):.1f} %"
            said.append((case.replace("_", "-"), name, str(len(asked)), str(same), share, speeds))
    share = f"{100.0 * agree / max(total, 1):.2f} %"
    said.append(("all", "", str(total), str(agree), share, ""))
    columns = ("case", "model", "points", "same flag", "share", "same own speed at impact")
    return Table(f"Single points beside {path.name}", (Section("Flags", columns, tuple(said)),), (_TIES,))


_TIES = (
    "where a cut-in reaches the ego's side exactly at a step (0.5 and 1.6 m/s on these grids), rounding "
    "decides, and not everywhere as it does there"
)


def _points(case: str, rows: Sequence[Mapping[str, str]]) -> Points:
    def column(name: str) -> Array:
        return np.nan_to_num(_column(rows, name))

    distance = column("dx0_m" if case == "cut_in" else "front_distance_m")
    # back onto the grid, whose values are multiples of 0.1: how many steps a ramp has hangs on their last bit
    lateral = np.round(column("lat_vel_mps") * 10.0) * 0.1
    name = "cut_in_low" if case == "cut_in" else case
    speeds = column("ego_speed_kmh"), column("other_speed_kmh")
    return Points(name, *speeds, distance, lateral, column("lead_decel_g"))


def _column(rows: Sequence[Mapping[str, str]], name: str) -> Array:
    return np.array([float(row[name] or "nan") for row in rows])
