"""Is there a repair? Asked of a situation as it is, or as it would be."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace

from repair.backend.base import RepairBackend
from repair.bounds.latest import Proof, proof_at
from repair.preparation import Prepared
from repair.search.result import Probe, SearchStatus
from repair.search.several import search_with
from repair.timegrid import INSTANT

__all__ = ["REFERENCE", "Asked", "Cut", "Found"]

_PARTS = 100  # of a proof: what takes more mostly is none
_CLOCK = 10.0  # times the processor time that is left, at most
#: By whom a repair is found that is none: the reference itself meets nothing.
REFERENCE = "reference"


class Cut(Exception):
    """The time is up: nobody knows."""


@dataclass(frozen=True)
class Found:
    """A repair: whose it is, and the probe; None where the reference itself is free until the end."""

    by: str
    probe: Probe | None = None


class Asked:
    """Asks proofs and backends whether there is a repair at one time-to-repair.

    Parameters
    ----------
    t_rep : float
        [s].
    backends : mapping
        Who is asked, by name, in this order.
    time_limit : float
        Processor time for all that is asked [s].

    Attributes
    ----------
    tests : int
        How many situations were looked at.
    """

    def __init__(self, t_rep: float, backends: Mapping[str, RepairBackend], time_limit: float) -> None:
        self.t_rep, self.backends = t_rep, dict(backends)
        self.begin, self.limit = time.thread_time(), time_limit
        self.tests = 0
        self.proves = True

    @property
    def spent(self) -> float:
        """Processor time until now [s]."""
        return time.thread_time() - self.begin

    @contextmanager
    def within(self, share: float) -> Iterator[None]:
        """Leave a share of the time that is left to what is done inside of a ``with`` block."""
        whole = self.limit
        self.limit = self.spent + min(share, 1.0) * max(whole - self.spent, 0.0)
        try:
            yield
        finally:
            self.limit = whole

    def drop(self, name: str) -> None:
        """Do not ask a backend any more."""
        del self.backends[name]

    def spare(self) -> None:
        """Ask nobody's helpers that are asked themselves."""
        for backend in self.backends.values():
            can = backend.capabilities
            helpers = {name: made for name, made in can.helpers.items() if name not in self.backends}
            if len(helpers) < len(can.helpers):
                backend.capabilities = replace(can, helpers=helpers)

    @property
    def late(self) -> bool:
        """Whether the time is up."""
        return self.spent > self.limit

    def proof(self, situation: Prepared) -> Proof | None:
        """A proof that nothing helps from t_rep on; None where there is none.

        Raises
        ------
        Cut
            If the time is up.
        """
        if self.late:
            raise Cut
        if not self.proves or not self.t_rep < situation.conflict.time < math.inf:
            return None
        usual = situation.config.bound
        settings = replace(usual, nodes=min(usual.nodes, _PARTS))
        return proof_at(situation, self.t_rep, settings)

    def repair(self, situation: Prepared, *, proofs: bool = True) -> Found | None:
        """A repair at t_rep; None where a proof says that there is none, or nobody finds one.

        Parameters
        ----------
        proofs : bool
            Whether a proof is looked for first.

        Raises
        ------
        Cut
            If the time is up.
        """
        if self.late:
            raise Cut
        self.tests += 1
        conflict = situation.conflict
        if conflict.time > situation.t_end - INSTANT:
            return Found(REFERENCE)
        if conflict.time <= self.t_rep - INSTANT or conflict.contact_time <= 0.0:
            return None
        if proofs and self.proof(situation) is not None:
            return None
        for name, backend in self.backends.items():
            found = self.by(name, backend, situation)
            if found is not None:
                return found
        return None

    def by(self, name: str, backend: RepairBackend, situation: Prepared) -> Found | None:
        """The repair of one backend.

        Raises
        ------
        Cut
            If the time is up before it has one.
        """
        left = self.limit - self.spent
        if left <= 0.0:
            raise Cut
        # A search may take long by the clock where others use the machine; it ends by itself.
        settings = replace(situation.config.search, time_limit=_CLOCK * left, upper=None)
        found = search_with(backend, name, situation, settings, visits=(self.t_rep,))
        if found.status is SearchStatus.BUDGET_EXHAUSTED:
            raise Cut
        best = found.best
        return None if best is None else Found(best.by or name, best)
