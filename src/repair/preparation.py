"""From a scene and a configuration to what is searched."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from repair.arrays import Array
from repair.bounds.latest import Quick, too_late
from repair.check.checker import Checker
from repair.check.conflict import detect_conflict
from repair.check.settings import sampled
from repair.check.verdict import Reason
from repair.config.agreed import agreed_with, with_given, with_named
from repair.config.schema import Config, require_types
from repair.curves.base import Curve
from repair.errors import ConfigError, ScenarioError, kind_of
from repair.problem.limits import Limits, part_in_reach, reference_limits, resolve_limits
from repair.reference.consistency import Recording
from repair.reference.given import GivenReference, given_reference
from repair.reference.registry import (
    SOURCES,
    make_reference,
    recording_of,
    reference_notes,
    track_along,
)
from repair.scene.reframe import as_ego, reframe
from repair.scene.road.sections import endless
from repair.scene.scene import Scene
from repair.scene.traffic.obstacle import Obstacle
from repair.situation import Situation
from repair.solvers.registry import sections
from repair.timegrid import INSTANT, on_grid, steps_until
from repair.vehicle.parameters import Vehicle
from repair.world.boxes import Boxes, Occupancy, shrink_to_start
from repair.world.occupancy import Within, build_occupancy

__all__ = ["Phases", "Prepared", "again_for", "among", "laid_out", "prepare", "what_matters"]

# Wider than a rounding error, narrower than anything that matters: what is kept by default beyond
# half of the vehicle, because a box in (s, l) is not the vehicle's rectangle.
_BODY_MARGIN = 0.1
# What CommonRoad's drivability checker judges as well.
_JUDGED = {Reason.KINEMATICS.value, Reason.LIMITS.value}
# What is asked of something prepared, and changes nothing about it; nor do the sections of the backends.
_ASKED_LATER = {
    "scenario", "driver", "backend", "fallback", "metrics", "search", "evasive", "bound", "for_backend",
    "simulate",
}  # fmt: skip


@dataclass
class Phases:
    """Wall time by phase [s]."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Add the time of a ``with`` block to a phase."""
        begin = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - begin


@dataclass(frozen=True, repr=False)
class Prepared(Situation):
    """A situation with the configuration that it was made by.

    Attributes
    ----------
    config : Config
    phases : dict
        Wall time of the preparation by phase [s].
    given : GivenReference or None
        The reference that was handed over from memory.
    """

    config: Config
    phases: dict[str, float]
    given: GivenReference | None = None

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """What had to be assumed, and which settings have no effect."""
        return (*self.said(), *_no_effect(self.config))

    @property
    def too_late(self) -> Callable[[], float] | None:
        """Asks for the bound, for who asks several backends; None where ``portfolio.bound`` is off."""
        if not self.config.section("portfolio").bound:
            return None
        return partial(too_late, self, self.config.bound)

    @property
    def hopeless(self) -> Quick:
        """Says of a t_rep whether a moment proves that nothing is feasible there; one for each search."""
        return Quick(self)


def prepare(scene: Scene, config: Config, reference: Any = None) -> Prepared:
    """Occupancy, reference, checker and conflict of a scene.

    Parameters
    ----------
    scene : Scene
    config : Config
    reference : optional
        A reference from memory, instead of what ``reference.source`` names; see
        :func:`repair.reference.given.given_reference`. A text is the name of a source, or a file.

    Returns
    -------
    Prepared

    Raises
    ------
    RepairError
        If no reference can be had.
    """
    if not isinstance(scene, Scene):
        raise ScenarioError(f"a scene is expected (repair.load_scene), not {kind_of(scene)}")
    if not isinstance(config, Config):
        raise ConfigError(f"config has to come from repair.load_config, and is {kind_of(config)}")
    require_types(config)
    config = agreed_with(config, scene)
    phases = Phases()
    given = None
    if isinstance(reference, str | Path):
        config, reference = with_named(config, str(reference)), None
    if reference is not None:
        config, given = with_given(config), given_reference(reference, scene)
    track = track_along(scene, config.reference) if given is None else given.track
    if track is not None:
        scene = reframe(scene, track.positions, track.heading)
        chosen = config.reference.obstacle_id
        if chosen is not None and SOURCES[config.reference.source].becomes_ego:
            scene = as_ego(scene, chosen)
    return laid_out(scene, config, given, phases)


def what_matters(config: Config) -> dict[str, Any]:
    """The part of a configuration that a preparation depends on.

    Where it is the same, so is what is prepared. Everything that is not known to be asked later counts.
    """
    return {key: value for key, value in config.to_dict().items() if key not in _ASKED_LATER | {*sections()}}


def again_for(prepared: Prepared, config: Config) -> Prepared:
    """What is prepared, for another backend, search or metrics: as :func:`prepare` would make it again.

    Nothing that a search has kept is handed on, so that each search begins alike.

    Raises
    ------
    ConfigError
        If the configurations differ in what matters.
    """
    require_types(config)
    before, config = prepared.config, agreed_with(config, prepared.scene)
    if what_matters(before) != what_matters(config):
        raise ConfigError("what is prepared was prepared with other settings; prepare it again")
    return replace(prepared, config=config)


def among(prepared: Prepared, obstacles: tuple[Obstacle, ...]) -> Prepared:
    """The same road, ego and reference among other traffic."""
    scene = replace(prepared.scene, obstacles=obstacles)
    reference, like = prepared.reference, prepared.checker
    return laid_out(scene, prepared.config, prepared.given, Phases(), reference=reference, like=like)


def laid_out(
    scene: Scene,
    config: Config,
    given: GivenReference | None,
    phases: Phases,
    *,
    reference: Curve | None = None,
    like: Checker | None = None,
    within_reach: bool = False,
) -> Prepared:
    """What is searched, in a frame that stays as it is.

    Parameters
    ----------
    given : GivenReference or None
        The reference from memory; without it, and without ``reference``, that of the configuration is made.
    phases : Phases
    reference : Curve, optional
        A reference that there is already.
    like : Checker, optional
        One for the same road, whose edge is taken over.
    within_reach : bool
        Obstacles out of the ego's reach until the repairs end are left without boxes.
    """
    vehicle = scene.vehicle
    room = config.checker.clearance + _BODY_MARGIN
    s_offset, l_offset = config.scene.s_offset, config.scene.l_offset
    s_offset = vehicle.half_length + room if s_offset is None else s_offset
    l_offset = vehicle.half_width + room if l_offset is None else l_offset
    limits = resolve_limits(config.limits, vehicle, float(scene.start[1, 0]), scene.dt)
    with phases("checker"):
        allowed = [reference_limits(limits, config.limits, vehicle, accepted=told) for told in (False, True)]
        checker = Checker(scene, limits, sampled(config.checker, scene.dt), allowed[0], like)
        touching = checker.touching_at_start()
    offsets = s_offset, l_offset

    def all_boxes(until: float = np.inf) -> Boxes:
        part = partial(_part_in_reach, scene, config, limits, given, reference, until)
        return Boxes(partial(_boxes, scene, offsets, part if within_reach else None))

    whole = all_boxes()
    if not within_reach:
        with phases("occupancy"):
            whole.occupancy  # noqa: B018 - to be known by that name in the times
    with phases("reference"):
        if reference is not None:
            followed = reference
        elif given is not None:
            followed = given.curve(scene)
        else:
            known, _ = shrink_to_start(whole.occupancy, scene.start[0], touching, offsets)
            followed = make_reference(scene, config.reference, known)
    t_reference = min(scene.horizon, followed.t_end)
    places = followed.sample(np.arange(steps_until(t_reference, scene.dt) + 1) * scene.dt).position
    boxes = whole.left_of(places, touching, offsets)
    more: tuple[str, ...] = ()
    with phases("conflict"):
        conflict, verdict = detect_conflict(followed, boxes, checker, t_reference)
        recording = None
        if reference is None or _JUDGED & set(verdict.reasons):
            recording = recording_of(scene, config.reference) if given is None else given.recording
        if recording is not None and recording.refused is not None and _JUDGED & set(verdict.reasons):
            checker.take_word(recording.refused(), allowed[1])
            conflict, again = detect_conflict(followed, boxes, checker, t_reference)
            if Reason.KINEMATICS.value in set(verdict.reasons) - set(again.reasons):
                more = (_accepted(recording, vehicle),)
    wanted = config.repair.horizon
    if wanted is None:
        wanted = conflict.time + config.repair.after_conflict
    elif np.isfinite(conflict.time) and wanted <= conflict.time:
        raise ConfigError(
            f"repair.horizon is {wanted:g} s, but the conflict is at {conflict.time:g} s: "
            "a repair has to reach beyond it"
        )
    logging.getLogger(__name__).info("%s: conflict %s at %g s", scene.id, conflict.kind, conflict.time)
    t_end = max(on_grid(min(wanted, t_reference), scene.dt), min(scene.dt, t_reference))
    if within_reach and not whole.known:
        # Control points act a little after the end as well; what is later than that, nobody asks.
        until = t_end + 0.5 * config.repair.degree * config.repair.spacing
        boxes = all_boxes(until).left_of(places, touching, offsets)
    return Prepared(
        scene=scene,
        settings=config.repair,
        limits=limits,
        boxes=boxes,
        reference=followed,
        checker=checker,
        conflict=conflict,
        t_reference=t_reference,
        t_end=float(t_end),
        said=partial(_said, scene, config, checker, places, recording, followed, boxes, more, wanted),
        config=config,
        phases=phases.seconds,
        given=given,
    )


def _part_in_reach(
    scene: Scene, config: Config, limits: Limits, given: GivenReference | None, followed: Curve | None,
    until: float,
) -> Within | None:  # fmt: skip
    """The part of the road where the ego may be until a time [s]; None where nobody knows."""
    places, known = (None, None) if given is None else (given.positions, given.within(scene.frame))
    if followed is not None:
        known = followed.sample(scene.times).position
        places = scene.frame.to_cartesian(*known.T)
    return None if places is None else part_in_reach(scene, config.repair, limits, places, until, known)


def _boxes(
    scene: Scene, offsets: tuple[float, float], within: Callable[[], Within | None] | None
) -> tuple[Occupancy, tuple[str, ...]]:
    """The traffic as boxes, and who is not seen by them."""
    return build_occupancy(scene.obstacles, scene.frame, scene.dt, *offsets, within and within())


def _said(
    scene: Scene, config: Config, checker: Checker, places: Array, recording: Recording | None,
    followed: Curve, boxes: Boxes, more: tuple[str, ...], wanted: float,
) -> tuple[str, ...]:  # fmt: skip
    """What had to be assumed, for whoever asks."""
    t_reference = min(scene.horizon, followed.t_end)
    said = [*_bridged(checker, places), *reference_notes(scene, followed, recording), *boxes.notes, *more]
    if config.repair.horizon is not None and wanted > t_reference + INSTANT:
        said.append(
            f"repair.horizon is {wanted:g} s, but what is known ends at {t_reference:g} s, "
            "and so do the repairs"
        )
    return (*scene.notes, *said)


def _accepted(recording: Recording, vehicle: Vehicle) -> str:
    """That a reference is drivable for its own model only."""
    driven = f"{vehicle.name or 'the vehicle'} of the kinematic single-track model"
    return (
        f"the reference is accepted by CommonRoad's checker for the model {recording.model}; {driven}, for "
        "which solutions are written, cannot drive it everywhere"
    )


def _bridged(checker: Checker, places: Array) -> list[str]:
    """Gaps and holes of the map that count as road and that the reference drives over.

    Parameters
    ----------
    places : (K, 2) array
        ``[s, l]`` of the reference at the scenario's steps.
    """
    if checker.road is None or not np.isfinite(places).all() or not checker.road.bridged():
        return []
    import shapely

    driven = shapely.LineString(checker.scene.frame.to_cartesian(*places.T))
    found = [str(one) for one in checker.road.bridged(driven.buffer(checker.scene.vehicle.half_width))]
    if endless(checker.scene.scenario.lanelet_network):
        found.append(
            "lanelets of this map are each other's neighbours in a ring: it has no lane sections, and "
            "CommonRoad's own boundary check is not asked"
        )
    return found


def _no_effect(config: Config) -> list[str]:
    """Settings that were made on purpose and change nothing here."""
    return [f"{key} has no effect with {other}={value}" for key, other, value in config.without_effect()]
