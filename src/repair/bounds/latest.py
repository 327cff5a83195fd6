"""The bound: the earliest time to react that is proven too late."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.arrays import Array
from repair.bounds.edges import no_road
from repair.bounds.motion import Motions
from repair.bounds.obstacles import Occupied, occupied, with_standing
from repair.bounds.settings import BoundConfig
from repair.bounds.start import driven_within, motions_from
from repair.bounds.tree import Attempt, attempt
from repair.deadline import in_time
from repair.situation import require_situation
from repair.timegrid import STEP, steps_until
from repair.vehicle.model import KinematicSingleTrack

if TYPE_CHECKING:
    from repair.situation import Situation

__all__ = ["Bound", "Proof", "Quick", "bound", "proof_at", "too_late"]

_AROUND = 40.0  # where the edge of the road is looked at [m]
_DENSE, _FINE, _COARSE = 0.3, 0.025, 0.05  # instants: how long they are dense, and how far apart they are [s]
_FEW = 5  # parts of a quick proof: most have one, and what proves nothing takes them all


@dataclass(frozen=True)
class Proof:
    """What proves that it is too late at a time.

    Attributes
    ----------
    time : float
        Of the reaction [s].
    motions : Motions
    instants : (I,) array
        Since the reaction [s].
    attempt : Attempt
        With the tree, and the forbidden places to which it refers.
    obstacles : list of int
        The ids of the obstacles of these places; -1 for what is no road.
    """

    time: float
    motions: Motions
    instants: Array
    attempt: Attempt
    obstacles: list[int]


@dataclass(frozen=True)
class Bound:
    """From when on it is too late.

    Attributes
    ----------
    kind : str
        For whom (:data:`repair.bounds.settings.KINDS`).
    time : float
        t_bound [s]: at this time and later, no motion avoids what the kind counts. Infinite where nothing
        was proven before the conflict.
    status : str
        ``proven``, or why there is no proof: ``open`` (a relaxed motion meets nothing), ``nodes``,
        ``time``, ``reference`` (the reference breaks the assumptions itself), ``no_conflict``,
        ``limits_off``, ``model`` (the vehicle is no kinematic single-track model).
    complete : bool
        Whether earlier times were tried until one was not proven too late for another reason than time.
    nodes : int
        Of all attempts.
    seconds : float
        Processor time [s].
    proof : Proof or None
    """

    kind: str
    time: float
    status: str
    complete: bool = True
    nodes: int = 0
    seconds: float = 0.0
    proof: Proof | None = field(default=None, repr=False)

    @property
    def proven(self) -> bool:
        """Whether there is a proof before the conflict."""
        return self.proof is not None


def bound(situation: Situation, settings: BoundConfig | None = None) -> dict[str, Bound]:
    """Prove from when on it is too late to react.

    Parameters
    ----------
    situation : Situation
        What :func:`repair.prepare` returns.
    settings : BoundConfig, optional
        Those of the configuration by default.

    Returns
    -------
    dict
        A :class:`Bound` for each of ``settings.kinds``.

    Raises
    ------
    ScenarioError
        If it is no situation.
    """
    require_situation(situation)
    if settings is None:
        config: Any = getattr(situation, "config", None)
        settings = config.bound if config is not None else BoundConfig()
    conflict = situation.conflict.time
    if not math.isfinite(conflict) or situation.conflict.contact_time <= 0.0:
        return {kind: Bound(kind, math.inf, "no_conflict") for kind in settings.kinds}
    world = _World(situation, settings)
    return {kind: _bound(kind, world, settings) for kind in settings.kinds}


def too_late(situation: Situation, settings: BoundConfig) -> float:
    """From when on the checker calls nothing feasible any more [s]; infinite where that is not proven."""
    return bound(situation, replace(settings, kinds=["search"]))["search"].time


def proof_at(situation: Situation, t_rep: float, settings: BoundConfig, kind: str = "search") -> Proof | None:
    """A proof that it is too late at one time to react; None where there is none.

    Parameters
    ----------
    situation : Situation
    t_rep : float
        [s]; the proof is about the last sample of the reference at or before it, and holds later too.
    settings : BoundConfig
        ``nodes`` and ``time_limit`` count, and how finely the bound is looked for does not.
    kind : str
        For whom (:data:`repair.bounds.settings.KINDS`).
    """
    if not _provable(situation, kind) or not t_rep < situation.conflict.time < math.inf:
        return None
    world, begin = _World(situation, settings), time.thread_time()

    def late() -> bool:
        return time.thread_time() - begin > settings.time_limit

    return _proof(kind, world, world.sample(t_rep), settings.nodes, late)[1]


def _provable(situation: Situation, kind: str) -> bool:
    """Whether there are proofs at all: limits that are claimed, and a vehicle whose motions are bounded."""
    claimed = kind == "vehicle" or situation.checker.config.limits
    return claimed and isinstance(situation.scene.model, KinematicSingleTrack)


class Quick:
    """Whether it is proven too late at a time, for a search that would rather not look there for long.

    Only small proofs are looked for: an answer of no says nothing. What was asked is remembered; each search
    has one of its own, so that no answer or time hangs on what was searched before.

    Parameters
    ----------
    situation : Situation
    """

    def __init__(self, situation: Situation) -> None:
        self._situation = situation
        self._world: _World | None = None
        self._since, self._open = math.inf, -math.inf  # proven from here on; asked in vain until there

    def __call__(self, t_rep: float) -> bool:
        """Whether the checker would call nothing feasible that begins at ``t_rep`` [s] or later.

        Raises
        ------
        OutOfTime
            If the deadline passes.
        """
        if t_rep >= self._since:
            return True
        if t_rep <= self._open or not t_rep < self._situation.conflict.time < math.inf:
            return False  # who reacts earlier can do more
        if not _provable(self._situation, "search"):
            return False
        in_time()
        self._world = self._world or _World(self._situation, BoundConfig())
        if _proof("search", self._world, self._world.sample(t_rep), _FEW, _in_time)[1] is None:
            self._open = t_rep
            return False
        self._since = t_rep
        return True

    def since(self, times: Sequence[float]) -> float:
        """From which of some ascending times [s] on it is proven, as far as it is cheap to say.

        The latest are asked first, in growing strides, until one is not proven: that one takes longest.

        Raises
        ------
        OutOfTime
            If the deadline passes.
        """
        k, stride = len(times) - 1, 1
        while k >= 0 and self(times[k]):
            k, stride = k - stride, 2 * stride
        return min((t for t in times if t >= self._since), default=math.inf)


def _in_time() -> bool:
    in_time()
    return False


class _World:
    """What is the same for all times to react."""

    def __init__(self, situation: Situation, settings: BoundConfig) -> None:
        scene, checker = situation.scene, situation.checker
        self.situation, self.scene, self.checker = situation, scene, checker
        self.substeps = checker.config.substeps
        self.h = scene.dt / self.substeps
        self.states = checker.drive(situation.reference, situation.t_reference)
        contact = situation.conflict.contact_time
        last = max(situation.conflict.time, contact if math.isfinite(contact) else 0.0) + settings.after
        self.stop = min(steps_until(min(last, situation.t_end), self.h), scene.n_steps * self.substeps) + 1
        self.end = min(steps_until(situation.conflict.time, self.h), len(self.states) - 1)
        self.stride = max(1, round(settings.step / self.h))
        self.road = settings.road
        start = scene.initial_state
        near = checker.world.met_at(0, complex(start.x, start.y), start.orientation, checker.config.clearance)
        count = scene.n_steps * self.substeps + 1
        self.whole = occupied(scene.obstacles, count, self.substeps)
        # the margin of who is beside the ego at the start does not count until it has been left
        self.counted = ~np.isin(self.whole.owner, list(near)) if near else None
        self._known: dict[str, Occupied] = {}

    def sample(self, t_rep: float) -> int:
        """The last sample of the reference at or before a time [s]."""
        return max(math.floor(t_rep / self.h + STEP), 0)

    def shapes(self, kind: str) -> Occupied:
        """What is met, for a kind of motions."""
        if kind not in self._known:
            traffic = self.whole
            if kind == "search" and self.counted is not None:
                traffic = Occupied(traffic.vertices[:, self.counted], traffic.owner[self.counted])
            self._known[kind] = with_standing(traffic, self._no_road(kind))
        return self._known[kind]

    def _no_road(self, kind: str) -> list[Array]:
        """Convex pieces of what is no road, around where the conflict is."""
        if not self.road or self.checker.road is None:
            return []
        k = max(self.end, 0)
        margin = math.sqrt(2.0) * self.checker.config.clearance if kind == "search" else 0.0
        lanelets = self.scene.scenario.lanelet_network.lanelets
        centre = np.array([self.states.x[k], self.states.y[k]])
        return no_road(self.checker.road.region, lanelets, centre, _AROUND, margin)

    def instants(self, k: int) -> Array:
        """Samples that are looked at after a reaction at a sample, which is the first of them."""
        dense = max(1, round(_FINE / self.h))
        coarse = max(1, round(_COARSE / self.h))
        turn = k + dense * max(1, round(_DENSE / (dense * self.h)))
        near = np.arange(k, min(turn, self.stop - 1) + 1, dense)
        far = np.arange(near[-1] + coarse, self.stop, coarse)
        return np.concatenate((near, far))


def _bound(kind: str, world: _World, settings: BoundConfig) -> Bound:
    if kind == "search" and not world.checker.config.limits:
        return Bound(kind, math.inf, "limits_off")
    if not isinstance(world.scene.model, KinematicSingleTrack):
        return Bound(kind, math.inf, "model")
    begin = time.thread_time()
    nodes, found, why, cut = 0, None, "open", False

    def late() -> bool:
        return time.thread_time() - begin > settings.time_limit

    def proves(j: int) -> bool:
        nonlocal nodes, found, why, cut
        made, proof = _proof(kind, world, j * world.stride, settings.nodes, late)
        nodes += made.nodes
        if proof is None:
            cut = cut or late()
            why = (
                "reference"
                if not made.nodes
                else "time"
                if late()
                else "nodes"
                if made.open is None
                else "open"
            )
            return False
        found = proof
        return True

    earliest(max((world.end - 1) // world.stride, 0), proves)
    spent = time.thread_time() - begin
    if found is None:
        return Bound(kind, math.inf, why, not cut, nodes, spent)
    return Bound(kind, found.time, "proven", not cut, nodes, spent, found)


def earliest(last: int, proves: Callable[[int], bool]) -> int | None:
    """The first of 0 .. ``last`` at which something is proven, as it then is later too; None if nowhere."""
    good, bad, stride, k = last + 1, -1, 1, last
    while k > bad:
        if not proves(k):
            bad = k
            break
        good, stride = k, 2 * stride
        k = max(good - stride, 0) if good else -1
    while good - bad > 1:
        middle = (good + bad) // 2
        if proves(middle):
            good = middle
        else:
            bad = middle
    return good if good <= last else None


def _proof(
    kind: str, world: _World, k: int, limit: int, late: Callable[[], bool]
) -> tuple[Attempt, Proof | None]:
    """An attempt at a sample of the reference, and the proof if it is one."""
    situation = world.situation
    vehicle = world.scene.vehicle
    motions = motions_from(world.states, k, kind, vehicle, situation.limits, world.checker.config)
    samples = world.instants(k)
    if len(samples) < 2 or not driven_within(world.states, k, world.end, kind, vehicle, motions.acceleration):
        return Attempt(False), None
    shapes = world.shapes(kind)
    times = (samples - k) * world.h
    made = attempt(motions, times, shapes.vertices[samples], limit, late)
    if not made.proven:
        return made, None
    owners = [int(shapes.owner[c.column]) for c in made.cuts]
    ids = [world.scene.obstacles[o].id if o >= 0 else -1 for o in owners]
    return made, Proof(k * world.h, motions, times, made, ids)
