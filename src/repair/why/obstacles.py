"""Which obstacles suffice for there being no repair, and from when to when."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from repair.bounds.latest import Proof
from repair.preparation import Prepared
from repair.timegrid import steps_until
from repair.why.asked import Asked, Cut
from repair.why.kinds import among
from repair.why.moved import only_between

__all__ = ["Blocker", "Blocking", "blocking", "minimal", "shortest"]


@dataclass(frozen=True)
class Blocker:
    """One obstacle of a set that suffices: its id, its index in the scene, and when it is in the way [s].

    ``since`` and ``until`` are None where that was not found out.
    """

    id: int
    index: int
    since: float | None = None
    until: float | None = None


@dataclass(frozen=True)
class Blocking:
    """Obstacles that suffice for there being no repair.

    Attributes
    ----------
    obstacles : tuple of Blocker
        Empty where the reference, the limits and the road leave none by themselves.
    proven : bool
        Whether a proof says so; else nobody who was asked finds a repair among these.
    minimal : bool
        Whether without any one of them it is not so. False where the time was up before.
    road : bool
        Whether the proof needs the edge of the road.
    """

    obstacles: tuple[Blocker, ...]
    proven: bool
    minimal: bool
    road: bool = False


def minimal(blocked: Callable[[Sequence[int]], bool], items: Sequence[int]) -> list[int]:
    """A subset that still blocks, and does not without any one of its members.

    Halving first (Junker, *QuickXplain*, AAAI 2004), then one deletion after the other, because what is
    found by search need not be monotone.

    Parameters
    ----------
    blocked : callable
        Whether some items block; the whole of them does.
    items : sequence of int
        Those that are likely to matter first.
    """
    if blocked([]):
        return []

    def part(base: list[int], new: bool, rest: list[int]) -> list[int]:
        if new and blocked(base):
            return []
        if len(rest) == 1:
            return rest
        first, second = rest[: len(rest) // 2], rest[len(rest) // 2 :]
        of_second = part(base + first, True, second)
        return part(base + of_second, bool(of_second), first) + of_second

    kept = part([], False, list(items)) if items else []
    if not blocked(kept):
        kept = list(items)
    for one in list(kept):
        less = [other for other in kept if other != one]
        if blocked(less):
            kept = less
    return kept


def blocking(prepared: Prepared, asked: Asked, proof: Proof | None) -> Blocking:
    """A minimal set of obstacles, with what each of them does.

    Parameters
    ----------
    prepared : Prepared
    asked : Asked
    proof : Proof or None
        That there is no repair. With one, obstacles are left out as long as there still is a proof; without,
        as long as nobody finds a repair.
    """
    scene = prepared.scene

    def blocked(some: Sequence[int]) -> bool:
        situation = among(prepared, tuple(scene.obstacles[k] for k in sorted(some)))
        if proof is not None:
            return asked.proof(situation) is not None
        return asked.repair(situation, proofs=False) is None

    likely = _likely(prepared, proof)
    conflict = prepared.conflict.obstacle_id
    named = [k for k in likely if scene.obstacles[k].id == conflict]
    try:
        kept = minimal(blocked, named if named and blocked(named) else likely)
    except Cut:
        return Blocking(tuple(_blocker(prepared, k) for k in named), proof is not None, False)
    return _with_times(prepared, asked, kept, proof is not None)


def _likely(prepared: Prepared, proof: Proof | None) -> list[int]:
    """All obstacles, those that the proof counts first, and then by how near the reference comes to them."""
    states, n = prepared.checker.drive(prepared.reference, prepared.t_end), prepared.checker.config.substeps
    ego = np.stack((states.x[::n], states.y[::n]), axis=1)
    counted = set() if proof is None else set(proof.obstacles)
    rank = []
    for k, one in enumerate(prepared.scene.obstacles):
        way = one.states[: len(ego), :2] - ego[: len(one.states)]
        away = np.hypot(way[:, 0], way[:, 1])
        near = float(np.nanmin(away)) if np.isfinite(away).any() else np.inf
        rank.append((one.id not in counted, near, k))
    return [k for *_, k in sorted(rank)]


def _blocker(prepared: Prepared, k: int, since: float | None = None, until: float | None = None) -> Blocker:
    return Blocker(prepared.scene.obstacles[k].id, k, since, until)


def _with_times(prepared: Prepared, asked: Asked, kept: list[int], proven: bool) -> Blocking:
    """From when to when each of them is in the way."""
    obstacles = tuple(prepared.scene.obstacles[k] for k in sorted(kept))
    found: list[Blocker] = []
    road = False
    try:
        proof = asked.proof(among(prepared, obstacles)) if proven else None
        if proof is not None:
            times = _used(proof)
            road = -1 in times
            spans = {k: times.get(prepared.scene.obstacles[k].id) for k in kept}
            found = [
                _blocker(prepared, k) if span is None else _blocker(prepared, k, *span)
                for k, span in spans.items()
            ]
        else:
            found = [_blocker(prepared, k, *span) for k, span in _spans(prepared, asked, kept).items()]
    except Cut:
        found = [_blocker(prepared, k) for k in kept]
    return Blocking(tuple(found), proven, True, road)


def _used(proof: Proof) -> dict[int, tuple[float, float]]:
    """When each obstacle is counted by a proof [s], by id; -1 is what is no road."""
    used: dict[int, list[float]] = {}
    for cut in _cuts(proof.attempt.tree or {}):
        at = proof.time + float(proof.instants[proof.attempt.cuts[cut].instant])
        used.setdefault(proof.obstacles[cut], []).append(at)
    return {name: (min(times), max(times)) for name, times in used.items()}


def _cuts(node: dict[str, Any]) -> set[int]:
    """The forbidden places that a tree refers to."""
    found = {int(row[1]) for row in node.get("close", ()) if row[0] == "place"}
    if "cut" in node:
        found.add(int(node["cut"]))
    for child in node.get("children", ()):
        found |= _cuts(child)
    return found


def _spans(
    prepared: Prepared, asked: Asked, kept: Sequence[int]
) -> dict[int, tuple[float | None, float | None]]:
    """The shortest while for each obstacle in which all of them, there at no other time, leave no repair [s].

    One after the other: those before are there in their while alone, those after all the time. Where the time
    is up, the rest have none.
    """
    dt, obstacles = prepared.scene.dt, prepared.scene.obstacles
    last = min(steps_until(prepared.t_end, dt) + 1, prepared.scene.n_steps)
    steps = dict.fromkeys(kept, (0, last))
    found: dict[int, tuple[float | None, float | None]] = dict.fromkeys(kept, (None, None))

    def blocked(k: int, a: int, b: int) -> bool:
        there = {**steps, k: (a, b)}
        some = tuple(only_between(obstacles[i], *there[i]) for i in sorted(there))
        return asked.repair(among(prepared, some), proofs=False) is None

    try:
        for k in kept:
            steps[k] = shortest(partial(blocked, k), last)
            found[k] = steps[k][0] * dt, steps[k][1] * dt
    except Cut:
        pass
    return found


def shortest(blocked: Callable[[int, int], bool], last: int) -> tuple[int, int]:
    """First and last step of a while that still blocks, by halving.

    Parameters
    ----------
    blocked : callable
        Whether it blocks from a step to another one; from 0 to ``last`` it does.
    last : int
    """
    low, high = 0, last + 1  # it still blocks from ``low`` on, and not from ``high`` on
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if blocked(middle, last) else (low, middle)
    first = low
    low, high = first - 1, last
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if blocked(first, middle) else (middle, high)
    return first, high
