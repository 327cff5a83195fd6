"""Backends by name; a module is imported when its backend is asked for.

A further backend is one module and one line here, or :func:`register` from outside, or an entry point of
an installed package: group ``repair.backends``, each a :class:`repair.backend.base.BackendSpec`, or what
makes the backend where it has no section.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import is_dataclass, replace
from functools import cache
from importlib import import_module
from typing import Any

from repair.backend.base import BackendSpec, Capabilities, Configuration, RepairBackend
from repair.baselines.qptr.settings import QptrConfig
from repair.deadline import in_time
from repair.errors import BackendError, foreign, in_words
from repair.registry import Registry, called, loaded
from repair.solvers.casadi.settings import CasadiConfig
from repair.solvers.ego.settings import EgoConfig
from repair.solvers.portfolio.settings import PortfolioConfig
from repair.solvers.shooting.settings import ShootingConfig

__all__ = [
    "BACKENDS", "available", "backend_names", "describe", "fallbacks_of", "helpers_of", "make_backend",
    "register", "sections",
]  # fmt: skip

_IMPORT = 0.05  # [s] what importing a backend may take, the packages that it needs being there


def _admitted(thing: Any) -> BackendSpec:
    """What an installed package offers: a specification, or what makes the backend, without a section.

    Raises
    ------
    BackendError
        If it is neither, or its section cannot be made. Whoever asks for another backend is not to know.
    """
    if not isinstance(thing, BackendSpec):
        return BackendSpec(called(thing), None, (), "of an installed package")
    if thing.settings is not None:
        if not is_dataclass(thing.settings):
            raise BackendError(f"its settings have to be a dataclass, not {in_words(thing.settings)}")
        from omegaconf import OmegaConf

        with foreign("making its settings", BackendError):
            OmegaConf.structured(thing.settings())
    return thing


BACKENDS: Registry[BackendSpec] = Registry(
    "backend",
    {
        "ego": BackendSpec(
            "repair.solvers.ego.backend:make",
            EgoConfig,
            ("scipy",),
            "soft penalties on a uniform B-spline, deformation and refinement (the paper)",
            fallbacks=("qptr", "shooting", "casadi"),
        ),
        "casadi": BackendSpec(
            "repair.solvers.casadi.backend:make",
            CasadiConfig,
            ("casadi",),
            "the same spline as an NLP with hard convex-hull constraints (IPOPT or SQP)",
            helpers="helpers",
            usual_helpers=("ego", "shooting"),
            fallbacks=("ego", "qptr", "shooting"),
        ),
        "qptr": BackendSpec(
            "repair.baselines.qptr.backend:make",
            QptrConfig,
            ("qpsolvers",),
            "Bernstein QP in a convex driving corridor (baseline)",
            fallbacks=("ego", "shooting", "casadi"),
        ),
        "shooting": BackendSpec(
            "repair.solvers.shooting.backend:make",
            ShootingConfig,
            (),
            "controls of the single-track model drawn at random (cross-entropy), true shapes, no guide",
        ),
        "portfolio": BackendSpec(
            "repair.solvers.portfolio.backend:make",
            PortfolioConfig,
            (),
            "several of them, the cheap ones first; the latest repair is the answer",
            members="members",
        ),
    },
    error=BackendError,
    group="repair.backends",
    admit=_admitted,
)


def register(
    name: str,
    factory: Callable[[Any], RepairBackend] | BackendSpec,
    *,
    settings: type | None = None,
    says: str = "registered by the program",
) -> None:
    """Add a backend of your own for this process.

    Parameters
    ----------
    name : str
    factory : callable or BackendSpec
        ``factory(config)`` makes the backend.
    settings : type, optional
        Dataclass of its own section of the configuration; its instance is ``config.section(name)``.
    says : str
        One line for people.

    Raises
    ------
    BackendError
        If the name is taken, or the settings are no dataclass.
    """
    spec = factory if isinstance(factory, BackendSpec) else BackendSpec(factory, settings, (), says)
    if spec.settings is not None and not is_dataclass(spec.settings):
        raise BackendError(f"the settings of backend {name!r} have to be a dataclass, not {spec.settings!r}")
    BACKENDS.register(name, spec)


def backend_names() -> tuple[str, ...]:
    """All names that :func:`make_backend` knows."""
    return BACKENDS.names()


def sections() -> dict[str, type]:
    """The sections that the backends bring to the configuration, by name."""
    return {name: spec.settings for name, spec in BACKENDS.items() if spec.settings is not None}


def available() -> dict[str, str | None]:
    """For each backend, None if it can be made, else the sentence that says what is missing."""
    state: dict[str, str | None] = {name: _missing(spec) for name, spec in BACKENDS.items()}
    return {**state, **{name: f"it cannot be loaded: {why}" for name, why in BACKENDS.broken().items()}}


def _missing(spec: BackendSpec) -> str | None:
    module = spec.factory.partition(":")[0] if isinstance(spec.factory, str) else None
    for needed in (*spec.needs, *([module] if module else ())):
        try:
            import_module(needed)
        except ImportError as error:
            return f"{needed} cannot be imported: {error}"
    return None


def describe(name: str) -> str:
    """One line about a backend."""
    return BACKENDS[name].says


def make_backend(name: str, config: Configuration) -> RepairBackend:
    """Make a backend from its section of the configuration.

    Raises
    ------
    BackendError
        If the name is unknown, what it needs is not installed (the sentence names it), or what its
        factory gives is no backend.
    """
    spec = BACKENDS[name]
    for needed in spec.needs:
        try:
            import_module(needed)
        except ImportError as error:
            raise BackendError(f"backend {name!r} needs the package {needed}: {error}") from error
    made = loaded(spec.factory)(config)
    if not callable(getattr(made, "solve", None)):
        raise BackendError(f"backend {name!r}: its factory gave {type(made).__name__}, no backend")
    if not isinstance(getattr(made, "capabilities", None), Capabilities):
        raise BackendError(
            f"backend {name!r} declares no capabilities; it needs an attribute capabilities = Capabilities()"
        )
    if named := helpers_of(name, config):
        helpers = {each: _helper(each, config) for each in named}
        made.capabilities = replace(made.capabilities, helpers=helpers)
    if spec.members:
        names = getattr(config.section(name), spec.members)
        made.capabilities = replace(made.capabilities, members=_members(names, config))
    if others := fallbacks_of(name, config):
        made.capabilities = replace(made.capabilities, fallbacks=_members(others, config))
    return made


def helpers_of(name: str, config: Configuration) -> list[str]:
    """Names of the backends that are asked for a curve where this one finds nothing at a t_rep.

    Raises
    ------
    BackendError
        If it is one of them itself, or one of them is made of several.
    """
    spec = BACKENDS[name]
    if not isinstance(spec.helpers, str):
        return list(spec.helpers)
    listed = getattr(config.section(name), spec.helpers)
    named = list(dict.fromkeys(spec.usual_helpers if listed is None else listed))
    for each in named:
        if each == name or BACKENDS[each].members:
            why = "it cannot help itself" if each == name else "it is made of several backends"
            raise BackendError(f"{name}.{spec.helpers} names {each!r}: {why}")
    return named


def fallbacks_of(name: str, config: Configuration) -> list[str]:
    """Names of the backends that are asked where a search with this one ends without a repair."""
    names = BACKENDS[name].fallbacks if config.fallback is None else config.fallback
    return [each for each in names if each != name]


def _members(names: Sequence[str], config: Configuration) -> Callable[[], Mapping[str, RepairBackend]]:
    """The backends of these names, each made when it is first asked for."""
    return cache(lambda: _Made(names, config))


class _Made(Mapping[str, RepairBackend]):
    """Backends by name, each made when it is first asked for."""

    def __init__(self, names: Sequence[str], config: Configuration) -> None:
        self._names, self._config = dict.fromkeys(names), config
        self._made: dict[str, RepairBackend] = {}

    def __getitem__(self, name: str) -> RepairBackend:
        if name not in self._names:
            raise KeyError(name)
        if name not in self._made:
            self._made[name] = make_backend(name, self._config)
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


def _helper(name: str, config: Configuration) -> Callable[[], RepairBackend]:
    """Makes a backend when it is first asked for."""

    @cache
    def made() -> RepairBackend:
        factory = BACKENDS[name].factory
        if isinstance(factory, str) and factory.partition(":")[0] not in sys.modules:
            in_time(_IMPORT, f"importing the backend {name!r}")
        return make_backend(name, config)

    return made
