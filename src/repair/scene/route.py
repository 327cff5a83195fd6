"""From the lanelet graph to a centre line: where the ego starts, where it is to go, and what lies between."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from repair.errors import ScenarioError
from repair.scene.shapes import FAR
from repair.types import Array, frozen

__all__ = ["Lane", "Route", "goal_areas", "lanes_of", "plan_route"]

_NEAR = 5.0  # a start this far [m] outside of every lanelet is still taken
_HEADING_MAX = np.deg2rad(100.0)
_HEADING_SPREAD = np.deg2rad(45.0)  # worse matches are considered only where no better one is
_CHANGE_COST = 50.0  # a lane change weighs as much as this much road [m]
_BEHIND = 45.0  # centre line behind the ego [m]
_FAR = 450.0  # centre line ahead of the ego at most [m]
_NOT_FOR_CARS = frozenset({"sidewalk", "bicycleLane", "crosswalk", "busStop", "border"})


@dataclass(frozen=True)
class Lane:
    """A lanelet with what routing needs; neighbours of the same direction only.

    ``center``, ``left`` and ``right`` are (M, 2) arrays; ``drivable`` is False for sidewalks and
    their like.
    """

    id: int
    center: Array
    left: Array
    right: Array
    length: float
    successors: tuple[int, ...]
    predecessors: tuple[int, ...]
    neighbours: tuple[int, ...]
    drivable: bool
    polygon: Any


@dataclass(frozen=True)
class Route:
    """A centre line and where it comes from.

    Attributes
    ----------
    lanelets : tuple of int
        In driving order, from the ego's lanelet on (the one it leaves by a lane change included).
    behind : tuple of int
        Those before, as far as the centre line reaches back.
    center : (M, 2) array
        The centre line [m], from about 45 m behind the ego to the end of the route.
    goal_lanelets : tuple of int
        Those of ``lanelets`` that belong to the goal.
    road_ends : bool
        The centre line stops because the road does.
    notes : tuple of str
    """

    lanelets: tuple[int, ...]
    behind: tuple[int, ...]
    center: Array
    goal_lanelets: tuple[int, ...]
    road_ends: bool
    notes: tuple[str, ...]


def lanes_of(network: Any) -> tuple[dict[int, Lane], list[str]]:
    """Read the lanelets of a CommonRoad network; returns them by id, and notes on those left out.

    Raises
    ------
    ScenarioError
        If there is no usable lanelet or one has a vertex that is not finite.
    """
    import shapely

    lanes: dict[int, Lane] = {}
    notes: list[str] = []
    for lanelet in network.lanelets:
        name = int(lanelet.lanelet_id)
        left, center, right = (
            np.asarray(v, dtype=np.float64)[:, :2]
            for v in (lanelet.left_vertices, lanelet.center_vertices, lanelet.right_vertices)
        )
        if not all(np.isfinite(v).all() for v in (left, center, right)):
            raise ScenarioError(f"lanelet {name} has a vertex that is not finite")
        if not all((np.abs(v) <= FAR).all() for v in (left, center, right)):
            raise ScenarioError(f"lanelet {name} has a vertex farther than {FAR:g} m out")
        length = float(np.sum(np.hypot(*np.diff(center, axis=0).T)))
        if length < 0.05:
            notes.append(f"lanelet {name} has no length and is ignored")
            continue
        neighbours = []
        if lanelet.adj_left is not None and lanelet.adj_left_same_direction:
            neighbours.append(int(lanelet.adj_left))
        if lanelet.adj_right is not None and lanelet.adj_right_same_direction:
            neighbours.append(int(lanelet.adj_right))
        kinds = {kind.value for kind in (lanelet.lanelet_type or ())}
        outline = shapely.Polygon(np.concatenate([left, right[::-1]]))
        lanes[name] = Lane(
            id=name,
            center=frozen(center),
            left=frozen(left),
            right=frozen(right),
            length=length,
            successors=tuple(int(i) for i in lanelet.successor or ()),
            predecessors=tuple(int(i) for i in lanelet.predecessor or ()),
            neighbours=tuple(neighbours),
            drivable=not kinds & _NOT_FOR_CARS,
            polygon=outline if outline.is_valid else shapely.make_valid(outline),
        )
    if not lanes:
        raise ScenarioError("the scenario has no lanelet that could be driven on")
    return lanes, notes


def wrap(angle: Any) -> Any:
    """Angle(s) in [-pi, pi)."""
    return (np.asarray(angle) + np.pi) % (2.0 * np.pi) - np.pi


def locate(line: Array, point: Array) -> tuple[float, float, float]:
    """Arc length, lateral offset and heading of a polyline at the point of it nearest to ``point``."""
    start, step = line[:-1], np.diff(line, axis=0)
    square = np.maximum(np.sum(step**2, axis=1), 1e-12)
    along = np.clip(np.sum((point - start) * step, axis=1) / square, 0.0, 1.0)
    gap = point - start - along[:, None] * step
    index = int(np.argmin(np.sum(gap**2, axis=1)))
    length = np.sqrt(square)
    cross = step[index, 0] * gap[index, 1] - step[index, 1] * gap[index, 0]
    arc = float(np.sum(length[:index]) + along[index] * length[index])
    heading = float(np.arctan2(step[index, 1], step[index, 0]))
    return arc, float(np.copysign(np.hypot(*gap[index]), cross)), heading


# ---------------------------------------------------------------------- graph


def goal_areas(goal: Any) -> list[Any]:
    """The goal's positions as shapely polygons.

    Raises
    ------
    ScenarioError
        If one has a vertex that is not finite or out of the world.
    """
    found = []
    for state in goal.state_list:
        if not state.has_value("position"):
            continue
        for shape in getattr(state.position, "shapes", [state.position]):
            if not hasattr(type(shape), "shapely_object"):  # a point
                continue
            if not (np.abs(getattr(shape, "vertices", shape.center)) <= FAR).all():
                raise ScenarioError(
                    f"the goal region has a vertex that is not finite or farther than {FAR:g} m out"
                )
            found.append(shape.shapely_object)
    return found


def _goal_groups(goal: Any, lanes: Mapping[int, Lane]) -> list[set[int]]:
    """Goal lanelets, best knowledge first: ids given, lanelets at the shapes' centres, those touched."""
    import shapely

    named: set[int] = set()
    for ids in (goal.lanelets_of_goal_position or {}).values():
        named.update(i for i in ids if i in lanes)
    groups = [named] if named else []
    areas = goal_areas(goal)
    if areas and not named:
        centres = [a.centroid for a in areas]
        drivable = [lane for lane in lanes.values() if lane.drivable]
        for targets in (centres, areas):
            groups.append({v.id for v in drivable if any(shapely.intersects(v.polygon, t) for t in targets)})
    return [g for g in groups if g]


def _graph(lanes: Mapping[int, Lane]) -> Any:
    import networkx

    graph = networkx.DiGraph()
    graph.add_nodes_from(lanes)
    for lane in lanes.values():
        if not lane.drivable:
            continue
        graph.add_weighted_edges_from((lane.id, n, _CHANGE_COST) for n in lane.neighbours if n in lanes)
        graph.add_weighted_edges_from((lane.id, n, lane.length) for n in lane.successors if n in lanes)
    return graph


def _starts(lanes: Mapping[int, Lane], position: Array, heading: float) -> list[tuple[float, int]]:
    """Lanelets the ego may be on, as (cost, id), best first; cost is mainly the heading error [rad]."""
    import shapely

    ids = list(lanes)
    distance = shapely.distance(np.array([lanes[i].polygon for i in ids]), shapely.Point(position))
    reach = 0.05 if np.any(distance <= 0.05) else _NEAR
    if not np.any(distance <= reach):
        raise ScenarioError(
            f"the ego starts at ({position[0]:.1f}, {position[1]:.1f}), {np.min(distance):.1f} m "
            f"from the nearest lanelet; at most {_NEAR:g} m are bridged"
        )
    found = []
    for i in np.flatnonzero(distance <= reach):
        lane = lanes[ids[i]]
        _, offset, direction = locate(lane.center, position)
        error = float(np.abs(wrap(heading - direction)))
        cost = error + 0.05 * abs(offset) + (0.0 if lane.drivable else 1.0)
        found.append((error, cost, lane.id))
    best = min(error for error, _, _ in found)
    if best > _HEADING_MAX:
        raise ScenarioError(
            f"the ego starts facing {np.rad2deg(best):.0f} degrees away from every lanelet it is on; "
            f"at most {np.rad2deg(_HEADING_MAX):.0f} are bridged"
        )
    limit = max(_HEADING_SPREAD, best + 0.2)
    return sorted((cost, name) for error, cost, name in found if error <= limit)


def _search(
    lanes: Mapping[int, Lane], starts: Sequence[tuple[float, int]], groups: Iterable[set[int]]
) -> tuple[list[int], set[int]] | None:
    """Path from the best start that reaches a goal group, and that group; None if none is reached."""
    import networkx

    graph = _graph(lanes)
    trees = [(cost, *networkx.single_source_dijkstra(graph, name)) for cost, name in starts]
    for group in groups:
        options = []
        for cost, distance, paths in trees:
            reached = [g for g in group if g in distance]
            if reached:
                nearest = min(reached, key=lambda g: (distance[g], g))
                changes = sum(
                    b not in lanes[a].successors
                    for a, b in zip(paths[nearest], paths[nearest][1:], strict=False)
                )
                options.append((cost + 0.1 * changes, distance[nearest], paths[nearest]))
        if options:
            return list(min(options)[2]), group
    return None


def _change_early(path: list[int], lanes: Mapping[int, Lane]) -> list[int]:
    """Move every lane change as far ahead as the graph allows: P, A, B becomes P, Q, B."""
    path = list(path)
    for _ in range(len(path) ** 2):
        for k in range(1, len(path) - 1):
            before, here, after = path[k - 1], path[k], path[k + 1]
            if here not in lanes[before].successors or after not in lanes[here].neighbours:
                continue
            beside = [q for q in lanes[before].neighbours if q in lanes and after in lanes[q].successors]
            if beside and beside[0] not in path:
                path[k] = beside[0]
                break
        else:
            break
    return path


def _straightest(
    lanes: Mapping[int, Lane], here: Lane, options: Iterable[int], *, back: bool = False
) -> int | None:
    """The continuation that turns least within its first 20 m (before: its last)."""
    sign = -1.0 if back else 1.0
    line = here.center[::-1] if back else here.center
    direction = _direction(line, -1, sign)
    best, least = None, np.inf
    for name in options:
        if name not in lanes:
            continue
        other = lanes[name].center[::-1] if back else lanes[name].center
        chord = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(other, axis=0).T))])
        index = int(np.clip(np.searchsorted(chord, 20.0), 1, len(other) - 1))
        turn = abs(float(wrap(_direction(other, index, sign) - direction))) + (
            0.0 if lanes[name].drivable else 10.0
        )
        if turn < least:
            best, least = name, turn
    return best


def _straight_start(
    lanes: Mapping[int, Lane], starts: Sequence[tuple[float, int]], position: Array, heading: float
) -> int:
    """Of the start lanelets that fit about equally well, the one that turns least within 20 m.

    Where roads fork, the branches overlap at the ego's place and all have its heading there.
    """
    near = [name for cost, name in starts if cost <= starts[0][0] + 0.15]

    def turn(name: int) -> float:
        arc, _, _ = locate(lanes[name].center, position)
        line, total, last = lanes[name].center, lanes[name].length - arc, name
        while total < 20.0:
            following = _straightest(lanes, lanes[last], lanes[last].successors)
            if following is None:
                break
            line, last = lanes[following].center, following
            total += lanes[following].length
        chord = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
        wanted = chord[-1] - max(total - 20.0, 0.0)
        index = int(np.clip(np.searchsorted(chord, wanted), 1, len(line) - 1))
        return abs(float(wrap(_direction(line, index, 1.0) - heading)))

    return min(near, key=turn)


def _direction(line: Array, end: int, sign: float) -> float:
    end = len(line) - 1 if end < 0 else end
    for start in range(end - 1, -1, -1):
        step = sign * (line[end] - line[start])
        if np.hypot(*step) > 1e-3:
            return float(np.arctan2(step[1], step[0]))
    return 0.0


# ---------------------------------------------------------------------- centre line


def _append(line: list[Array], points: Array) -> None:
    """Join polylines; points that would go backwards over a short overlap are left out."""
    for point in points:
        if line:
            step = point - line[-1]
            if np.hypot(*step) < 1e-3:
                continue
            if len(line) > 1 and np.hypot(*step) < 3.0 and np.dot(step, line[-1] - line[-2]) < 0.0:
                continue
        line.append(point)


def _changed(here: Array, there: Array, distance: float) -> Array:
    """A line that runs from the start of ``here`` over to ``there`` within ``distance``, then along it."""
    chord = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(here, axis=0).T))])
    distance = min(distance, float(chord[-1]))
    arc = np.linspace(0.0, distance, max(int(distance), 4) + 1)
    own = np.stack([np.interp(arc, chord, here[:, 0]), np.interp(arc, chord, here[:, 1])], axis=1)
    where = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(there, axis=0).T))])
    found = np.array([locate(there, p)[0] for p in own])
    other = np.stack([np.interp(found, where, there[:, 0]), np.interp(found, where, there[:, 1])], axis=1)
    u = (arc / max(distance, 1e-9))[:, None]
    blend = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
    return np.concatenate([own + blend * (other - own), there[where > found[-1] + 1.0]])


def _center_line(chain: Sequence[int], lanes: Mapping[int, Lane], change: float) -> Array:
    line: list[Array] = []
    k = 0
    while k < len(chain):
        last = k
        while last + 1 < len(chain) and chain[last + 1] not in lanes[chain[last]].successors:
            last += 1
        here = lanes[chain[k]].center
        _append(line, here if last == k else _changed(here, lanes[chain[last]].center, change * (last - k)))
        k = last + 1
    return np.array(line)


def _cut(line: Array, position: Array) -> tuple[Array, bool]:
    """The part of a centre line around the ego, and whether its far end was cut off."""
    chord = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    here = locate(line, position)[0]
    low, high = max(here - 2.0 * _BEHIND, 0.0), min(here + _FAR, float(chord[-1]))
    inside = (chord > low) & (chord < high)
    arc = np.concatenate([[low], chord[inside], [high]])
    part = np.stack([np.interp(arc, chord, line[:, 0]), np.interp(arc, chord, line[:, 1])], axis=1)
    return part, high < chord[-1]


def plan_route(
    lanes: Mapping[int, Lane],
    position: Array,
    heading: float,
    goal: Any,
    *,
    speed: float,
    ahead: float,
) -> Route:
    """Plan from a pose to a goal region.

    The start is the lanelet that matches the heading best and leads to the goal. Without a goal
    position, or if it cannot be reached, the route goes straight on. Lane changes are made as
    early as possible; the first one is left to the lead-in from the ego's pose. The route runs on
    past the goal until ``ahead`` [m] of road lie before the ego.

    Raises
    ------
    ScenarioError
        If the ego is more than 5 m from every lanelet or faces more than 100 degrees off.
    """
    notes: list[str] = []
    starts = _starts(lanes, position, heading)
    groups = _goal_groups(goal, lanes)
    found = _search(lanes, starts, groups)
    if found is not None:
        path, targets = _change_early(found[0], lanes), found[1]
    else:
        path, targets = [_straight_start(lanes, starts, position, heading)], set()
        if groups:
            notes.append(f"the goal cannot be reached from lanelet {path[0]}: the route goes straight on")
    if lanes[path[0]].polygon.distance(_point(position)) > 0.05:
        notes.append(
            f"the ego starts outside of every lanelet; the nearest that fits its heading is {path[0]}"
        )
    first = 0
    while first + 1 < len(path) and path[first + 1] not in lanes[path[first]].successors:
        first += 1
    changes = first + sum(
        b not in lanes[a].successors for a, b in zip(path[first:], path[first + 1 :], strict=False)
    )
    if changes:
        notes.append(f"the route to the goal needs {changes} lane change{'s' if changes > 1 else ''}")

    remaining = sum(lanes[i].length for i in path[first:]) - locate(lanes[path[first]].center, position)[0]
    road_ends = False
    while remaining < ahead:
        here = lanes[path[-1]]
        following = _straightest(lanes, here, here.successors)
        if following is None or following in path:
            road_ends = following is None
            if following is not None:
                notes.append(f"the route would drive lanelet {following} a second time and stops before it")
            break
        path.append(following)
        remaining += lanes[following].length
    behind: list[int] = []
    room = locate(lanes[path[first]].center, position)[0]
    while room < _BEHIND:
        here = lanes[behind[0] if behind else path[first]]
        previous = _straightest(lanes, here, here.predecessors, back=True)
        if previous is None or previous in path or previous in behind:
            break
        behind.insert(0, previous)
        room += lanes[previous].length
    center = _center_line(behind + path[first:], lanes, float(np.clip(4.0 * speed, 20.0, 80.0)))
    center, cut = _cut(center, position)
    road_ends = road_ends and not cut
    reached = tuple(i for i in path if i in targets)
    return Route(tuple(path), tuple(behind), frozen(center), reached, road_ends, tuple(notes))


def _point(position: Array) -> Any:
    import shapely

    return shapely.Point(position)
