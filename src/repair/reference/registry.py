"""Reference trajectories by the name of their source (``reference.source``)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from repair.arrays import Array
from repair.curves.base import Curve
from repair.errors import ConfigError, ReferenceTrajectoryError, foreign
from repair.reference.base import Along, MakeReference, ReferenceSource
from repair.registry import Registry, loaded
from repair.timegrid import INSTANT

if TYPE_CHECKING:
    from repair.reference.settings import ReferenceConfig
    from repair.scene.scene import Scene
    from repair.world.boxes import Occupancy

__all__ = ["SOURCES", "make_reference", "positions_along", "reference_notes", "register"]

_SPEED_OFF = 0.05  # a start this much faster or slower than the planning problem's is said [m/s]

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
            "repair.reference.recorded:solution_positions",
            says="a CommonRoad solution file, reference.file",
        ),
        "given": ReferenceSource(
            "repair.reference.given:no_given_reference",
            says="from memory, the argument reference= of repair.repair",
        ),
    },
    error=ConfigError,
    group="repair.references",
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


def positions_along(scene: Scene, config: ReferenceConfig) -> Array | None:
    """The positions along which the scene's frame has to run; None where it runs along the route.

    Raises
    ------
    ReferenceTrajectoryError
        If the source has none; the sentence says what is missing.
    """
    along: Along | str | None = SOURCES[config.source].along
    with foreign(f"reference source {config.source!r}", ReferenceTrajectoryError):
        return None if along is None else loaded(along)(scene, config)


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


def reference_notes(scene: Scene, curve: Curve) -> tuple[str, ...]:
    """What has to be said about a reference: until when it is known, and a start unlike the ego's."""
    notes = []
    own, given = float(curve.sample([curve.t_start]).velocity[0, 0]), float(scene.start[1, 0])
    if abs(own - given) > _SPEED_OFF:
        notes.append(f"the reference starts with {own:.2f} m/s, the planning problem with {given:.2f} m/s")
    if curve.t_end < scene.horizon - INSTANT:
        notes.append(
            f"the reference ends at {curve.t_end:g} s, and so does what is said about it "
            f"(the scenario goes on until {scene.horizon:g} s)"
        )
    return tuple(notes)
