"""What a source of reference trajectories is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from repair.errors import ConfigError, in_words

if TYPE_CHECKING:
    from repair.arrays import Array
    from repair.curves.base import Curve
    from repair.reference.consistency import Recording
    from repair.reference.settings import ReferenceConfig
    from repair.scene.scene import Scene
    from repair.world.boxes import Occupancy

__all__ = ["Along", "AsRecorded", "MakeReference", "ReferenceSource", "Track"]

#: Makes the reference over [0, scene.horizon] in the scene's frame. The inflated obstacles come last.
MakeReference = Callable[["Scene", "ReferenceConfig", "Occupancy"], "Curve"]
#: Centre positions (M, 2) in the order of driving, NaN from where they are not known on; or a :class:`Track`.
Along = Callable[["Scene", "ReferenceConfig"], "Array | Track"]
#: The states that the reference is made from.
AsRecorded = Callable[["Scene", "ReferenceConfig"], "Recording"]


@dataclass(frozen=True)
class Track:
    """Where a reference leads, before there is a frame.

    Attributes
    ----------
    positions : (M, 2) array
        Of the centre, in the order of driving [m].
    heading : float or None
        Of the body at the start [rad], where it is known.
    """

    positions: Array
    heading: float | None = None


@dataclass(frozen=True)
class ReferenceSource:
    """One source of reference trajectories.

    Attributes
    ----------
    make : callable or str
        :data:`MakeReference`, or ``"module:name"`` of one.
    along : callable, str or None
        :data:`Along`, where the scene's frame has to run along the reference's own path; None where it
        runs along the route. A reference that changes lanes then has l = 0 like any other.
    recording : callable, str or None
        :data:`AsRecorded`, where the reference is a fit to states that were given.
    becomes_ego : bool
        ``reference.obstacle_id`` names an obstacle that leaves the traffic and becomes the ego.
    says : str
        One line for people.
    """

    make: MakeReference | str
    along: Along | str | None = None
    recording: AsRecorded | str | None = None
    becomes_ego: bool = False
    says: str = "registered by the program"

    def __post_init__(self) -> None:
        for name in ("make", "along", "recording"):
            value: Any = getattr(self, name)
            if not (callable(value) or isinstance(value, str) or (value is None and name != "make")):
                raise ConfigError(f"{name} of a reference source is {in_words(value)}; it has to be callable")
