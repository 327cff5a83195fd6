"""A certificate: the margins of a written result, recomputed from its files and the scenario alone.

Nothing that the solver or the search claimed is believed. The repaired curve is read from
``result.json`` by its control points, the scenario is loaded again (its checksum must agree), and
every margin is measured anew: *exact* rows bound the curve at every time through the convex hull of
its Bernstein points, *sampled* rows look every millisecond, *official* rows are the answers of the
CommonRoad drivability checker on the solution file.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repair.certify.certificate import Certificate, CertificateRow
from repair.certify.clearance import allowed_depth, clearance_rows
from repair.certify.hull import derivative_rows, seam_rows
from repair.certify.plane import official_rows, plane_rows
from repair.curves.codec import read_curve
from repair.errors import RepairError

if TYPE_CHECKING:
    from repair.situation import Prepared

__all__ = ["certify", "read_result"]


def certify(folder: Path) -> Certificate:
    """Recompute every margin of the result in ``folder``.

    Raises
    ------
    RepairError
        If there is no result, no trajectory in it, or the scenario is not the one it was made from.
    """
    folder = Path(folder)
    content = read_result(folder)
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


def read_result(folder: Path) -> dict[str, Any]:
    file = folder / "result.json"
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise RepairError(f"{folder} holds no result.json") from error
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise RepairError(f"{file} cannot be read: {error}") from error
    if not isinstance(content, dict) or "status" not in content or "config" not in content:
        raise RepairError(f"{file} is not the result of a repair")
    return content


def _prepare(folder: Path, content: Mapping[str, Any]) -> Prepared:
    """The scenario of the result, loaded and laid out again."""
    from repair.config import load_config
    from repair.prepare import prepare
    from repair.scene.commonroad import load_scene

    origin = content.get("provenance") or {}
    beside = content.get("scenario_file")
    path = folder / beside if beside else Path(str(origin.get("path") or ""))
    if not path.is_file():
        raise RepairError(f"the scenario {path} of the result is not there any more")
    wanted = origin.get("sha256")
    if wanted and hashlib.sha256(path.read_bytes()).hexdigest() != wanted:
        raise RepairError(f"the scenario {path} is not the one the result was made from (checksum)")
    settings = {key: value for key, value in content["config"].items() if key != "for_backend"}
    config = load_config(overrides=settings)
    scene = load_scene(
        path,
        planning_problem=origin.get("planning_problem_id"),
        vehicle=config.scene.vehicle,
        horizon=config.scene.horizon,
        after_prediction=config.scene.after_prediction,
    )
    return prepare(scene, config)
