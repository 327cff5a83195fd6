"""Policies by name (``repair simulate --policy NAME``)."""

from __future__ import annotations

from collections.abc import Callable

from repair.config.simulate import SimulateConfig
from repair.errors import ConfigError, foreign
from repair.registry import Registry, called, loaded
from repair.simulate.policies.base import Policy
from repair.simulate.policies.sudden import AtOnce, BelowTtc, Brake, Never
from repair.simulate.policies.waiting import AtFttr, Graded

__all__ = ["POLICIES", "make_policy", "register"]

#: Makes a policy for one drive from the section ``simulate``.
MakePolicy = Callable[[SimulateConfig], Policy]

POLICIES: Registry[MakePolicy | str] = Registry(
    "policy",
    {
        "f_ttr": lambda _: AtFttr(),
        "at_once": lambda _: AtOnce(),
        "ttc": lambda config: BelowTtc(config.ttc),
        "brake": lambda _: Brake(),
        "graded": lambda _: Graded(),
        "never": lambda _: Never(),
    },
    error=ConfigError,
    group="repair.policies",
    admit=called,
)


def register(name: str, make: MakePolicy) -> None:
    """Add a policy of your own for this process.

    Parameters
    ----------
    name : str
    make : callable
        From the section ``simulate`` of the configuration to a :class:`Policy`.

    Raises
    ------
    ConfigError
        If the name is taken.
    """
    POLICIES.register(name, make)


def make_policy(name: str, config: SimulateConfig) -> Policy:
    """The policy of that name, for one drive.

    Raises
    ------
    ConfigError
        If there is none, or it cannot be made.
    """
    made = loaded(POLICIES[name])
    with foreign(f"policy {name!r}", ConfigError):
        return made(config)
