"""From a search to its outcome."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from repair.backend.base import Capabilities
from repair.bounds.latest import Bound
from repair.check.peaks import Peaks
from repair.metrics.base import MetricValue
from repair.mitigation.mitigate import Mitigation
from repair.onward.plan import Onward
from repair.outcome.data import Outcome
from repair.outcome.draw import drawing_of
from repair.outcome.record import record_of
from repair.preparation import Prepared
from repair.search.modes import ModeResult
from repair.search.result import SearchResult
from repair.terminal.verdict import Terminal
from repair.vehicle.states import DrivenStates
from repair.why.explain import Explanation

__all__ = ["outcome_of"]


def outcome_of(
    prepared: Prepared,
    found: SearchResult,
    states: DrivenStates,
    peaks: Peaks | None,
    phases: Mapping[str, float],
    metrics: Mapping[str, MetricValue],
    capabilities: Capabilities,
    modes: Sequence[ModeResult] = (),
    bounds: Mapping[str, Bound] | None = None,
    terminal: Terminal | None = None,
    onward: Onward | None = None,
    explanation: Explanation | None = None,
    mitigation: Mitigation | None = None,
) -> Outcome:
    """Everything that outlives a search; see :func:`repair.outcome.record.record_of` for the parameters."""
    record = record_of(
        prepared, found, states, peaks, phases, metrics, capabilities, modes, bounds, terminal, onward,
        explanation, mitigation,
    )  # fmt: skip
    return Outcome(record, drawing_of(prepared, found, states, terminal, onward, mitigation))
