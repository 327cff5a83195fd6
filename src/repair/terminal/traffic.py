"""Traffic for longer than a scene looks ahead, and what becomes of it where its predictions end."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.scene.traffic.obstacle import Obstacle
from repair.scene.traffic.obstacles import last_predicted_step, obstacles_of
from repair.scene.traffic.rows import continued_from

if TYPE_CHECKING:
    from repair.scene.scene import Scene

__all__ = ["LastSteps", "extended", "traffic_until"]


class LastSteps:
    """The last steps that the file predicts, counted from the start; each obstacle is looked through once.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._found: dict[int, tuple[Any, int | None]] = {}  # by the id of what was looked through

    def of(self, obstacle: Obstacle) -> int | None:
        """That of an obstacle; None for what has no prediction."""
        source = obstacle.source
        return None if source is None else self._of(source, _only([source]))

    @property
    def of_all(self) -> int | None:
        """That of the file; None where nothing moves."""
        return self._of(self._scene.scenario, self._scene.scenario)

    def _of(self, thing: Any, scenario: Any) -> int | None:
        found = self._found.get(id(thing))
        if found is None or found[0] is not thing:  # a copy of this may hold ids of other things
            last = last_predicted_step(scenario)
            found = thing, None if last is None else last - self._scene.initial_time_step
            self._found[id(thing)] = found
        return found[1]


def traffic_until(scene: Scene, n_steps: int, ends: LastSteps | None = None) -> tuple[Obstacle, ...]:
    """The obstacles of a scene with ``n_steps + 1`` rows, at least as many as they have.

    What the file predicts beyond the scene's horizon is read from it, those included that come later; after
    that they are as ``scene.after_prediction`` has it.

    Parameters
    ----------
    scene : Scene
    n_steps : int
        Index of the last row.
    ends : LastSteps, optional
        Of this scene, where it is asked more than once.
    """
    how, ends = scene.settings.after_prediction, ends or LastSteps(scene)
    found: list[Obstacle] = []
    for obstacle in scene.obstacles:
        last = ends.of(obstacle)
        if obstacle.source is not None and last is not None and last > scene.n_steps:
            found += _read([obstacle.source], scene, n_steps, how)
        else:
            found.append(_longer(obstacle, n_steps, how, scene.dt))
    return (*found, *_later(scene, n_steps, how, ends))


def extended(
    scene: Scene, known: Iterable[Obstacle], n_steps: int, how: str, ends: LastSteps | None = None
) -> tuple[Obstacle, ...]:
    """Those of the obstacles whose prediction ends before ``n_steps``, as they go on after it.

    Parameters
    ----------
    scene : Scene
    known : iterable of Obstacle
        What :func:`traffic_until` gave for ``n_steps``.
    n_steps : int
    how : str
        ``hold`` or ``constant_velocity``.
    ends : LastSteps, optional
        Of this scene, where it is asked more than once.
    """
    ends = ends or LastSteps(scene)
    loaded = scene.settings.after_prediction
    found: list[Obstacle] = []
    for obstacle in known:
        last = ends.of(obstacle)
        restarts = _unpredicted(obstacle) and how == "constant_velocity"
        if obstacle.source is not None and (restarts or (last is not None and loaded not in ("remove", how))):
            found += _read([obstacle.source], scene, n_steps, how)
        elif not np.isfinite(obstacle.states[n_steps, 0]):
            found.append(replace(_longer(obstacle, n_steps, how, scene.dt), late=0))
    return tuple(found)


def _unpredicted(obstacle: Obstacle) -> bool:
    """It could move, and the file does not say how."""
    source = obstacle.source
    return obstacle.role == "dynamic" and source is not None and source.prediction is None


def _only(sources: list[Any], dt: float = 0.0) -> Any:
    """What looks like a scenario with these obstacles."""
    return SimpleNamespace(static_obstacles=sources, dynamic_obstacles=[], dt=dt)


def _read(sources: list[Any], scene: Scene, n_steps: int, how: str) -> tuple[Obstacle, ...]:
    return obstacles_of(
        _only(sources, scene.dt), first_step=scene.initial_time_step, n_steps=n_steps, after_prediction=how
    )[0]


def _later(scene: Scene, n_steps: int, how: str, ends: LastSteps) -> tuple[Obstacle, ...]:
    """Obstacles that are there only after the scene's horizon."""
    if n_steps <= scene.n_steps or ends.of_all is None or ends.of_all <= scene.n_steps:
        return ()
    known = {id(obstacle.source) for obstacle in scene.obstacles}
    others = [o for o in scene.scenario.dynamic_obstacles if id(o) not in known]
    came = _read(others, scene, n_steps, how)
    return tuple(o for o in came if np.isnan(o.states[: scene.n_steps + 1, 0]).all())


def _longer(obstacle: Obstacle, n_steps: int, how: str, dt: float) -> Obstacle:
    """As :func:`continued_from`, after the last row at which it is there; what stands, stands on."""
    there = np.flatnonzero(np.isfinite(obstacle.states[:, 0]))
    if not len(there):
        return continued_from(obstacle, obstacle.n_steps, max(n_steps, obstacle.n_steps), "remove", dt)
    last = int(there[-1])
    stands = obstacle.role in ("static", "environment")
    if stands or _unpredicted(obstacle):
        how = "hold"
    if how == "remove" and n_steps == obstacle.n_steps:
        return obstacle
    return continued_from(obstacle, last, n_steps, how, dt)
