"""Backends by name; a module is imported when its backend is asked for.

A fourth backend is one module and one line here (or :func:`register` from outside).
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from repair.backend.base import RepairBackend
from repair.config import Config
from repair.errors import BackendError

__all__ = ["available", "backend_names", "make_backend", "register"]

#: name -> (module, factory in it, packages it needs, one line for people)
_BACKENDS: dict[str, tuple[str, str, tuple[str, ...], str]] = {
    "ego": (
        "repair.solvers.ego.backend",
        "make",
        ("scipy",),
        "soft penalties on a uniform B-spline, deformation and refinement (the paper)",
    ),
    "casadi": (
        "repair.solvers.casadi.backend",
        "make",
        ("casadi",),
        "the same spline as an NLP with hard convex-hull constraints (IPOPT or SQP)",
    ),
    "qptr": (
        "repair.baselines.qptr.backend",
        "make",
        ("qpsolvers",),
        "Bernstein QP in a convex driving corridor (baseline)",
    ),
}
_EXTRA: dict[str, Callable[[Config], RepairBackend]] = {}


def register(name: str, factory: Callable[[Config], RepairBackend]) -> None:
    """Add a backend of your own for this process; ``factory(config)`` makes it."""
    _EXTRA[name] = factory


def backend_names() -> tuple[str, ...]:
    """All names that :func:`make_backend` knows."""
    return (*_BACKENDS, *_EXTRA)


def available() -> dict[str, str | None]:
    """For each backend, None if it can be made, else the sentence that says what is missing."""
    state: dict[str, str | None] = dict.fromkeys(_EXTRA)
    for name, (module, _, packages, _) in _BACKENDS.items():
        state[name] = None
        for needed in (*packages, module):
            try:
                import_module(needed)
            except ImportError as error:
                state[name] = f"{needed} cannot be imported: {error}"
                break
    return state


def describe(name: str) -> str:
    """One line about a backend."""
    return _BACKENDS[name][3] if name in _BACKENDS else "registered by the program"


def make_backend(name: str, config: Config) -> RepairBackend:
    """Make a backend from its section of the configuration.

    Raises
    ------
    BackendError
        If the name is unknown, or what it needs is not installed (the sentence names it).
    """
    if name in _EXTRA:
        return _EXTRA[name](config)
    if name not in _BACKENDS:
        raise BackendError(f"backend {name!r} is unknown; there are {', '.join(backend_names())}")
    module, factory, packages, _ = _BACKENDS[name]
    for needed in packages:
        try:
            import_module(needed)
        except ImportError as error:
            raise BackendError(f"backend {name!r} needs the package {needed}: {error}") from error
    return getattr(import_module(module), factory)(config)  # type: ignore[no-any-return]
