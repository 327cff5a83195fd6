"""The door for planners that ask every cycle: what does not change is built once."""

from __future__ import annotations

from repair.cycle.cycle import Cycle
from repair.cycle.repairer import Repairer

__all__ = ["Cycle", "Repairer"]
