"""The schema of the configuration: common keys, and the sections that the registered backends bring."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields, make_dataclass
from functools import lru_cache, reduce
from typing import Any

from repair.baselines.evasive.settings import EvasiveConfig
from repair.bounds.settings import BoundConfig
from repair.check.registry import CHECKS
from repair.check.settings import CheckerConfig
from repair.config.simulate import SimulateConfig
from repair.errors import BackendError, ConfigError, in_words
from repair.metrics.registry import METRICS
from repair.mitigation.settings import MitigationConfig
from repair.problem.settings import LimitsConfig, RepairConfig
from repair.reference.registry import SOURCES
from repair.reference.settings import ReferenceConfig
from repair.registry import Registry
from repair.scene.settings import SceneConfig
from repair.search.rules import RULES
from repair.search.settings import ExplainConfig, SearchConfig
from repair.settings import Key, keys_of, require_type, setting
from repair.solvers.registry import BACKENDS, backend_names, fallbacks_of, helpers_of, sections

__all__ = [
    "Config", "configuration_keys", "key_names", "require_types", "schema", "values_of", "wanted_beside",
    "words_of",
]  # fmt: skip

_REGISTRIES: Mapping[str, Registry[Any]] = {r.kind: r for r in (BACKENDS, CHECKS, METRICS, RULES, SOURCES)}
_BESIDE = ("metrics", "bound.wanted", "explain.wanted", "mitigation.wanted", "repair.goal", "repair.rejoin")


@dataclass
class Config:
    """Everything that can be set; every registered backend has a section of its own beside these.

    ``repair config --table`` lists each key with its default, range and meaning, those of the sections too.
    """

    scenario: str | None = setting(None, "what `repair run` takes where none is named")
    driver: str = setting(
        "f_ttr",
        "f_ttr: the search over the time-to-repair; at_ttr: one repair at the TTR (the paper's baseline)",
        choices=("f_ttr", "at_ttr"),
    )
    backend: str = setting("ego", "ego, casadi, qptr, shooting, portfolio, or one that is registered")
    fallback: list[str] | None = setting(
        None,
        "backends that are asked, in this order, where the search ends without a repair; the result says "
        "whose it is; null: for ego, qptr and casadi each other and shooting, the cheap ones first",
        registry="backend",
        only_with=("driver", ("f_ttr",)),
    )
    metrics: list[str] = setting(
        factory=list, says="metrics of the reference that the result is to hold", registry="metric"
    )
    search: SearchConfig = field(default_factory=SearchConfig)
    scene: SceneConfig = field(default_factory=SceneConfig)
    reference: ReferenceConfig = field(default_factory=ReferenceConfig)
    limits: LimitsConfig = field(default_factory=LimitsConfig)
    repair: RepairConfig = field(default_factory=RepairConfig)
    evasive: EvasiveConfig = field(default_factory=EvasiveConfig)
    checker: CheckerConfig = field(default_factory=CheckerConfig)
    bound: BoundConfig = field(default_factory=BoundConfig)
    explain: ExplainConfig = field(default_factory=ExplainConfig)
    mitigation: MitigationConfig = field(default_factory=MitigationConfig)
    simulate: SimulateConfig = field(default_factory=SimulateConfig)
    for_backend: dict[str, Any] = setting(
        factory=dict, says="keys that count where a backend is used, by its name"
    )

    # The keys that were set on purpose; no part of the configuration, so no field.
    given = frozenset[str]()

    def section(self, name: str) -> Any:
        """The section of the backend ``name``; its defaults where the configuration was made without it.

        Raises
        ------
        BackendError
            If the backend has no section.
        """
        known = sections()
        if name not in known:
            raise BackendError(f"backend {name!r} has no settings of its own")
        return getattr(self, name, None) or known[name]()

    def to_dict(self) -> dict[str, Any]:
        """All keys as plain values, in the order of :func:`configuration_keys`."""
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        plain = asdict(self)
        return {name: plain[name] for name in _order(values)}

    def without_effect(self) -> Iterator[tuple[str, str, str]]:
        """Keys that were set on purpose and change nothing: the key, the key that decides, its value."""
        values = values_of(self)
        for key in _keys():
            needed = key.setting.only_with
            if key.name.startswith("bound.") and key.name != "bound.kinds" and self._proves():
                continue
            if key.name in self.given and needed is not None and values[needed[0]] not in needed[1]:
                yield key.name, needed[0], str(values[needed[0]])
        for key in _keys():
            owner = key.name.split(".", 1)[0]
            if key.name in self.given and owner in backend_names() and owner not in self._asked():
                yield key.name, "backend", self.backend
            if key.name in self.given and owner == "evasive" and not self.metrics and self.driver == "f_ttr":
                yield key.name, "metrics", "[]"
            if key.name in self.given and key.name == _helpers_key(owner) and not self.repair.relax:
                yield key.name, "repair.relax", "[]"
            if key.name in self.given and owner == "simulate":
                yield key.name, "command", "run"

    def _proves(self) -> bool:
        """Whether somebody asks for proofs, also of kinds that ``bound.kinds`` does not name."""
        others = "portfolio" in self._asked() and self.section("portfolio").bound
        return bool(self.bound.wanted or self.mitigation.wanted or self.explain.wanted or others)

    def _asked(self) -> set[str]:
        """Names of all backends that may have a say."""
        asked: set[str] = set()
        further = [self.backend, *(fallbacks_of(self.backend, self) if self.driver == "f_ttr" else ())]
        while further:
            name = further.pop()
            if name in asked or name not in backend_names():
                continue
            asked.add(name)
            spec = BACKENDS[name]
            further += helpers_of(name, self)
            further += getattr(self.section(name), spec.members) if spec.members else ()
        return asked

    def __new__(cls, *args: Any, **keys: Any) -> Config:
        """Made as its full type, with the sections of all backends."""
        return object.__new__(_type_of(tuple(sections().items())) if cls is Config else cls)

    def __reduce__(self) -> tuple[Any, ...]:
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        return _restored, (values, self.given)


def _helpers_key(backend: str) -> str:
    """The key that lists a backend's helpers, who see no strict problem; empty where there is none."""
    helpers = BACKENDS[backend].helpers if backend in backend_names() else ()
    return f"{backend}.{helpers}" if isinstance(helpers, str) else ""


# A section of that name would stand in its place.
BACKENDS.reserve([item.name for item in fields(Config)], "the configuration has a key of that name")


def _restored(values: dict[str, Any], given: frozenset[str]) -> Config:
    config = Config(**values)
    config.given = given
    return config


def _order(names: Iterable[str]) -> list[str]:
    """Top-level names in the order in which they are shown: the backends' before the evasive ones."""
    common = [item.name for item in fields(Config)]
    at = common.index("evasive")
    own = [name for name in names if name not in common]
    return [*common[:at], *own, *common[at:]]


def schema() -> Any:
    """The schema as OmegaConf has it."""
    return _schema_of(tuple(sections().items()))


@lru_cache(maxsize=8)
def _type_of(own: tuple[tuple[str, type], ...]) -> type[Config]:
    """The configuration's type with the sections of the backends that there are."""
    taken = {item.name for item in fields(Config)}
    for name, _ in own:
        if name in taken:
            raise BackendError(
                f"backend {name!r} cannot have a section: the configuration has a key of that name"
            )
    more = [(name, section, field(default_factory=section)) for name, section in own]
    made: type[Config] = make_dataclass("Config", more, bases=(Config,))
    return made


@lru_cache(maxsize=8)
def _schema_of(own: tuple[tuple[str, type], ...]) -> Any:
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    try:
        made = OmegaConf.structured(_type_of(own))
        for name, _ in own:
            OmegaConf.set_readonly(made[name], False)  # of a frozen dataclass: it is made, and not changed
        return made
    except (OmegaConfBaseException, ValueError, TypeError) as error:
        raise ConfigError(f"a backend's settings cannot be part of the configuration: {error}") from error


@lru_cache(maxsize=8)
def _keys_of_type(own: tuple[tuple[str, type], ...]) -> tuple[Key, ...]:
    found: dict[str, list[Key]] = {}
    for key in keys_of(_type_of(own)):
        found.setdefault(key.name.split(".", 1)[0], []).append(key)
    return tuple(key for name in _order(found) for key in found[name])


def _keys() -> tuple[Key, ...]:
    return _keys_of_type(tuple(sections().items()))


def configuration_keys() -> tuple[Key, ...]:
    """All keys, those of registered backends included, in the order in which they are shown."""
    return _keys()


def key_names() -> frozenset[str]:
    """Every key and section, for suggestions about misspelt ones."""
    parts = [key.name.split(".") for key in _keys()]
    return frozenset(".".join(p[: k + 1]) for p in parts for k in range(len(p)))


def words_of(key: Key) -> tuple[str, ...] | None:
    """The words that are possible for a key now; None where it takes no words."""
    if key.setting.registry is not None:
        return _REGISTRIES[key.setting.registry].names()
    return key.setting.choices


def values_of(config: Config) -> dict[str, Any]:
    """All values by dotted key."""
    return {key.name: reduce(getattr, key.name.split("."), config) for key in _keys()}


def wanted_beside(config: Config) -> list[str]:
    """Keys by which something is wanted beside the search, which cycles do not look at."""
    values = values_of(config)
    return [key for key in _BESIDE if values[key]]


def require_types(config: Config) -> None:
    """Refuse a configuration that was made by hand, and holds values of other types than its keys.

    Raises
    ------
    ConfigError
        Naming the key, what it got and what it expects.
    """
    for key in _keys():
        value: Any = config
        for name in key.name.split("."):
            if not hasattr(value, name):
                owner = key.name.rpartition(".")[0]
                raise ConfigError(f"configuration section {owner!r} is {in_words(value)}; it has no {name!r}")
            value = getattr(value, name)
        require_type(key, value)
