"""What a source of reference trajectories is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from repair.errors import ConfigError, in_words

if TYPE_CHECKING:
    from repair.arrays import Array
    from repair.curves.base import Curve
    from repair.reference.settings import ReferenceConfig
    from repair.scene.scene import Scene
    from repair.world.boxes import Occupancy

__all__ = ["Along", "MakeReference", "ReferenceSource"]

#: Makes the reference over [0, scene.horizon] in the scene's frame. The inflated obstacles come last.
MakeReference = Callable[["Scene", "ReferenceConfig", "Occupancy"], "Curve"]
#: Centre positions (T, 2) at the scenario's steps, NaN from where they are not known on.
Along = Callable[["Scene", "ReferenceConfig"], "Array"]


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
    becomes_ego : bool
        ``reference.obstacle_id`` names an obstacle that leaves the traffic and becomes the ego.
    says : str
        One line for people.
    """

    make: MakeReference | str
    along: Along | str | None = None
    becomes_ego: bool = False
    says: str = "registered by the program"

    def __post_init__(self) -> None:
        for name in ("make", "along"):
            value: Any = getattr(self, name)
            if not (callable(value) or isinstance(value, str) or (value is None and name == "along")):
                raise ConfigError(f"{name} of a reference source is {in_words(value)}; it has to be callable")
