"""The boxes of a situation, laid out when somebody first looks at them."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

from repair.world.boxes import Occupancy

__all__ = ["Boxes"]


class Boxes:
    """Obstacles as boxes, and what had to be assumed about them; a check of true shapes needs neither.

    Parameters
    ----------
    make : callable
        Gives both; called once.
    """

    def __init__(self, make: Callable[[], tuple[Occupancy, tuple[str, ...]]]) -> None:
        self._make = make

    @cached_property
    def _made(self) -> tuple[Occupancy, tuple[str, ...]]:
        return self._make()

    @property
    def occupancy(self) -> Occupancy:
        """The obstacles, inflated."""
        return self._made[0]

    @property
    def notes(self) -> tuple[str, ...]:
        """What had to be assumed."""
        return self._made[1]
