"""The pure data of a result: what ``result.json`` holds, and what the figures show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from repair.arrays import Array, in_seconds

__all__ = ["Body", "Box", "Drawing", "Line", "Outcome"]


@dataclass(frozen=True)
class Line:
    """One driven curve, sampled.

    Attributes
    ----------
    kind : str
        ``reference``; ``repair``, of a visited time-to-repair; ``stage``, on the way to it; ``continuation``,
        the stop after the repair; ``onward``, what is driven after it; ``mitigation``, what hits least hard
        where there is no repair, until then.
    name : str
        Of the stage; of a continuation how safe that end is; else empty.
    t_rep : float or None
        Where it leaves the reference [s].
    t, s, l, x, y, speed, acceleration : (K,) array
        SI units; speed and acceleration are those of the vehicle's centre, along its path.
    """

    kind: str
    name: str
    t_rep: float | None
    t: Array
    s: Array
    l: Array  # noqa: E741
    x: Array
    y: Array
    speed: Array
    acceleration: Array


@dataclass(frozen=True)
class Box:
    """An obstacle where it is in the way: the s it takes, margin included, while it covers the reference's l.

    Attributes
    ----------
    id : int
    t : (T,) array
        Times [s].
    low, high : (T,) array
        Ends along s [m]; NaN where it is not in the way.
    """

    id: int
    t: Array
    low: Array
    high: Array


@dataclass(frozen=True)
class Body:
    """One of the others, seen from above.

    Attributes
    ----------
    id : int
    role : str
        ``static``, ``dynamic``, ``set_based``, ``phantom`` or ``environment``.
    centres : (T, 2) array
        Where its middle is at the steps until the end [m]; NaN where it is not there.
    outlines : mapping
        Step to outline (V, 2) [m], at the steps that are shown.
    """

    id: int
    role: str
    centres: Array
    outlines: Mapping[int, Array]


@dataclass(frozen=True)
class Drawing:
    """What the figures show beside the record.

    Attributes
    ----------
    start_s : float
        s of the ego at t = 0 [m].
    s_offset : float
        Share of a box' length that is margin, at either end [m].
    until : float
        End of the time axis [s].
    steps : tuple of int
        Steps at which vehicles are shown, that of the conflict first.
    body : (4, 2) array
        Corners of the ego, seen from its middle [m].
    ego : (T, 3) array
        x, y, orientation of what is driven, at the scenario's steps.
    unrepaired : (3,) array or None
        The same of the reference at the step of the conflict, where it is repaired.
    lines : tuple of Line
        The reference first.
    boxes : tuple of Box
    bodies : tuple of Body
    areas, edges : tuple of (V, 2) arrays
        Lanelets and their bounds [m].
    """

    start_s: float
    s_offset: float
    until: float
    steps: tuple[int, ...]
    body: Array
    ego: Array
    unrepaired: Array | None
    lines: tuple[Line, ...]
    boxes: tuple[Box, ...]
    bodies: tuple[Body, ...]
    areas: tuple[Array, ...]
    edges: tuple[Array, ...]


@dataclass(frozen=True, repr=False)
class Outcome:
    """A result without the vehicle, the solver and the scene that made it.

    Every figure, table and page is made from it, whether it comes from a search just done or from a
    folder (:func:`repair.load_result`).

    Attributes
    ----------
    record : dict
        What ``result.json`` holds: plain values, figures with their units in the keys.
    drawing : Drawing or None
        What the figures show beside it; None where the folder has none.
    """

    record: dict[str, Any]
    drawing: Drawing | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        return (
            f"<Outcome of {self.scenario}, {self.backend}: {self.status}, TTC {in_seconds(self.ttc)}, "
            f"F-TTR {in_seconds(self.f_ttr)}>"
        )

    @property
    def scenario(self) -> str:
        """The benchmark id."""
        return str(self.record["scenario"])

    @property
    def backend(self) -> str:
        """Who made the repair."""
        return str(self.record["backend"])

    @property
    def status(self) -> str:
        """How the search ended: ``found``, ``no_conflict``, ..."""
        return str(self.record["status"])

    def driven(self) -> dict[str, Any]:
        """What is driven at each step: ``t`` [s], ``x``, ``y`` [m], ``yaw`` [rad], ``v`` [m/s]."""
        names = {"t": "t_s", "x": "x_m", "y": "y_m", "yaw": "orientation_rad", "v": "speed_mps"}
        return {name: self.record["trajectory"][key] for name, key in names.items()}

    @property
    def ttc(self) -> float:
        """Time-To-Collision [s], inf without a conflict."""
        value = self.record["ttc_s"]
        return float("inf") if value is None else float(value)

    @property
    def f_ttr(self) -> float | None:
        """Feasible Time-To-React [s]; inf without a conflict, None where nothing was verified."""
        if self.status == "no_conflict":
            return float("inf")
        value = self.record["f_ttr_s"]
        return None if value is None else float(value)

    @property
    def probes(self) -> list[dict[str, Any]]:
        """The visited times-to-repair, as the record has them."""
        return list(self.record["probes"])

    @property
    def metrics(self) -> dict[str, float | None]:
        """The metrics that were asked for; None where one is infinite (its status says why)."""
        found = self.record.get("metrics") or {}
        return {
            name: next((v for key, v in one.items() if key.startswith("value_")), None)
            for name, one in found.items()
        }
