"""What is asked of a file, and what is found out about it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

__all__ = ["BACKENDS", "REFERENCES", "Deviation", "Examined", "Row", "Settings"]

BACKENDS = ("ego", "casadi", "qptr")
REFERENCES = ("constant", "accelerate", "planner")


@dataclass(frozen=True)
class Settings:
    """What is asked of each file; ``base``: the folder that names are shown from."""

    backends: tuple[str, ...] = BACKENDS
    references: tuple[str, ...] = REFERENCES
    invariance: bool = True
    base: Path = Path()
    overrides: tuple[str, ...] = ()


@dataclass(frozen=True)
class Deviation:
    """Something that is not as it should be; ``told``: listed, and no violation by itself."""

    file: str
    backend: str
    reference: str
    kind: str
    reason: str
    told: bool = False


@dataclass(frozen=True)
class Row:
    """What one search answered; ``verified``: a repair that everything here accepts."""

    backend: str
    reference: str
    status: str
    ttc: float
    contact: float
    f_ttr: float | None
    verified: bool = False
    why: str = ""


@dataclass
class Examined:
    """All about one file."""

    file: str
    rows: list[Row] = field(default_factory=list)
    deviations: list[Deviation] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    refused: str = ""

    def says(
        self, kind: str, reason: str, backend: str = "", reference: str = "", told: bool = False
    ) -> None:
        """Note a deviation."""
        self.deviations.append(Deviation(self.file, backend, reference, kind, reason, told))
