"""Why there is no repair, or no later one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from repair.backend.base import RepairBackend
from repair.config.schema import Config
from repair.errors import RepairError, kind_of
from repair.preparation import Prepared
from repair.search.result import SearchResult, SearchStatus
from repair.search.settings import ExplainConfig
from repair.situation import require_situation
from repair.solvers.registry import fallbacks_of, make_backend
from repair.timegrid import INSTANT
from repair.why.asked import Asked, Cut
from repair.why.kinds import KINDS
from repair.why.least import Relaxation, smallest
from repair.why.obstacles import Blocking, blocking

__all__ = ["Explanation", "explain", "explained_time"]

_ORACLE = "shooting"
_SET = 0.4  # share of the time that the set of obstacles may take
_EACH = 1.25  # times its share of the time that is left for each kind
_CHANGED = 3  # obstacles that are changed, at most


@dataclass(frozen=True)
class Explanation:
    """Why there is no repair at a time-to-repair, and with what else there would be one.

    Attributes
    ----------
    t_rep : float
        [s]: the first that was tried where nothing is feasible, else the first infeasible one after the
        F-TTR.
    asked : tuple of str
        The backends that find nothing there: what is said below is about them.
    exists_by : str or None
        Another backend that does find a repair there: then it is not the situation that decides.
    proven : bool
        Whether it is proven that there is none (for what the checker calls feasible).
    blocking : Blocking or None
        Obstacles that suffice; None where the time was up before.
    relaxations : tuple of Relaxation
    not_tried : tuple of str
        Kinds for which no time was left.
    tests : int
        Situations that were looked at.
    seconds : float
        Processor time [s].
    """

    t_rep: float
    asked: tuple[str, ...]
    exists_by: str | None
    proven: bool
    blocking: Blocking | None = None
    relaxations: tuple[Relaxation, ...] = ()
    not_tried: tuple[str, ...] = ()
    tests: int = 0
    seconds: float = 0.0

    @property
    def complete(self) -> bool:
        """Whether the time was enough."""
        minimal = self.blocking is not None and self.blocking.minimal
        return not self.not_tried and (minimal or not self.asked)

    @property
    def decides(self) -> tuple[str, ...]:
        """The kinds with which there would be a repair; ``backend`` where another one finds one as it is."""
        kinds = (one.kind for one in self.relaxations if one.sufficient)
        backend = ("backend",) if self.exists_by is not None else ()
        return (*backend, *dict.fromkeys("obstacle" if KINDS[k].of_obstacle else k for k in kinds))


def explained_time(found: SearchResult) -> float | None:
    """The time-to-repair that there is something to explain about [s]; None where there is none."""
    probes = [p.t_rep for p in found.probes if not p.feasible]
    if found.status in (SearchStatus.NONE_FEASIBLE, SearchStatus.UNAVOIDABLE):
        return min(probes, default=0.0)
    if found.status is not SearchStatus.FOUND or found.f_ttr is None:
        return None
    return min((t for t in probes if t > found.f_ttr + INSTANT), default=None)


def explain(
    prepared: Prepared,
    found: SearchResult,
    settings: ExplainConfig | None = None,
    *,
    on_progress: Callable[[str], None] | None = None,
) -> Explanation | None:
    """Why there is no repair, or no later one: what is in the way, and the least that would help.

    Parameters
    ----------
    prepared : Prepared
        What :func:`repair.prepare` returns.
    found : SearchResult or RepairResult
        What came of it.
    settings : ExplainConfig, optional
        Those of the configuration by default.
    on_progress : callable, optional
        Called with what is looked at next, in words.

    Raises
    ------
    RepairError
        If one of the two is something else.

    Returns
    -------
    Explanation or None
        None where there is nothing to explain: no conflict, a contact at the very start, or a repair at the
        last time-to-repair that was tried.

    Notes
    -----
    An amount is the smallest for which a repair was found that passes the checker under that assumption,
    to the resolution of its kind, and with half of it none was found by those who were asked.
    """
    require_situation(prepared)
    found = getattr(found, "search", found)
    if not isinstance(found, SearchResult):
        raise RepairError(f"what a search of it found is expected, or a result, not {kind_of(found)}")
    settings = settings or prepared.config.explain
    t_rep = explained_time(found)
    if t_rep is None or not math.isfinite(prepared.conflict.time):
        return None
    return _Explained(prepared, t_rep, settings, on_progress or (lambda words: None)).explanation()


def _backends(config: Config) -> dict[str, RepairBackend]:
    """Who is asked, by name: the cheap ones first, and the members of one that is made of several."""
    made = make_backend(config.backend, config)
    members = made.capabilities.members
    chosen = {config.backend: made} if members is None else dict(members())
    cheap = dict.fromkeys((*fallbacks_of(config.backend, config), _ORACLE))
    first = {name: make_backend(name, config) for name in cheap if name not in chosen}
    return {**first, **{name: chosen.pop(name) for name in cheap if name in chosen}, **chosen}


class _Explained:
    """The parts, one after the other, as far as the time goes."""

    def __init__(
        self, prepared: Prepared, t_rep: float, settings: ExplainConfig, tell: Callable[[str], None]
    ) -> None:
        self.prepared, self.settings, self.tell = prepared, settings, tell
        self.asked = Asked(t_rep, _backends(prepared.config), settings.time_limit)

    def explanation(self) -> Explanation:
        """All that is found out in time."""
        asked = self.asked
        self.tell("whether there is a repair as it is")
        try:
            proof = asked.proof(self.prepared)
            exists = self._others() if proof is None else None
        except Cut:
            return self._told(None, False, None, (), tuple(self.settings.kinds))
        asked.proves = exists is None  # where there is a repair there are no proofs
        if not asked.backends:
            return self._told(exists, False, None, (), ())
        self.tell("which obstacles are in the way")
        asked.spare()
        with asked.within(_SET):
            blocks = blocking(self.prepared, asked, proof)
        found, late = self._relaxations(blocks)
        return self._told(exists, proof is not None, blocks, tuple(found), tuple(late))

    def _others(self) -> str | None:
        """Who finds a repair as it is, and is not asked any more."""
        exists = None
        for name, backend in list(self.asked.backends.items()):
            found = self.asked.by(name, backend, self.prepared)
            if found is not None:
                exists = exists or found.by
                self.asked.drop(name)
        return exists

    def _relaxations(self, blocks: Blocking) -> tuple[list[Relaxation], list[str]]:
        """What suffices, kind by kind, and the kinds that were not tried."""
        found: list[Relaxation] = []
        late: list[str] = []
        helps: set[int] = set()  # who has to be there for there being no repair
        wanted = [kind for kind in KINDS if kind in self.settings.kinds]
        for number, name in enumerate(wanted):
            kind = KINDS[name]
            places: list[int | None] = [None]
            if kind.of_obstacle:
                places = [one.index for one in blocks.obstacles[:_CHANGED]]
                if "removed" in self.settings.kinds and name != "removed":
                    places = [k for k in places if k in helps]
            for index in places:
                self.tell(f"{name}" + ("" if index is None else f" of an obstacle ({index})"))
                with self.asked.within(_EACH / (len(wanted) - number)):
                    one = smallest(self.prepared, self.asked, name, index)
                if one.status == "cut":
                    late += [name] if name not in late else []
                    continue
                if name == "removed" and one.sufficient and index is not None:
                    helps.add(index)
                found.append(one)
        return found, late

    def _told(
        self,
        exists: str | None,
        proven: bool,
        blocks: Blocking | None,
        found: tuple[Relaxation, ...],
        late: tuple[str, ...],
    ) -> Explanation:
        asked = self.asked
        return Explanation(
            asked.t_rep, tuple(asked.backends), exists, proven, blocks, found, late, asked.tests, asked.spent
        )
