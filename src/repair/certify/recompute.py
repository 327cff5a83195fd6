"""A certificate: the margins of a written result, recomputed from its files and the scenario alone.

Nothing that the solver or the search claimed is believed. The repaired curve is read from
``result.json`` by its control points, the scenario is loaded again (its checksum must agree), and
every margin is measured anew: *exact* rows bound the curve at every time through the convex hull of
its Bernstein points, *sampled* rows look every millisecond, *official* rows are the answers of the
CommonRoad drivability checker on the solution file.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repair.certify.certificate import Certificate, CertificateRow
from repair.certify.clearance import allowed_depth, clearance_rows
from repair.certify.hull import derivative_rows, seam_rows
from repair.certify.plane import official_rows, plane_rows
from repair.curves.codec import read_curve
from repair.errors import RepairError
from repair.io.result_json import read_record

if TYPE_CHECKING:
    from repair.preparation import Prepared

__all__ = ["certify"]


def certify(folder: Path) -> Certificate:
    """Recompute every margin of the result in ``folder``.

    Raises
    ------
    RepairError
        If there is no result, no trajectory in it, or the scenario is not the one it was made from.
    """
    folder = Path(folder)
    content = read_record(folder)
    status = str(content.get("status"))
    if content.get("solution_file") is None:
        raise RepairError(
            f"{folder} holds no trajectory to certify: {content.get('status_sentence', status)}"
        )
    prepared = _prepare(folder, content)
    rows: list[CertificateRow] = []
    curve = read_curve(content.get("curve"))
    if curve is not None:
        t_rep, t_end = float(content["f_ttr_s"]), float(content["t_end_s"])
        rows += seam_rows(content, curve, t_rep)
        rows += derivative_rows(curve, prepared.limits)
        allowed = allowed_depth(content, prepared)
        rows += clearance_rows(curve, prepared.occupancy, prepared.scene.dt, t_end, allowed)
        rows += plane_rows(prepared, curve, t_rep, t_end)
    rows += official_rows(folder, content, prepared)
    return Certificate(
        folder,
        str(content.get("scenario")),
        str(content.get("backend")),
        status,
        content.get("f_ttr_s"),
        tuple(rows),
    )


# -- reading -----------------------------------------------------------------------------------------


def _prepare(folder: Path, content: Mapping[str, Any]) -> Prepared:
    """The scenario of the result, loaded and laid out again."""
    from repair.config.load import recorded_config
    from repair.preparation import prepare
    from repair.scene.commonroad import load_scene

    origin = content.get("provenance") or {}
    beside = content.get("scenario_file")
    path = folder / beside if beside else Path(str(origin.get("path") or ""))
    if not path.is_file():
        raise RepairError(f"the scenario {path} of the result is not there any more")
    wanted = origin.get("sha256")
    if wanted and hashlib.sha256(path.read_bytes()).hexdigest() != wanted:
        raise RepairError(f"the scenario {path} is not the one the result was made from (checksum)")
    settings = dict(content["config"])
    # The planning problem that was taken, whatever was asked for.
    settings["scene"] = {**settings.get("scene", {}), "planning_problem": origin.get("planning_problem_id")}
    config = recorded_config(settings)
    return prepare(load_scene(path, config), config)
