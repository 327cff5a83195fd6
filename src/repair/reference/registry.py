"""Reference trajectories by the name of their source (``reference.source``)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.curves.base import Curve
from repair.errors import ConfigError, ReferenceTrajectoryError, foreign, in_words
from repair.reference.base import Along, AsRecorded, MakeReference, ReferenceSource, Track
from repair.reference.fit import deviation
from repair.reference.recorded import known_until
from repair.registry import Registry, called, loaded
from repair.timegrid import INSTANT

if TYPE_CHECKING:
    from repair.reference.consistency import Recording
    from repair.reference.settings import ReferenceConfig
    from repair.scene.scene import Scene
    from repair.world.boxes import Occupancy

__all__ = [
    "SOURCES",
    "make_reference",
    "named",
    "names",
    "recording_of",
    "reference_notes",
    "register",
    "track_along",
]

_FOLLOWED = (1e-3, 1e-2, 2e-3)  # what is followed to within less than this is followed [m], [m/s], [rad]
_SPEED_OFF = 0.05  # a start this much faster or slower than the planning problem's is said [m/s]


def _admitted(thing: Any) -> ReferenceSource:
    """What an installed package offers: a source, or what makes its curve."""
    return thing if isinstance(thing, ReferenceSource) else ReferenceSource(called(thing))


SOURCES: Registry[ReferenceSource] = Registry(
    "reference source",
    {
        "planner": ReferenceSource(
            "repair.reference.planner:plan_speed", says="speeds by graph search along the route"
        ),
        "constant": ReferenceSource("repair.reference.blind:constant_speed", says="the initial speed, held"),
        "accelerate": ReferenceSource(
            "repair.reference.blind:accelerating", says="1 m/s² up to the speed limit or 13.9 m/s"
        ),
        "recorded": ReferenceSource(
            "repair.reference.recorded:recorded_reference",
            "repair.reference.recorded:obstacle_positions",
            becomes_ego=True,
            says="an obstacle's trajectory, reference.obstacle_id",
        ),
        "file": ReferenceSource(
            "repair.reference.recorded:solution_reference",
            "repair.reference.recorded:solution_track",
            "repair.reference.recorded:solution_recording",
            says="a CommonRoad solution file, reference.file",
        ),
        "given": ReferenceSource(
            "repair.reference.given:no_given_reference",
            says="from memory, the argument reference= of repair.repair",
        ),
    },
    error=ConfigError,
    group="repair.references",
    admit=_admitted,
)


def register(name: str, source: ReferenceSource | MakeReference) -> None:
    """Add a source of references of your own for this process; ``reference.source: name`` asks for it.

    Parameters
    ----------
    name : str
    source : ReferenceSource or callable
        A callable alone is :attr:`ReferenceSource.make`.

    Raises
    ------
    ConfigError
        If the name is taken.
    """
    SOURCES.register(name, source if isinstance(source, ReferenceSource) else ReferenceSource(source))


def names() -> tuple[str, ...]:
    """The sources of references that need no file."""
    return tuple(name for name in SOURCES.names() if name != "file")


def named(text: str) -> dict[str, str]:
    """The keys of the section ``reference`` that a word stands for: a source, or a CommonRoad solution file.

    Raises
    ------
    ConfigError
        If it is neither.
    """
    known = names()
    if text in known:
        return {"source": text}
    try:
        there = Path(text).is_file()
    except (OSError, ValueError):  # a name that is too long, or none
        there = False
    if not there:
        raise ConfigError(f"reference {in_words(text)} is neither one of {', '.join(known)} nor a file")
    return {"source": "file", "file": Path(text).resolve().as_posix()}


def track_along(scene: Scene, config: ReferenceConfig) -> Track | None:
    """Where the scene's frame has to run; None where it runs along the route.

    Raises
    ------
    ReferenceTrajectoryError
        If the source has none; the sentence says what is missing.
    """
    along: Along | str | None = SOURCES[config.source].along
    with foreign(f"reference source {config.source!r}", ReferenceTrajectoryError):
        found = None if along is None else loaded(along)(scene, config)
    if found is None or isinstance(found, Track):
        return found
    return Track(found[: known_until(found)])


def recording_of(scene: Scene, config: ReferenceConfig) -> Recording | None:
    """The states that the reference is made from; None where it is not made from states.

    Raises
    ------
    ReferenceTrajectoryError
        If the source has none; the sentence says what is missing.
    """
    recording: AsRecorded | str | None = SOURCES[config.source].recording
    with foreign(f"reference source {config.source!r}", ReferenceTrajectoryError):
        return None if recording is None else loaded(recording)(scene, config)


def make_reference(scene: Scene, config: ReferenceConfig, occupancy: Occupancy) -> Curve:
    """The reference trajectory over [0, scene.horizon] in the scene's frame.

    Parameters
    ----------
    occupancy : Occupancy
        Inflated obstacles; only ``awareness: constant_velocity`` looks at it, and only at t = 0.

    Raises
    ------
    ReferenceTrajectoryError
        If the source has no usable trajectory; the sentence says what is missing.
    """
    with foreign(f"reference source {config.source!r}", ReferenceTrajectoryError):
        curve = loaded(SOURCES[config.source].make)(scene, config, occupancy)
    if not isinstance(curve, Curve):
        raise ReferenceTrajectoryError(
            f"reference source {config.source!r} gave {type(curve).__name__}; it has to give a curve "
            "with t_start, t_end and sample(t)"
        )
    return curve


def reference_notes(scene: Scene, curve: Curve, recording: Recording | None = None) -> tuple[str, ...]:
    """What has to be said about a reference: until when it is known, and where it is not what was given.

    Parameters
    ----------
    scene : Scene
    curve : Curve
    recording : Recording, optional
        What it was made from.
    """
    notes = []
    own, given = float(curve.sample([curve.t_start]).velocity[0, 0]), float(scene.start[1, 0])
    if abs(own - given) > _SPEED_OFF:
        notes.append(f"the reference starts with {own:.2f} m/s, the planning problem with {given:.2f} m/s")
    if curve.t_end < scene.horizon - INSTANT:
        notes.append(
            f"the reference ends at {curve.t_end:g} s, and so does what is said about it "
            f"(the scenario goes on until {scene.horizon:g} s)"
        )
    if recording is not None:
        off = deviation(scene, recording, curve)
        if any(np.greater(off, _FOLLOWED)):
            notes.append(
                f"the reference is followed to within {off[0]:.2g} m, {off[1]:.2g} m/s and {off[2]:.2g} rad"
            )
    return tuple(notes)
