"""Metrics by name (``metrics: [ttr, ...]``)."""

from __future__ import annotations

from collections.abc import Sequence

from repair.errors import ConfigError, foreign
from repair.metrics.base import Asked, Metric, MetricValue
from repair.registry import Registry, called, loaded

__all__ = ["METRICS", "measure", "register"]

METRICS: Registry[Metric | str] = Registry(
    "metric",
    {
        "ttb": "repair.metrics.evasive:ttb",
        "ttk": "repair.metrics.evasive:ttk",
        "tts": "repair.metrics.evasive:tts",
        "ttr": "repair.metrics.evasive:ttr",
    },
    error=ConfigError,
    group="repair.metrics",
    admit=called,
)


def register(name: str, metric: Metric) -> None:
    """Add a metric of your own for this process; ``metrics: [name]`` asks for it.

    Parameters
    ----------
    name : str
    metric : callable
        A function of what is asked about to a value and a word on it: :data:`Metric`.

    Raises
    ------
    ConfigError
        If the name is taken.
    """
    METRICS.register(name, metric)


def measure(names: Sequence[str], asked: Asked) -> dict[str, MetricValue]:
    """The metrics of these names, in their order.

    Raises
    ------
    ConfigError
        If a metric raises, or gives something else than a :class:`MetricValue`.
    """
    found: dict[str, MetricValue] = {}
    for name in names:
        with foreign(f"metric {name!r}", ConfigError):
            value = loaded(METRICS[name])(asked)
        if not isinstance(value, MetricValue):
            raise ConfigError(f"metric {name!r} gave {type(value).__name__}; it has to give a MetricValue")
        found[name] = value
    return found
