"""What happens in the plane: contact, margin and the edge of the road, by tests of this room's own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.certify.certificate import CertificateRow, at_most, said
from repair.certify.contact import Meeting, first_meeting, outlines
from repair.certify.motion import Motion
from repair.certify.traffic import Traffic
from repair.timegrid import INSTANT

if TYPE_CHECKING:
    from repair.preparation import Prepared

__all__ = [
    "ContactTime", "beyond_the_road", "contact_rows", "contact_time_row", "road_of", "road_rows",
    "traffic_words",
]  # fmt: skip

_CONTACT_TIME = (
    5e-3  # the contact of a reference is found to a millisecond, on another polygon of its way [s]
)
_DEEP = 1e-4  # of the ego's body over the edge of the road that is rounding [m]


@dataclass(frozen=True)
class ContactTime:
    """What the record says of the reference's contact: time [s] or None, and with whom."""

    time: float | None
    obstacle_id: int | None


def traffic_words(traffic: Traffic) -> str:
    """How many obstacles there are, who was left out, and whom the search's own reading was taken of."""
    words = [f"{len({b.id for b in traffic.bodies})} obstacles, read anew"]
    if traffic.left_out:
        words.append(f"left out as the ego's recording: {', '.join(map(str, traffic.left_out))}")
    if traffic.by_scene:
        words.append(f"as the search reads them: {', '.join(map(str, traffic.by_scene[:5]))}")
    return "; ".join(words)


def contact_rows(
    prepared: Prepared, ways: tuple[Motion, ...], traffic: Traffic, t_rep: float
) -> list[CertificateRow]:
    """No contact of the true shapes, and none with the margin that was asked for, on any of the ways.

    Parameters
    ----------
    ways : tuple of Motion
        As the solution file says, and as the curve says.
    t_rep : float
        The margin is kept from here on [s].
    """
    vehicle, dt = prepared.scene.vehicle, prepared.scene.dt
    t_end = min(float(way.t[-1]) for way in ways)
    half = vehicle.half_length, vehicle.half_width
    met = _worst([first_meeting(way, half, traffic.bodies, dt) for way in ways])
    near = f"; nearest {met.distance:.3f} m{_whom(met.nearest)}" if 0.0 < met.distance < np.inf else ""
    rows = [_free("first contact of the shapes", met, t_end, near)]
    margin = float(prepared.config.checker.clearance)
    if margin > 0.0:
        wide = half[0] + margin, half[1] + margin
        entered = _worst(
            [first_meeting(way, wide, traffic.bodies, dt, since=t_rep, beside=True) for way in ways]
        )
        rows.append(_free(f"margin of {margin:g} m entered", entered, t_end))
    return rows


def _free(name: str, met: Meeting, t_end: float, more: str = "") -> CertificateRow:
    """A row of when something is met, which has to be never before the end.

    At the very end a set that holds from there on begins, and what comes then is not what was asked.
    """
    if met.time < t_end - INSTANT:
        return CertificateRow(name, met.time, t_end, met.time - t_end, False, "continuous", _unit(met))
    return CertificateRow(name, t_end, t_end, 0.0, True, "continuous", f"s{more}")


def _worst(found: list[Meeting]) -> Meeting:
    first = min(found, key=lambda m: m.time)
    near = min(found, key=lambda m: m.distance)
    return Meeting(first.time, first.obstacle_id, near.distance, near.nearest)


def _unit(met: Meeting) -> str:
    return f"s{_whom(met.obstacle_id)}"


def _whom(obstacle_id: int | None) -> str:
    return "" if obstacle_id is None else f", obstacle {obstacle_id}"


def contact_time_row(
    prepared: Prepared, reference: Motion, traffic: Traffic, recorded: ContactTime
) -> CertificateRow:
    """The contact of the reference that the record tells, against the one found here."""
    vehicle = prepared.scene.vehicle
    half = vehicle.half_length, vehicle.half_width
    met = first_meeting(reference, half, traffic.bodies, prepared.scene.dt)
    # The drivability checker has some obstacles late, and a contact with them where it has them counts too.
    late = any(o.late for o in prepared.scene.obstacles)
    said_time = np.inf if recorded.time is None else recorded.time
    if np.isinf(said_time) and np.isinf(met.time):
        return said("contact TTC: none", True, "continuous")
    off = said_time - met.time
    ok = abs(off) <= _CONTACT_TIME or (late and off < 0.0)
    same = recorded.obstacle_id == met.obstacle_id or late or abs(off) > 0.0
    return CertificateRow(
        "contact TTC", said_time, met.time, -abs(off), bool(ok and same), "continuous", _unit(met)
    )


def road_rows(prepared: Prepared, scenario: Any, ways: tuple[Motion, ...]) -> list[CertificateRow]:
    """Whether the ego stays on the road, gaps of the map closed as they were for the result.

    Parameters
    ----------
    prepared : Prepared
    scenario : commonroad.scenario.scenario.Scenario
        Read anew.
    ways : tuple of Motion
        As in :func:`contact_rows`.
    """
    vehicle = prepared.scene.vehicle
    road = road_of(scenario, float(prepared.config.checker.road_gap))
    found = [beyond_the_road(way, vehicle.half_length, vehicle.half_width, road) for way in ways]
    since, far = min(f[0] for f in found), max(f[1] for f in found)
    at = f"m, from {since:.2f} s on" if far > _DEEP else "m"
    return [at_most("beyond the edge of the road", far, 0.0, "sampled", at, _DEEP)]


def road_of(scenario: Any, gap: float = 0.0) -> Any:
    """The road as one prepared shapely geometry: all lanelets and what lies between neighbours.

    Parameters
    ----------
    scenario : commonroad.scenario.scenario.Scenario
    gap : float
        Gaps narrower than this are closed [m].
    """
    import shapely

    network = scenario.lanelet_network
    parts = []
    for lanelet in network.lanelets:
        left, right = lanelet.left_vertices[:, :2], lanelet.right_vertices[:, :2]
        parts.append(_area(right, left))
        beside = network.find_lanelet_by_id(lanelet.adj_left) if lanelet.adj_left is not None else None
        if beside is not None:  # both bounds may be drawn a little apart
            same = bool(lanelet.adj_left_same_direction)
            bound = beside.right_vertices[:, :2] if same else beside.left_vertices[::-1, :2]
            parts.append(_area(left, bound))
    region = shapely.union_all([p for p in parts if p.area > 0.0])
    if gap > 0.0:
        # with finer arcs than the checker's: what those round off is within the disc
        closed = region.buffer(0.5 * gap, quad_segs=16).buffer(-0.5 * gap, quad_segs=16)
        region = shapely.union_all([region, closed])
    shapely.prepare(region)
    return region


def _area(right: Any, left: Any) -> Any:
    """The polygon between two lines of the same direction."""
    import shapely

    polygon = shapely.Polygon(np.concatenate([right, left[::-1]]))
    return polygon if polygon.is_valid else polygon.buffer(0.0)


def beyond_the_road(motion: Motion, half_length: float, half_width: float, road: Any) -> tuple[float, float]:
    """Since when the ego is beyond the edge [s] (inf: never), and how far at most [m]."""
    import shapely

    bodies = outlines(motion.poses, half_length, half_width)
    off = np.flatnonzero(~shapely.covers(road, bodies))
    if not len(off):
        return np.inf, 0.0
    some = np.unique(off[np.linspace(0, len(off) - 1, min(len(off), 100)).astype(np.intp)])
    outside = shapely.difference(bodies[some], road)
    far = 0.0
    for part in outside:
        points = shapely.points(shapely.get_coordinates(part))
        far = max(far, float(shapely.distance(points, road).max(initial=0.0)))
    return float(motion.t[off[0]]), far
