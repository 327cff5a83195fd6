"""Things by name: those of the package, those that a program registers, those of installed packages."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from importlib import import_module
from typing import Any, Generic, TypeVar

from repair.errors import RepairError, kind_of

__all__ = ["Part", "Registry", "adopt", "called", "loaded", "registered"]

T = TypeVar("T")

#: What a program registered: module and attribute of the registry, the name, and the thing.
Part = tuple[str, str, str, Any]


class Registry(Generic[T]):
    """A table from names to things of one kind.

    Parameters
    ----------
    kind : str
        What the things are, for sentences: ``backend``.
    own : mapping
        The things of the package.
    error : type
        The :class:`repair.RepairError` that is raised about names.
    group : str, optional
        Entry-point group in which installed packages offer more of them. An entry point that cannot be
        loaded is kept with its reason, and is an error only for who asks for it.
    admit : callable, optional
        Makes a thing of what an entry point names; what it raises is the reason why that is none.
    """

    def __init__(
        self,
        kind: str,
        own: Mapping[str, T],
        *,
        error: type[RepairError] = RepairError,
        group: str | None = None,
        admit: Callable[[Any], T] | None = None,
    ) -> None:
        self.kind, self.error, self.group, self._admit = kind, error, group, admit
        self._own = dict(own)
        self._registered: dict[str, T] = {}
        self._offered: dict[str, T] | None = None
        self._broken: dict[str, str] = {}
        self._reserved: dict[str, str] = {}

    def reserve(self, names: Iterable[str], why: str) -> None:
        """Names that nothing from outside of the package may have, and the reason.

        What an installed package offers under one of them is an error only for who asks for it.
        """
        self._reserved |= dict.fromkeys(names, why)
        self._offered = None  # some of it may have been let in

    def register(self, name: str, thing: T) -> None:
        """Add a thing for this process.

        Raises
        ------
        RepairError
            If the name is taken or reserved, or is no identifier.
        """
        if not isinstance(name, str) or not name.isidentifier():
            raise self.error(f"a {self.kind} needs a name that is an identifier, not {name!r}")
        if name in self._reserved:
            raise self.error(f"a {self.kind} cannot have the name {name!r}: {self._reserved[name]}")
        if name in self._everything():
            raise self.error(f"there is a {self.kind} {name!r} already; register yours under another name")
        self._registered[name] = thing

    def unregister(self, name: str) -> None:
        """Take back what :meth:`register` added; nothing happens where it did not."""
        self._registered.pop(name, None)

    def names(self) -> tuple[str, ...]:
        """All names, those of the package first; installed ones that cannot be loaded are not among them."""
        return tuple(self._everything())

    def broken(self) -> dict[str, str]:
        """Names that installed packages offer in vain, each with the reason."""
        self._everything()
        return dict(self._broken)

    def items(self) -> tuple[tuple[str, T], ...]:
        """Names and things."""
        return tuple(self._everything().items())

    def __contains__(self, name: object) -> bool:
        return name in self._everything()

    def __getitem__(self, name: str) -> T:
        """The thing of that name.

        Raises
        ------
        RepairError
            If there is none; the sentence lists those that there are.
        """
        known = self._everything()
        if name in known:
            return known[name]
        if name in self._broken:
            raise self.error(
                f"{self.kind} {name!r} of an installed package cannot be loaded: {self._broken[name]}"
            )
        raise self.error(f"{self.kind} {name!r} is unknown; there are {', '.join(known)}")

    def _everything(self) -> dict[str, T]:
        if self._offered is None:
            self._broken.clear()
            self._offered = self._load() if self.group else {}
        return {**self._own, **self._offered, **self._registered}

    def _load(self) -> dict[str, T]:
        found: dict[str, T] = {}
        for name, point in sorted(_entry_points().get(self.group or "", {}).items()):
            taken = f"the package has a {self.kind} of that name itself" if name in self._own else None
            if why := taken or self._reserved.get(name):
                self._broken[name] = why
                continue
            try:
                thing = point.load()
                found[name] = thing if self._admit is None else self._admit(thing)
            except RepairError as error:
                self._broken[name] = str(error)
            except Exception as error:  # whatever a foreign package raises on import
                self._broken[name] = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
        return found


def called(thing: Any) -> Any:
    """A thing of an installed package that is called: a function, or a class.

    Raises
    ------
    RepairError
        If it cannot be.
    """
    if not callable(thing):
        raise RepairError(f"it is {kind_of(thing)}, which cannot be called")
    return thing


def loaded(thing: str | T) -> T:
    """A thing, or what a ``"module:name"`` names: imported when it is needed."""
    if not isinstance(thing, str):
        return thing
    module, _, name = thing.partition(":")
    found: T = getattr(import_module(module), name)
    return found


def registered() -> list[Part]:
    """What this program has registered in any of the package's registries, as :func:`adopt` takes it."""
    found: dict[int, list[Part]] = {}
    for home, module in list(sys.modules.items()):
        if not home.startswith("repair."):
            continue
        for attribute, registry in list(vars(module).items()):
            if isinstance(registry, Registry):  # several modules may have it; one is enough
                parts = [(home, attribute, *part) for part in registry._registered.items()]
                found.setdefault(id(registry), parts)
    return [part for parts in found.values() for part in parts]


def adopt(parts: Iterable[Part]) -> None:
    """Register, in this process, what another one has; what is there already stays."""
    for home, attribute, name, thing in parts:
        registry: Registry[Any] = getattr(import_module(home), attribute)
        if name not in registry:
            registry.register(name, thing)


@lru_cache(maxsize=1)
def _entry_points() -> dict[str, dict[str, Any]]:
    """Entry points of all ``repair.*`` groups, by group and name; looked up once in a process."""
    from importlib.metadata import entry_points

    found: dict[str, dict[str, Any]] = {}
    for group in (g for g in entry_points().groups if g.startswith("repair.")):
        for point in entry_points(group=group):
            found.setdefault(group, {}).setdefault(point.name, point)
    return found
