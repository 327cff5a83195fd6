"""The rows of a certificate about the bound on the time to react."""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.certify.certificate import CertificateRow, said
from repair.certify.contact import outlines
from repair.certify.late.assumed import OFF, Assumed, assumed
from repair.certify.late.tree import Wrong, leaves
from repair.certify.motion import Motion, wrapped
from repair.certify.plane import road_of
from repair.certify.traffic import Body, Traffic
from repair.errors import RepairError
from repair.vehicle.model import KinematicSingleTrack

if TYPE_CHECKING:
    from repair.preparation import Prepared

__all__ = ["late_rows", "read_proofs"]

_ROUNDING = 1e-6  # [m] by which a shape may be outside of what it stands for: files hold micrometres
_STEP = 0.025  # over which the reference's acceleration is looked at [s]
_NO_ROAD = -1  # stands in the file for what is none
_NO_PROOF = (
    KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError, ZeroDivisionError,
)  # fmt: skip
_LARGEST = 50_000_000  # bytes of a proof: more is none


def late_rows(
    folder: Path,
    content: Mapping[str, Any],
    prepared: Prepared,
    scenario: Any,
    traffic: Traffic,
    reference: Motion,
) -> list[CertificateRow]:
    """Whether it is too late from the times on that the record says, by the proofs in the folder.

    Parameters
    ----------
    folder : Path
    content : mapping
        What ``result.json`` holds.
    prepared : Prepared
        For vehicle, limits and reference.
    scenario : commonroad.scenario.scenario.Scenario
        Read anew, for the road.
    traffic : Traffic
        Likewise.
    reference : Motion
        The reference, driven anew.
    """
    told = content.get("bound")
    if not told:
        return []
    claims = {k: float(one["t_bound_s"]) for k, one in told["kinds"].items() if one["t_bound_s"] is not None}
    proofs, written = read_proofs(folder / str(told["proof_file"])) if claims else ({}, None)
    taken = _Taken(prepared, scenario, traffic)
    rows = []
    for kind, time in claims.items():
        name = f"too late from {time:g} s on ({kind})"
        try:
            count = _holds(kind, time, proofs["kinds"][kind], prepared, taken, reference)
        except Wrong as wrong:
            rows.append(said(name, False, "exact", str(wrong)))
        except _NO_PROOF as error:
            rows.append(said(name, False, "exact", f"this is no proof: {type(error).__name__} {error}"))
        else:
            rows.append(said(name, True, "exact", f"{count} leaves"))
    rows.append(said("record: bound and gap", _consistent(content, claims, prepared), "files"))
    if told.get("proof_sha256") is not None:  # results of before have none
        rows.append(said("record: the proof's checksum", told["proof_sha256"] == written, "files"))
    return rows


def _consistent(content: Mapping[str, Any], claims: Mapping[str, float], prepared: Prepared) -> bool:
    """Whether what is said of bound and gap follows from the times that are claimed."""
    told, f_ttr = content["bound"], content.get("f_ttr_s")
    earliest = min(claims.values(), default=None)
    kept = told["t_bound_s"] == earliest and (f_ttr is None or earliest is None or f_ttr < earliest)
    kept &= told["proven_too_late_at_start"] == (earliest is not None and earliest <= 0.0)
    kept &= all((one["status"] == "proven") == (kind in claims) for kind, one in told["kinds"].items())
    upper = min(v for v in (earliest, content["ttc_s"], math.inf) if v is not None)
    if f_ttr is None or not math.isfinite(upper):
        return bool(kept) and told["gap_s"] is None and not told["proven_optimal"]
    gap, grid = told["gap_s"], float(prepared.config.search.delta_t)
    kept &= gap is not None and abs(gap - (upper - f_ttr)) < 1e-6
    return bool(kept) and told["proven_optimal"] == (upper - f_ttr <= grid + 1e-9)


def read_proofs(file: Path) -> tuple[Any, str]:
    """What a file of proofs holds, and its checksum."""
    try:
        written = file.read_bytes()
        with gzip.open(io.BytesIO(written)) as stream:
            text = stream.read(_LARGEST)
        return json.loads(text), hashlib.sha256(written).hexdigest()
    except (OSError, EOFError, ValueError, RecursionError) as error:
        raise RepairError(f"the proof {file} cannot be read: {error}") from error


def _holds(kind: str, time: float, proof: Any, prepared: Prepared, taken: _Taken, reference: Motion) -> int:
    """Number of leaves of a proof that holds.

    Raises
    ------
    Wrong
        Otherwise.
    """
    if abs(float(proof["t_bound_s"]) - time) > 1e-6:
        raise Wrong(f"the proof is of {float(proof['t_bound_s']):g} s")
    if kind == "search" and not prepared.config.checker.limits:
        raise Wrong("the limits are off, so nothing bounds what the checker accepts")
    if not isinstance(prepared.scene.model, KinematicSingleTrack):
        raise Wrong("the vehicle is no kinematic single-track model")
    m = assumed(kind, prepared, proof["start"])
    place = _start(kind, m, time, proof["start"], prepared, reference)
    _followed(kind, m, time, prepared, reference)
    if time + float(proof["instants_s"][-1]) > prepared.t_end + 1e-9:
        raise Wrong("it looks at what is later than the repairs")
    for one in proof["places"]:
        taken.require(kind, one, time + float(proof["instants_s"][one["instant"]]), place)
    return leaves(m, proof)


def _start(
    kind: str, m: Assumed, time: float, told: Mapping[str, Any], prepared: Prepared, reference: Motion
) -> tuple[float, float]:
    """Where the proof starts, which has to be where the reference is."""
    if not 0.0 <= time <= float(reference.t[-1]):
        raise Wrong("it starts when the reference is over")
    rear = prepared.scene.vehicle.rear
    columns = (*reference.poses.T, reference.heading, reference.speed)
    x, y, psi, theta, v = (float(np.interp(time, reference.t, column)) for column in columns)
    slip = float(wrapped(theta - psi))
    rate = v * math.sin(slip) / rear
    velocity = v * math.cos(theta), v * math.sin(theta)
    if kind == "vehicle":
        x, y = x - rear * math.cos(psi), y - rear * math.sin(psi)
        velocity = v * math.cos(slip) * math.cos(psi), v * math.cos(slip) * math.sin(psi)
    px, py = map(float, told["position_m"])
    off = (
        ("place", math.hypot(px - x, py - y)),
        ("speed", math.hypot(m.vx - velocity[0], m.vy - velocity[1])),
        ("heading", abs(float(wrapped(m.heading - psi)))),
        ("rate", abs(m.rate - rate)),
    )
    for name, value in off:
        if not value <= OFF[name]:
            raise Wrong(f"it starts where the reference is not: {name} off by {value:.2g}")
    return px, py


def _followed(kind: str, m: Assumed, time: float, prepared: Prepared, reference: Motion) -> None:
    """The reference has to be such a motion until the conflict: then later reactions are too late too."""
    step = float(reference.t[1] - reference.t[0])
    every = max(1, round(_STEP / step))
    until = prepared.conflict.time
    part = np.flatnonzero((reference.t >= time - 1e-9) & (reference.t <= until + 1e-9))[::every]
    psi = reference.poses[part, 2]
    speed = reference.speed[part] * np.exp(1j * reference.heading[part])
    if kind == "vehicle":
        speed = reference.speed[part] * np.cos(reference.heading[part] - psi) * np.exp(1j * psi)
    if len(part) > 1 and float(np.abs(np.diff(speed)).max()) > 1.02 * m.disc * every * step + 1e-4:
        raise Wrong("the reference goes beyond what is assumed, so that later times are another question")


class _Taken:
    """What the traffic takes, and what is no road."""

    def __init__(self, prepared: Prepared, scenario: Any, traffic: Traffic) -> None:
        self.prepared, self.scenario, self.traffic = prepared, scenario, traffic
        self.dt = prepared.scene.dt

    @cached_property
    def road(self) -> Any:
        """The road, laid out anew; None where it does not count."""
        checker = self.prepared.config.checker
        return road_of(self.scenario, float(checker.road_gap)) if checker.road else None

    @cached_property
    def beside(self) -> frozenset[int]:
        """Obstacles whose margin the ego starts in, which then does not count."""
        import shapely

        start, vehicle = self.prepared.scene.initial_state, self.prepared.scene.vehicle
        wide = float(self.prepared.config.checker.clearance) + _ROUNDING
        pose = np.array([[start.x, start.y, start.orientation]])
        ego = outlines(pose, vehicle.half_length + wide, vehicle.half_width + wide)[0]
        there = ((body.id, _at(body, 0.0, self.dt)) for body in self.traffic.bodies)
        return frozenset(i for i, shape in there if shape is not None and shapely.intersects(ego, shape))

    def require(self, kind: str, one: Mapping[str, Any], time: float, start: Sequence[float]) -> None:
        """A shape has to be inside of what is taken at its time.

        Raises
        ------
        Wrong
            Otherwise.
        """
        import shapely

        obstacle = int(one["obstacle"])
        corners = [(float(x) + start[0], float(y) + start[1]) for x, y in one["shape"]]
        if not all(math.isfinite(v) for corner in corners for v in corner):
            raise Wrong("a shape has no place")
        shape = shapely.Polygon(corners)
        if obstacle == _NO_ROAD:
            # the margin around the body does not count at the edge, and reaches farthest at its corners
            margin = math.sqrt(2.0) * self.prepared.config.checker.clearance if kind == "search" else 0.0
            if self.road is None or not shapely.distance(self.road, shape) > margin:
                raise Wrong("what is said to be no road is some, or too near to it")
            return
        if kind == "search" and obstacle in self.beside:
            raise Wrong(f"the margin of obstacle {obstacle}, in which the ego starts, does not count")
        for body in self.traffic.bodies:
            if body.id == obstacle:
                there = _at(body, time, self.dt)
                if there is not None and shapely.covers(there.buffer(_ROUNDING), shape):
                    return
        raise Wrong(f"obstacle {obstacle} is not where it says at {time:.3f} s")


def _at(body: Body, time: float, dt: float) -> Any:
    """Outline of a body at a time; None where it is not there."""
    from shapely import affinity

    place = time / dt
    k = math.floor(place + 1e-6)
    share = min(max(place - k, 0.0), 1.0)
    share = 0.0 if share < 1e-6 else share
    if body.outline is None:
        return body.held[k] if 0 <= k < len(body.held) else None
    if not 0 <= k < len(body.poses) or (share and k + 1 >= len(body.poses)):
        return None
    pose = body.poses[k].copy()
    if share:
        change = body.poses[k + 1] - pose
        change[2] = float(wrapped(change[2]))
        pose += share * change
    if not np.isfinite(pose).all():
        return None
    turned = affinity.rotate(body.outline, float(pose[2]), (0.0, 0.0), use_radians=True)
    return affinity.translate(turned, float(pose[0]), float(pose[1]))
