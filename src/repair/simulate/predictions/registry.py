"""Predictions by name (``repair simulate --prediction NAME``)."""

from __future__ import annotations

from collections.abc import Callable

from repair.config.simulate import SimulateConfig
from repair.errors import ConfigError, foreign
from repair.registry import Registry, called, loaded
from repair.simulate.predictions.base import Predictor

__all__ = ["PREDICTIONS", "make_predictor", "register"]

#: Makes a predictor from the section ``simulate``.
MakePredictor = Callable[[SimulateConfig], Predictor]


def _recorded(_: SimulateConfig) -> Predictor:
    from repair.simulate.predictions.recorded import Recorded

    return Recorded()


def _constant_velocity(_: SimulateConfig) -> Predictor:
    from repair.simulate.predictions.constant_velocity import ConstantVelocity

    return ConstantVelocity()


def _constant_turn(_: SimulateConfig) -> Predictor:
    from repair.simulate.predictions.constant_turn import ConstantTurn

    return ConstantTurn()


def _lane(_: SimulateConfig) -> Predictor:
    from repair.simulate.predictions.lane import AlongLane

    return AlongLane()


def _delayed(config: SimulateConfig) -> Predictor:
    from repair.simulate.predictions.recorded import Delayed

    return Delayed(config.delay)


PREDICTIONS: Registry[MakePredictor | str] = Registry(
    "prediction",
    {
        "recorded": _recorded,
        "constant_velocity": _constant_velocity,
        "constant_turn": _constant_turn,
        "lane": _lane,
        "delayed": _delayed,
    },
    error=ConfigError,
    group="repair.predictions",
    admit=called,
)


def register(name: str, make: MakePredictor) -> None:
    """Add a prediction of your own for this process.

    Parameters
    ----------
    name : str
    make : callable
        From the section ``simulate`` of the configuration to a :class:`Predictor`.

    Raises
    ------
    ConfigError
        If the name is taken.
    """
    PREDICTIONS.register(name, make)


def make_predictor(name: str, config: SimulateConfig) -> Predictor:
    """The prediction of that name.

    Raises
    ------
    ConfigError
        If there is none, or it cannot be made.
    """
    made = loaded(PREDICTIONS[name])
    with foreign(f"prediction {name!r}", ConfigError):
        return made(config)
