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
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.bspline import UniformBSpline
from repair.errors import RepairError
from repair.types import Array, Curve, Limits, Occupancy, frozen

if TYPE_CHECKING:
    from repair.api import Prepared
    from repair.baselines.bernstein import BernsteinCurve

__all__ = ["Certificate", "CertificateRow", "certify", "format_certificate"]

TOLERANCE = 1e-6  # result.json holds control points to 1e-12, a solver keeps its constraints to 1e-6
_SAMPLE = 1e-3  # [s]
_STATE = 1e-3  # [m], [rad] and [m/s] by which the solution file may differ from the curve


@dataclass(frozen=True)
class CertificateRow:
    """One margin.

    Attributes
    ----------
    name : str
    value, limit : float
        What was measured and what it is held against, in ``unit``.
    margin : float
        How far the value is on the good side of its limit; negative where it is violated.
    ok : bool
    how : str
        ``exact`` (at every time), ``sampled`` (every millisecond) or ``official``.
    unit : str
    """

    name: str
    value: float
    limit: float
    margin: float
    ok: bool
    how: str
    unit: str = ""


@dataclass(frozen=True)
class Certificate:
    """All margins of one result.

    Attributes
    ----------
    folder : Path
    scenario, backend, status : str
    f_ttr : float or None
        From where on the repaired curve is driven [s].
    rows : tuple of CertificateRow
    """

    folder: Path
    scenario: str
    backend: str
    status: str
    f_ttr: float | None
    rows: tuple[CertificateRow, ...]

    @property
    def ok(self) -> bool:
        """No margin is violated."""
        return all(row.ok for row in self.rows)


def certify(folder: Path) -> Certificate:
    """Recompute every margin of the result in ``folder``.

    Raises
    ------
    RepairError
        If there is no result, no trajectory in it, or the scenario is not the one it was made from.
    """
    folder = Path(folder)
    content = _read(folder)
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
        rows += _seam(content, curve, t_rep)
        rows += _derivatives(curve, prepared.limits)
        allowed = _allowed(content, prepared)
        rows += _clearance(curve, prepared.occupancy, prepared.scene.dt, t_end, allowed)
        rows += _plane(prepared, curve, t_rep, t_end)
    rows += _official(folder, content, prepared)
    return Certificate(
        folder,
        str(content.get("scenario")),
        str(content.get("backend")),
        status,
        content.get("f_ttr_s"),
        tuple(rows),
    )


def format_certificate(certificate: Certificate) -> str:
    """The certificate as a table for people."""
    lines = [
        f"{certificate.scenario}, backend {certificate.backend}, status {certificate.status}"
        + (f", F-TTR {certificate.f_ttr:g} s" if certificate.f_ttr is not None else "")
    ]
    width = max(len(row.name) for row in certificate.rows)
    lines.append(f"{'':{width}}  {'value':>10}  {'limit':>10}  {'margin':>10}  {'':8}  how")
    for row in certificate.rows:
        verdict = "ok" if row.ok else "VIOLATED"
        value, limit, margin = map(_figure, (row.value, row.limit, row.margin))
        how = f"{row.how}, {row.unit}" if row.unit else row.how
        lines.append(f"{row.name:{width}}  {value}  {limit}  {margin}  {verdict:8}  {how}")
    broken = [row.name for row in certificate.rows if not row.ok]
    lines.append("certified: every margin is kept" if not broken else f"NOT certified: {', '.join(broken)}")
    return "\n".join(lines)


def _figure(x: float) -> str:
    """Four decimals, unless these would show nothing of it."""
    return f"{x:10.1e}" if 0.0 < abs(x) < 5e-5 else f"{x + 0.0:10.4f}"


# -- reading -----------------------------------------------------------------------------------------


def _read(folder: Path) -> dict[str, Any]:
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


def read_curve(content: Mapping[str, Any] | None) -> UniformBSpline | BernsteinCurve | None:
    """The curve that :func:`repair.export.to_dict` wrote; None where it wrote none.

    Raises
    ------
    RepairError
        If it is given by samples only, or incomplete.
    """
    from repair.baselines.bernstein import BernsteinCurve

    if content is None:
        return None
    try:
        kind, start, spacing = content["type"], float(content["t_start_s"]), float(content["spacing_s"])
        points = frozen(content["control_points_m"])
        if kind == "uniform_bspline":
            return UniformBSpline(start, spacing, int(content["degree"]), points)
        if kind == "bernstein":
            return BernsteinCurve(start, spacing, points)
    except (KeyError, TypeError, ValueError) as error:
        raise RepairError(f"the curve in result.json is incomplete: {error!r}") from error
    raise RepairError(f"the curve in result.json is of type {kind!r}; only splines can be certified")


def _prepare(folder: Path, content: Mapping[str, Any]) -> Prepared:
    """The scenario of the result, loaded and laid out again."""
    from repair.api import prepare
    from repair.config import load_config
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


# -- rows --------------------------------------------------------------------------------------------


def _at_most(
    name: str, value: float, limit: float, how: str, unit: str, tolerance: float = TOLERANCE
) -> CertificateRow:
    return CertificateRow(name, value, limit, limit - value, value <= limit + tolerance, how, unit)


def _at_least(
    name: str, value: float, limit: float, how: str, unit: str, tolerance: float = TOLERANCE
) -> CertificateRow:
    return CertificateRow(name, value, limit, value - limit, value >= limit - tolerance, how, unit)


def _seam(content: Mapping[str, Any], curve: Curve, t_rep: float) -> list[CertificateRow]:
    """Jumps in position, velocity and acceleration where the repair leaves the reference."""
    reference = content.get("reference") or {}
    if reference.get("type") == "samples":
        return []
    before, after = read_curve(reference), curve.sample([t_rep])
    if before is None:
        return []
    here = before.sample([t_rep])
    rows = []
    for name, unit in (("position", "m"), ("velocity", "m/s"), ("acceleration", "m/s²")):
        jump = float(np.max(np.abs(getattr(here, name) - getattr(after, name))))
        rows.append(_at_most(f"jump in {name} at the seam", jump, 0.0, "exact", unit))
    return rows


def _pieces(curve: UniformBSpline | BernsteinCurve) -> tuple[Array, float]:
    """Bernstein points (M, p + 1, 2) of the curve's pieces, and their duration [s]."""
    if isinstance(curve, UniformBSpline):
        return curve.bernstein_segments(), curve.spacing
    return curve.points, curve.duration


def _cut(points: Array, start: Array, end: Array) -> Array:
    """Bernstein points of the parts [start, end] (M,) of pieces (M, p + 1, d), by de Casteljau twice."""
    right = points.copy()
    degree = points.shape[1] - 1
    u = start[:, None, None]
    for k in range(degree):  # the part from start on
        right[:, : degree - k] = (1.0 - u) * right[:, : degree - k] + u * right[:, 1 : degree - k + 1]
    left = right.copy()
    w = ((end - start) / np.maximum(1.0 - start, 1e-15))[:, None, None]
    for k in range(degree):  # of that, the part up to end
        left[:, k + 1 :] = (1.0 - w) * left[:, k:-1] + w * left[:, k + 1 :]
    return left


def _derivatives(curve: UniformBSpline | BernsteinCurve, limits: Limits) -> list[CertificateRow]:
    """Hulls of the first three derivatives, each piece cut into 16 so that the hull is tight."""
    points, duration = _pieces(curve)
    cuts = 16
    u = np.tile(np.arange(cuts) / cuts, len(points))
    fine = _cut(np.repeat(points, cuts, axis=0), u, u + 1.0 / cuts)
    step, degree = duration / cuts, points.shape[1] - 1
    hull = []
    for order in (1, 2, 3):
        fine = (degree - order + 1) / step * np.diff(fine, axis=1)
        hull.append((fine.min(axis=(0, 1)), fine.max(axis=(0, 1))))
    (v_low, v_high), (a_low, a_high), (j_low, j_high) = hull
    return [
        _at_least("speed s', least", float(v_low[0]), 0.0, "exact", "m/s"),
        _at_most("speed s', largest", float(v_high[0]), limits.v_max, "exact", "m/s"),
        _at_most("lateral speed |l'|", _abs(v_low[1], v_high[1]), limits.v_lat, "exact", "m/s"),
        _at_least("acceleration s'', least", float(a_low[0]), limits.a_min, "exact", "m/s²"),
        _at_most("acceleration s'', largest", float(a_high[0]), limits.a_max, "exact", "m/s²"),
        _at_most("lateral acceleration |l''|", _abs(a_low[1], a_high[1]), limits.a_lat, "exact", "m/s²"),
        _at_most("jerk |s'''|", _abs(j_low[0], j_high[0]), limits.j_lon, "exact", "m/s³", 1e-4),
        _at_most("jerk |l'''|", _abs(j_low[1], j_high[1]), limits.j_lat, "exact", "m/s³", 1e-4),
    ]


def _abs(low: float, high: float) -> float:
    return float(max(-low, high))


def _allowed(content: dict[str, Any], prepared: Prepared) -> float:
    """How far into the inflated boxes the repair may go [m, negative]: a hard backend says itself.

    Boxes in (s, l) are wider than the vehicles in them; a soft backend may enter them as far as the
    most that hard ones are allowed to (``repair.relax``), and the true rectangles have a row of their own.
    """
    best = [p for p in content["probes"] if p["feasible"] and p["t_rep_s"] == content["f_ttr_s"]]
    if best and "obstacles" in best[0]["residuals"] and best[0].get("margin_m") is not None:
        return min(0.0, float(best[0]["margin_m"]))
    return min([0.0, *prepared.config.repair.relax])


def _clearance(
    curve: UniformBSpline | BernsteinCurve, occupancy: Occupancy, dt: float, t_end: float, allowed: float
) -> list[CertificateRow]:
    """Distance to the nearest inflated box, by hull and by sampling; negative inside of it.

    ``allowed`` is how far into a box the repair may go at most.

    The distance to a box is the largest of the four signed distances to its sides. Pieces are cut at
    the scenario's steps: in between the sides move linearly, and the Bernstein points of curve minus
    side bound their distance.
    """
    if not len(occupancy):
        return []
    t_end = min(t_end, curve.t_end)
    points, duration = _pieces(curve)
    steps = np.arange(np.ceil(curve.t_start / dt), np.floor(t_end / dt + 1e-6) + 1) * dt
    grid = np.linspace(curve.t_start, t_end, max(2, round((t_end - curve.t_start) / (2 * _SAMPLE))) + 1)
    knots = curve.t_start + np.arange(len(points) + 1) * duration
    edges = np.unique(np.round(np.concatenate([steps, grid, knots[knots <= t_end]]), 10))
    edges = edges[(edges >= curve.t_start) & (edges <= t_end)]
    edges = edges[np.concatenate([[True], np.diff(edges) > 1e-8])]
    start, end = edges[:-1], edges[1:]
    piece = np.clip(np.floor(((start + end) / 2 - curve.t_start) / duration), 0, len(points) - 1).astype(
        np.intp
    )
    origin = curve.t_start + piece * duration
    u0, u1 = (np.clip((x - origin) / duration, 0.0, 1.0) for x in (start, end))
    fine = _cut(points[piece], u0, u1)
    sides_start, sides_end = _sides(occupancy, start), _sides(occupancy, end)
    share = np.linspace(0.0, 1.0, fine.shape[1])[None, :, None]
    least, sampled = np.inf, np.inf
    at = curve.sample(edges).position
    at_sides = _sides(occupancy, edges)
    for k in range(len(occupancy)):
        line = (1.0 - share) * sides_start[k][:, None] + share * sides_end[k][:, None]
        distance = np.max(np.min(_signed(fine) - line, axis=1), axis=1)
        least = min(least, float(np.nanmin(distance, initial=np.inf)))
        sampled = min(sampled, float(np.nanmin(np.max(_signed(at) - at_sides[k], axis=-1), initial=np.inf)))
    if not np.isfinite(sampled):
        return []
    return [
        _at_least("distance to the nearest inflated obstacle", least, allowed, "exact", "m"),
        _at_least("distance to the nearest inflated obstacle", sampled, allowed, "sampled", "m"),
    ]


def _sides(occupancy: Occupancy, times: Array) -> Array:
    """Signed sides (N, K, 4) of the boxes: behind, ahead, right, left."""
    lower, upper = occupancy.at(times)
    return np.stack([-lower[..., 0], upper[..., 0], -lower[..., 1], upper[..., 1]], axis=-1)


def _signed(position: Array) -> Array:
    """Positions (..., 2) in the signs of :func:`_sides`."""
    s, l = position[..., 0], position[..., 1]  # noqa: E741
    return np.stack([-s, s, -l, l], axis=-1)


def _plane(prepared: Prepared, curve: Curve, t_rep: float, t_end: float) -> list[CertificateRow]:
    """What happens in the plane, on the vehicle's true outline, every millisecond from ``t_rep`` on.

    The vehicle is driven from the start, because its slip angle has a history.
    """
    from repair.checker import SplicedCurve
    from repair.collision import CollisionWorld, official_shifts
    from repair.kinematics import drive
    from repair.metrics import peaks

    scene, limits = prepared.scene, prepared.limits
    substeps = max(1, round(scene.dt / _SAMPLE))
    times = np.arange(int(np.floor(t_end / scene.dt + 1e-6)) * substeps + 1) * (scene.dt / substeps)
    path = scene.frame.cartesian(SplicedCurve(prepared.reference, curve, t_rep).sample(times))
    since = int(times.searchsorted(t_rep - 1e-9))
    reached = peaks(path, slice(since, None))
    states = drive(path.t, path.xy, path.heading, path.speed, path.distance, scene.vehicle)
    world = CollisionWorld(
        scene.obstacles, scene.vehicle, scene.dt, scene.n_steps, substeps, official_shifts(scene.scenario)
    )
    poses = states.x[since:], states.y[since:], states.orientation[since:]
    contact = world.contact(*poses, start=since)
    rows = [
        _at_most("friction circle", reached.max_total_acceleration, limits.a_total, "sampled", "m/s²"),
        _at_most("lateral acceleration", reached.max_lateral_acceleration, limits.a_lat, "sampled", "m/s²"),
        _at_least(
            "first contact of the rectangles", contact.time if contact else t_end, t_end, "sampled", "s"
        ),
    ]
    if prepared.checker.road is not None:
        index = prepared.checker.road.first_off_road(*poses)
        left_at = t_end if index is None else float(states.t[since + index])
        rows.append(_at_least("leaves the road", left_at, t_end, "sampled", "s"))
    return rows


def _official(folder: Path, content: Mapping[str, Any], prepared: Prepared) -> list[CertificateRow]:
    """The solution file against the written trajectory, and before the drivability checker."""
    from commonroad.planning.planning_problem import PlanningProblemSet

    from repair.official import check_solution_file

    file = folder / str(content["solution_file"])
    if not file.is_file():
        raise RepairError(f"the solution file {file} is not there any more")
    scene = prepared.scene
    own = () if scene.recorded_ego is None else (scene.recorded_ego.id,)
    verdict = check_solution_file(
        file, scene.scenario, PlanningProblemSet([scene.planning_problem]), without=own
    )
    rows = [
        _at_most(
            "solution file against the curve", _difference(file, content, prepared), _STATE, "sampled", "m"
        )
    ]
    answers = (
        ("solution_feasible", verdict.feasible),
        ("obstacle_collision", verdict.collision_free),
        (f"boundary_collision ({verdict.road_method})", verdict.on_road),
    )
    rows += [
        CertificateRow(name, float(ok), 1.0, float(ok) - 1.0, ok, "official", "") for name, ok in answers
    ]
    return rows


def _difference(file: Path, content: Mapping[str, Any], prepared: Prepared) -> float:
    """Largest distance [m] between the positions in the solution file and those on the curves."""
    from repair.checker import SplicedCurve
    from repair.scene.reading import read_solution

    solution = read_solution(file)
    states = solution.planning_problem_solutions[0].trajectory.state_list
    written = np.array([s.position for s in states])
    first = prepared.scene.initial_time_step
    times = (np.array([s.time_step for s in states]) - first) * prepared.scene.dt
    repaired = read_curve(content.get("curve"))
    reference = content.get("reference") or {}
    before: Curve | None = prepared.reference if reference.get("type") == "samples" else read_curve(reference)
    assert before is not None
    driven = before if repaired is None else SplicedCurve(before, repaired, float(content["f_ttr_s"]))
    on_curve = prepared.scene.frame.cartesian(driven.sample(times)).xy
    return float(np.max(np.abs(on_curve - written)))
