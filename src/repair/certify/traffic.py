"""The traffic of a scenario file, read once more and by other code than the search's.

CommonRoad's objects become bodies that move and turn linearly between the steps, and regions that hold over a
step. What is plain in the file (standing, driven by exact states, stated by occupancies) is read here;
trailers, uncertain states and what goes on after a prediction are taken from the scene, and named.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.arrays import Array
from repair.certify.motion import wrapped
from repair.scene.traffic.trailers import is_train

if TYPE_CHECKING:
    from repair.config.schema import Config
    from repair.scene.scene import Scene
    from repair.scene.traffic.obstacle import Obstacle

__all__ = ["Body", "Traffic", "read_traffic"]


@dataclass(frozen=True)
class Body:
    """One convex or not convex part of an obstacle.

    Attributes
    ----------
    id : int
    outline : shapely geometry or None
        Seen from its own pose; None where ``held`` says where it is.
    poses : (S, 3) array
        x, y, orientation at the steps from the planning problem's first on; NaN where it is not there.
    radius : float
        Around the pose [m].
    held : tuple of shapely geometries
        What is covered from each step to the next; None where nothing is.
    """

    id: int
    outline: Any
    poses: Array
    radius: float
    held: tuple[Any, ...] = ()


@dataclass(frozen=True)
class Traffic:
    """All bodies; obstacles left out as the ego's own recording, and those that the scene had to read."""

    bodies: tuple[Body, ...]
    left_out: tuple[int, ...]
    by_scene: tuple[int, ...]


def read_traffic(scenario: Any, problem: Any, scene: Scene, config: Config, steps: int) -> Traffic:
    """The traffic over ``steps`` steps from the planning problem's first one on.

    Parameters
    ----------
    scenario, problem
        CommonRoad objects, read anew.
    scene : Scene
        Of the same file, for what is not plain in it.
    config : Config
    steps : int
    """
    first = int(getattr(problem.initial_state.time_step, "start", problem.initial_state.time_step))
    bodies: list[Body] = []
    left_out: list[int] = []
    by_scene: list[int] = []
    for obstacle in [
        *scenario.static_obstacles, *scenario.dynamic_obstacles,
        *getattr(scenario, "phantom_obstacle", ()), *getattr(scenario, "environment_obstacle", ()),
    ]:  # fmt: skip
        if _is_ego(obstacle, problem, config, first, scene.vehicle.length if not left_out else None):
            left_out.append(int(obstacle.obstacle_id))
            continue
        made = _plain(obstacle, first, steps, config.scene.after_prediction)
        if made is None:
            by_scene.append(int(obstacle.obstacle_id))
            same = [o for o in scene.obstacles if o.id == int(obstacle.obstacle_id)]
            made = [body for o in same for body in _of_scene(o, steps)]
        bodies += made
    return Traffic(tuple(bodies), tuple(left_out), tuple(by_scene))


def _is_ego(obstacle: Any, problem: Any, config: Config, first: int, long: float | None) -> bool:
    """A recording of the ego itself: begins where the planning problem does, or is followed on purpose.

    ``long`` is the ego's length [m], None where such a recording has been found already.
    """
    if getattr(getattr(obstacle, "prediction", None), "trajectory", None) is None:
        return False
    chosen = config.reference.obstacle_id
    if config.reference.source == "recorded" and chosen is not None and obstacle.obstacle_id == chosen:
        return True
    ego, state = problem.initial_state, obstacle.state_at_time(first)
    if state is None or not _exact(state):
        return False
    faster = abs(getattr(state, "velocity", ego.velocity) - ego.velocity) < 1.0
    if obstacle.obstacle_id == problem.planning_problem_id and faster:
        return True
    near = float(np.hypot(*(np.asarray(state.position)[:2] - np.asarray(ego.position)[:2]))) < 0.5
    turned = abs(float(wrapped(getattr(state, "orientation", ego.orientation) - ego.orientation))) < 0.1
    length = getattr(obstacle.obstacle_shape, "length", None)
    alike = length is None or (long is not None and abs(length - long) < 2.0)
    return near and turned and faster and alike and long is not None


def _exact(state: Any) -> bool:
    """Position and orientation are numbers, and there is no trailer."""
    position, heading = getattr(state, "position", None), getattr(state, "orientation", None)
    sharp = not (hasattr(position, "center") or hasattr(position, "shapes") or hasattr(heading, "start"))
    return bool(
        sharp and position is not None and heading is not None and getattr(state, "hitch_angle", None) is None
    )


def _plain(obstacle: Any, first: int, steps: int, after: str) -> list[Body] | None:
    """The bodies of an obstacle that is plain in the file; None where it is not."""
    name, initial = int(obstacle.obstacle_id), getattr(obstacle, "initial_state", None)
    prediction, shape = getattr(obstacle, "prediction", None), getattr(obstacle, "obstacle_shape", None)
    if prediction is None:
        if initial is None:
            return None if shape is None else [_region(name, [_place(shape)] * (steps + 1))]
        if not _exact(initial) or (after == "constant_velocity" and getattr(initial, "velocity", None)):
            return None
        pose = [*np.asarray(initial.position)[:2], float(initial.orientation)]
        return _bodies(name, shape, np.tile(pose, (steps + 1, 1)))
    trajectory = getattr(prediction, "trajectory", None)
    if trajectory is not None and initial is not None:
        if is_train(obstacle):
            return None
        states = {int(s.time_step): s for s in trajectory.state_list if not hasattr(s.time_step, "start")}
        states[int(initial.time_step)] = initial
        if not all(_exact(s) for s in states.values()) or len(states) < len(trajectory.state_list):
            return None
        if (after != "remove" and max(states) < first + steps) or prediction.shape != shape:
            return None
        poses = np.full((steps + 1, 3), np.nan)
        for step, state in states.items():
            if 0 <= step - first <= steps:
                poses[step - first] = (*np.asarray(state.position)[:2], state.orientation)
        return _bodies(name, shape, poses)
    if after != "remove" or (initial is not None and not _exact(initial)):
        return None
    stated: list[Any] = [None] * (steps + 1)
    if initial is not None and 0 <= initial.time_step - first <= steps:
        stated[int(initial.time_step) - first] = _place(
            shape, np.asarray(initial.position)[:2], float(initial.orientation)
        )
    for occupancy in prediction.occupancy_set:
        low = getattr(occupancy.time_step, "start", occupancy.time_step) - first
        high = getattr(occupancy.time_step, "end", occupancy.time_step) - first
        covered = _place(occupancy.shape)
        for k in range(max(int(np.floor(low)), 0), min(int(np.ceil(high)), steps) + 1):
            stated[k] = covered if stated[k] is None else stated[k].union(covered)
    return [_region(name, stated)]


def _members(shape: Any) -> list[Any]:
    """The parts of a shape that are no groups."""
    if hasattr(shape, "shapes"):
        return [member for part in shape.shapes for member in _members(part)]
    return [shape]


def _outline(part: Any) -> tuple[Any, Array]:
    """Outline of a part about its own centre, and that centre."""
    import shapely

    centre = np.asarray(part.center, dtype=np.float64)[:2]
    if hasattr(part, "radius"):  # its shapely object has half of it
        # circumscribed: the polygon's sides touch the circle
        edges = 64
        return shapely.Point(0.0, 0.0).buffer(
            part.radius / np.cos(np.pi / edges), quad_segs=edges // 4
        ), centre
    if hasattr(part, "length"):
        c, s, a, b = np.cos(part.orientation), np.sin(part.orientation), part.length / 2, part.width / 2
        corners = np.array([[a, b], [-a, b], [-a, -b], [a, -b]]) @ np.array([[c, s], [-s, c]])
        return shapely.Polygon(corners), centre
    polygon = shapely.Polygon(np.asarray(part.vertices)[:, :2] - centre)
    return (polygon if polygon.is_valid else polygon.convex_hull), centre


def _place(shape: Any, position: Array | None = None, heading: float = 0.0) -> Any:
    """A shape in the plane: each part turns about its own centre, which is then moved."""
    import shapely
    from shapely import affinity

    placed = []
    for part in _members(shape):
        outline, centre = _outline(part)
        turned = affinity.rotate(outline, heading, (0.0, 0.0), use_radians=True)
        at = centre if position is None else centre + position
        placed.append(affinity.translate(turned, float(at[0]), float(at[1])))
    return shapely.union_all(placed)


def _bodies(name: int, shape: Any, poses: Array) -> list[Body]:
    made = []
    for part in _members(shape):
        outline, centre = _outline(part)
        own = poses.copy()
        own[:, :2] += centre
        made.append(Body(name, outline, own, _radius(outline)))
    return made


def _radius(outline: Any) -> float:
    import shapely

    return float(np.hypot(*shapely.get_coordinates(outline).T).max())


def _region(name: int, stated: Sequence[Any]) -> Body:
    """A region that is stated at the steps: between two, the union of both."""
    held = []
    for here, following in zip(stated, [*stated[1:], None], strict=True):
        parts = [p for p in (here, following) if p is not None]
        held.append(None if not parts else parts[0] if parts[0] is parts[-1] else parts[0].union(parts[1]))
    return Body(name, None, np.empty((0, 3)), 0.0, tuple(held))


def _rigid(obstacle: Obstacle, steps: int) -> Body | None:
    """A rectangle or circle of one size that moves and turns; None for anything else."""
    import shapely

    table = obstacle.rectangles if obstacle.rectangles is not None else obstacle.circles
    if obstacle.role not in ("static", "dynamic") or table is None:
        return None
    table = table[: steps + 1]
    sizes = table[np.isfinite(table[:, 0]), 3 if obstacle.rectangles is not None else 2 :]
    if not len(sizes) or np.ptp(sizes, axis=0).any():
        return None
    if obstacle.rectangles is not None:
        a, b = (float(half) for half in sizes[0])
        outline, poses = shapely.box(-a, -b, a, b), table[:, :3]
    else:
        radius = float(sizes[0, 0])
        outline = shapely.Point(0.0, 0.0).buffer(radius / np.cos(np.pi / 64), quad_segs=16)
        poses = np.column_stack([table[:, :2], 0.0 * table[:, 0]])  # NaN where it is not there
    return Body(obstacle.id, outline, np.asarray(poses, dtype=np.float64), _radius(outline))


def _of_scene(obstacle: Obstacle, steps: int) -> list[Body]:
    """An obstacle as the search reads it: rigid, or between two steps the hull of both, part by part."""
    import shapely

    rigid = _rigid(obstacle, steps)
    if rigid is not None:
        return [rigid]
    rows: list[list[Any]] = []
    for k in range(min(steps, obstacle.n_steps) + 1):
        parts: list[Any] = []
        if obstacle.rectangles is not None and np.isfinite(obstacle.rectangles[k, 0]):
            x, y, heading, a, b = obstacle.rectangles[k]
            turn = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
            corners = np.array([[a, b], [-a, b], [-a, -b], [a, -b]]) @ turn + (x, y)
            parts = [shapely.Polygon(corners)]
        elif obstacle.circles is not None and np.isfinite(obstacle.circles[k, 0]):
            x, y, radius = obstacle.circles[k]
            parts = [shapely.Point(x, y).buffer(radius, quad_segs=16)]
        elif obstacle.polygons:
            parts = [shapely.Polygon(p) for p in obstacle.polygons[k]]
        rows.append(parts)
    held = []
    for here, following in zip(rows, [*rows[1:], []], strict=True):
        if len(here) == len(following):
            parts = [shapely.union_all(pair).convex_hull for pair in zip(here, following, strict=True)]
        else:
            parts = [*here, *following]
        held.append(shapely.union_all(parts) if parts else None)
    return [Body(obstacle.id, None, np.empty((0, 3)), 0.0, tuple(held))]
