"""From the lanelet graph to a centre line: where the ego starts, where it is to go, and what lies between."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from repair.arrays import Array, frozen, wrap
from repair.errors import ScenarioError
from repair.scene.road.centre_line import BEHIND, centre_line, cut_line, direction_at
from repair.scene.road.goal import goal_groups, point_of
from repair.scene.road.joints import joints_of
from repair.scene.road.lanes import Lane, locate

__all__ = ["RoadEnd", "Route", "plan_route"]

_NEAR = 5.0  # a start this far [m] outside of every lanelet is still taken
_HEADING_MAX = np.deg2rad(100.0)
_HEADING_SPREAD = np.deg2rad(45.0)  # worse matches are considered only where no better one is
# The map goes on beyond the end of a lanelet if anything lies in a strip ahead of it [m].
_BEYOND_FROM, _BEYOND, _BEYOND_ASIDE = 1.0, 60.0, 10.0
_CHANGE_COST = 50.0  # a lane change weighs as much as this much road [m]


@dataclass(frozen=True)
class RoadEnd:
    """Where a route cannot go on because its last lanelet has no successor.

    Attributes
    ----------
    place : (float, float)
        [m]
    lanelet : int
        The last one.
    of_map : bool
        No lanelet lies beyond: the map ends there, and whether the road does is not known.
    """

    place: tuple[float, float]
    lanelet: int
    of_map: bool

    def __str__(self) -> str:
        if self.of_map:
            return "the map ends there, and what lies beyond is not known"
        return f"lanelet {self.lanelet} ends there within the map"


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
        The centre line [m], from about 45 m behind the ego to the end of the route. A ring is in it as often
        as it is driven.
    start : float
        Where the ego is along it [m].
    goal_lanelets : tuple of int
        Those of ``lanelets`` that belong to the goal.
    end : RoadEnd or None
        The centre line stops because the road does.
    notes : tuple of str
    """

    lanelets: tuple[int, ...]
    behind: tuple[int, ...]
    center: Array
    start: float
    goal_lanelets: tuple[int, ...]
    end: RoadEnd | None
    notes: tuple[str, ...]


def _graph(lanes: Mapping[int, Lane]) -> Any:
    """The drivable lanes as a graph whose edges weigh what they cost to drive [m]."""
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
    found: list[tuple[float, float, int]] = []
    best = np.inf
    for within in dict.fromkeys(
        (reach, _NEAR)
    ):  # who drives on an oncoming lane belongs on the one beside it
        if best <= _HEADING_MAX:
            break
        found = []
        for i in np.flatnonzero(distance <= within):
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
    direction = direction_at(line, -1, sign)
    best, least = None, np.inf
    for name in options:
        if name not in lanes:
            continue
        other = lanes[name].center[::-1] if back else lanes[name].center
        chord = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(other, axis=0).T))])
        index = int(np.clip(np.searchsorted(chord, 20.0), 1, len(other) - 1))
        turn = abs(float(wrap(direction_at(other, index, sign) - direction))) + (
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
        return abs(float(wrap(direction_at(line, index, 1.0) - heading)))

    return min(near, key=turn)


def _end(lanes: Mapping[int, Lane], last: int) -> RoadEnd:
    """What kind of end a route has: whether any lanelet lies beyond it."""
    import shapely

    line = lanes[last].center
    direction = direction_at(line, -1, 1.0)
    ahead = np.array([np.cos(direction), np.sin(direction)])
    aside = _BEYOND_ASIDE * np.array([-ahead[1], ahead[0]])
    near, far = line[-1] + _BEYOND_FROM * ahead, line[-1] + _BEYOND * ahead
    strip = shapely.Polygon([near - aside, far - aside, far + aside, near + aside])
    others = [lane.polygon for name, lane in lanes.items() if name != last and lane.drivable]
    met = bool(others) and bool(shapely.intersects(np.array(others), strip).any())
    return RoadEnd((float(line[-1][0]), float(line[-1][1])), last, not met)


def plan_route(
    lanes: Mapping[int, Lane],
    position: Array,
    heading: float,
    goal: Any,
    *,
    speed: float,
    ahead: float,
) -> Route:
    """Plan a route from a pose to a goal region.

    The start is the lanelet that matches the heading best and leads to the goal. Without a goal
    position, or if it cannot be reached, the route goes straight on. Lane changes are made as
    early as possible; the first one is left to the lead-in from the ego's pose. The route runs on
    past the goal until ``ahead`` [m] of road lie before the ego.

    Parameters
    ----------
    lanes : mapping
        The map's lanes by id.
    position : (2,) array
        Of the ego [m].
    heading, speed : float
        Of the ego [rad], [m/s].
    goal : commonroad.planning.goal.GoalRegion
    ahead : float
        Road that is wanted before the ego [m].

    Raises
    ------
    ScenarioError
        If the ego is more than 5 m from every lanelet or faces more than 100 degrees off.
    """
    notes: list[str] = []
    starts = _starts(lanes, position, heading)
    groups = goal_groups(goal, lanes)
    found = _search(lanes, starts, groups)
    if found is not None:
        path, targets = _change_early(found[0], lanes), found[1]
    else:
        path, targets = [_straight_start(lanes, starts, position, heading)], set()
        if groups:
            notes.append(f"the goal cannot be reached from lanelet {path[0]}: the route goes straight on")
    if lanes[path[0]].polygon.distance(point_of(position)) > 0.05:
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
        if following is None:
            road_ends = True
            break
        path.append(following)
        remaining += lanes[following].length
    behind: list[int] = []
    room = locate(lanes[path[first]].center, position)[0]
    while room < BEHIND:
        here = lanes[behind[0] if behind else path[first]]
        previous = _straightest(lanes, here, here.predecessors, back=True)
        if previous is None:
            break
        behind.insert(0, previous)
        room += lanes[previous].length
    chain = [*behind, *path[first:]]
    notes += map(str, joints_of((p for p in pairwise(chain) if p[1] in lanes[p[0]].successors), lanes))
    center = centre_line(chain, lanes, float(np.clip(4.0 * speed, 20.0, 80.0)))
    center, start, cut = cut_line(center, position, room, ahead)
    end = _end(lanes, path[-1]) if road_ends and not cut else None
    reached = tuple(i for i in path if i in targets)
    return Route(tuple(path), tuple(behind), frozen(center), start, reached, end, tuple(notes))
