"""What a program registers is taken back when it is done with."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from repair.check.registry import CHECKS
from repair.metrics.registry import METRICS
from repair.reference.registry import SOURCES
from repair.save import FORMATS
from repair.search.rules import RULES
from repair.simulate.policies.registry import POLICIES
from repair.simulate.predictions.registry import PREDICTIONS
from repair.solvers.registry import BACKENDS
from repair.vehicle.model import VEHICLES

REGISTRIES = (BACKENDS, CHECKS, FORMATS, METRICS, POLICIES, PREDICTIONS, RULES, SOURCES, VEHICLES)


@contextmanager
def nothing_left() -> Iterator[None]:
    """Within it things may be registered; afterwards the registries hold what they held before."""
    before = [registry.names() for registry in REGISTRIES]
    try:
        yield
    finally:
        for registry, names in zip(REGISTRIES, before, strict=True):
            for name in set(registry.names()) - set(names):
                registry.unregister(name)
