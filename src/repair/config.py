"""The configuration: one schema, presets, overrides. Unknown keys and wrong types are errors.

The schema is a tree of dataclasses merged by OmegaConf: defaults < preset < file < ``key=value``
overrides < the ``for_backend`` section of the chosen backend. A preset uses ``for_backend`` where a
published setting belongs to one backend only.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from functools import lru_cache, reduce
from math import isfinite
from pathlib import Path
from typing import Any

from repair.baselines.evasive.settings import EvasiveConfig
from repair.baselines.qptr.settings import QptrConfig
from repair.check.settings import CheckerConfig
from repair.errors import ConfigError
from repair.problem.settings import LimitsConfig, RepairConfig
from repair.reference.settings import ReferenceConfig
from repair.scene.settings import SceneConfig
from repair.search.settings import SearchConfig
from repair.solvers.casadi.settings import CasadiConfig
from repair.solvers.ego.settings import EgoConfig

__all__ = ["Config", "load_config", "preset_names"]

_PRESETS = Path(__file__).with_name("presets")


@dataclass
class Config:
    """Everything that can be set."""

    scenario: str | None = None  # what `repair run` takes where none is named
    driver: str = "f_ttr"  # f_ttr | at_ttr
    backend: str = "ego"  # ego | casadi | qptr, or one that is registered
    seed: int = 0
    search: SearchConfig = field(default_factory=SearchConfig)
    scene: SceneConfig = field(default_factory=SceneConfig)
    reference: ReferenceConfig = field(default_factory=ReferenceConfig)
    limits: LimitsConfig = field(default_factory=LimitsConfig)
    repair: RepairConfig = field(default_factory=RepairConfig)
    ego: EgoConfig = field(default_factory=EgoConfig)
    casadi: CasadiConfig = field(default_factory=CasadiConfig)
    qptr: QptrConfig = field(default_factory=QptrConfig)
    evasive: EvasiveConfig = field(default_factory=EvasiveConfig)
    checker: CheckerConfig = field(default_factory=CheckerConfig)
    for_backend: dict[str, Any] = field(default_factory=dict)


CHOICES: Mapping[str, tuple[str, ...]] = {
    "driver": ("f_ttr", "at_ttr"),
    "search.rule": ("bisect", "guided", "scan", "as_printed"),
    "search.sides": ("best", "first"),
    "ego.solver": ("newton", "lbfgs"),
    "scene.after_prediction": ("remove", "hold", "constant_velocity"),
    "reference.source": ("planner", "constant", "accelerate", "recorded", "file"),
    "reference.awareness": ("none", "constant_velocity"),
    "repair.lateral": ("none", "lane", "same_direction", "road"),
    "casadi.solver": ("ipopt", "sqpmethod"),
    "casadi.obstacles": ("hull", "sampled"),
    "evasive.model": ("point_mass", "kinematic"),
    "evasive.collision": ("rectangles", "boxes"),
    "checker.official": ("leftover", "always", "never"),
}

# key -> (lowest, highest) that make sense; both ends included.
RANGES: Mapping[str, tuple[float, float]] = {
    "search.delta_t": (1e-3, 1e3),
    "search.upper": (0.0, 1e3),
    "search.time_limit": (0.0, 1e6),
    "scene.horizon": (1e-3, 1e3),
    "scene.s_offset": (0.0, 100.0),
    "scene.l_offset": (0.0, 100.0),
    "repair.horizon": (1e-3, 1e3),
    "repair.after_conflict": (0.1, 1e3),
    "repair.clearance": (0.0, 50.0),
    "repair.margin": (0.0, 50.0),
    "repair.degree": (3, 5),
    "repair.spacing": (0.02, 5.0),
    "limits.v_max": (0.1, 200.0),
    "limits.v_lat": (1e-3, 100.0),
    "limits.a_min": (-100.0, -1e-3),
    "limits.a_max": (1e-3, 100.0),
    "limits.a_lat": (1e-3, 100.0),
    "limits.a_total": (1e-3, 100.0),
    "limits.j_lon": (1e-2, 1e6),
    "limits.j_lat": (1e-2, 1e6),
    "reference.a_lat": (1e-2, 50.0),
    "reference.a_min": (-50.0, -1e-2),
    "reference.a_max": (1e-2, 50.0),
    "reference.desired_speed": (0.0, 200.0),
    "reference.time_step": (0.1, 5.0),
    "reference.speed_step": (0.02, 5.0),
    "reference.progress": (0.0, 100.0),
    **{f"ego.deform.{key}": (0.0, 1e6) for key in ("smooth", "collision", "feasible")},
    **{f"ego.refine.{key}": (0.0, 1e6) for key in ("smooth", "feasible", "fit")},
    **{f"ego.{key}": (0.0, 1e6) for key in ("w_v", "w_a", "w_j", "reverse")},
    "ego.elastic": (0.1, 0.9999),
    "ego.joint": (1.0, 100.0),
    "ego.max_iterations": (1, 100_000),
    "ego.tolerance": (1e-12, 1e3),
    "ego.rebounds": (0, 20),
    "casadi.heading": (0.01, 1.4),
    "casadi.overhang": (0.0, 20.0),
    "casadi.rounds": (1, 100),
    "casadi.max_iterations": (1, 100_000),
    "casadi.tolerance": (1e-12, 1.0),
    "checker.substeps": (1, 50),
    "qptr.degree": (3, 9),
    "qptr.spacing": (0.05, 5.0),
    "qptr.continuity": (2, 3),
    "qptr.w_jerk": (1e-6, 1e6),
    "qptr.w_deviation": (0.0, 1e6),
    "evasive.a_brake": (0.1, 100.0),
    "evasive.a_kick": (0.1, 100.0),
    "evasive.a_steer": (0.1, 100.0),
    "evasive.offset_max": (0.1, 20.0),
    "evasive.offset_step": (0.05, 20.0),
}


def preset_names() -> tuple[str, ...]:
    """Names of the bundled presets."""
    return tuple(sorted(p.stem for p in _PRESETS.glob("*.yaml")))


def load_config(
    preset: str | None = None,
    file: str | Path | None = None,
    overrides: Iterable[str] | Mapping[str, Any] = (),
    **keys: Any,
) -> Config:
    """Resolve a configuration.

    Parameters
    ----------
    preset : str, optional
        Name of a bundled preset (see :func:`preset_names`).
    file : path, optional
        YAML file of the same schema.
    overrides : iterable of ``"key=value"`` or mapping of dotted keys
        Last word on everything except what ``for_backend`` says.
    **keys
        Top-level keys (``backend="casadi"``).

    Raises
    ------
    ConfigError
        Naming the key, what it got and what it expects.
    """
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    schema = _schema()
    layers: list[tuple[str, Any]] = []
    if preset is not None:
        path = _PRESETS / f"{preset}.yaml"
        if preset not in preset_names():
            raise ConfigError(f"preset {preset!r} is unknown; there are {', '.join(preset_names())}")
        layers.append((f"preset {preset}", _read_yaml(path)))
    if file is not None:
        layers.append((str(file), _read_yaml(Path(file))))
    layers.append(("overrides", _dotted(overrides)))
    layers.append(("overrides", OmegaConf.create({k: v for k, v in keys.items() if v is not None})))
    merged = schema
    own: list[Any] = []
    for name, layer in layers:
        _check_sections(name, layer, schema)
        try:
            merged = OmegaConf.merge(merged, layer)
        except (OmegaConfBaseException, ValueError, TypeError) as error:
            raise ConfigError(_explain(name, error)) from error
        own.append(layer)
    merged = _apply_backend_section(merged, own[-2:])
    return _validated(merged)


def _apply_backend_section(merged: Any, explicit: list[Any]) -> Any:
    """Lay ``for_backend.<backend>`` over the rest, and what the user said explicitly over that."""
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    section = merged.for_backend.get(merged.backend)
    merged.for_backend = {}
    if section is None:
        return merged
    name = f"for_backend.{merged.backend}"
    if not OmegaConf.is_dict(section):
        raise ConfigError(f"configuration key {name!r} is {section!r}; it must hold a mapping of keys")
    _check_sections(name, section, _schema())
    try:
        return OmegaConf.merge(merged, section, *explicit)
    except (OmegaConfBaseException, ValueError, TypeError) as error:
        raise ConfigError(_explain(name, error)) from error


@lru_cache(maxsize=1)
def _schema() -> Any:
    from omegaconf import OmegaConf

    return OmegaConf.structured(Config)


def _check_sections(layer: str, node: Any, schema: Any, prefix: str = "") -> None:
    """Refuse a plain value where the schema has a section: OmegaConf's own error does not name the key."""
    from omegaconf import DictConfig

    for key in node:
        expected = schema._get_node(key) if key in schema else None
        if isinstance(expected, DictConfig):
            value = node._get_node(key)
            if not isinstance(value, DictConfig) or value._is_none():
                shown = "empty" if value._is_none() else str(value)
                named = f"{layer}: configuration key '{prefix}{key}' is {shown}"
                raise ConfigError(f"{named}; it must hold a mapping of keys")
            if not value._is_interpolation():
                _check_sections(layer, value, expected, f"{prefix}{key}.")


def _read_yaml(path: Path) -> Any:
    from omegaconf import DictConfig, OmegaConf
    from omegaconf.errors import OmegaConfBaseException
    from yaml import YAMLError

    try:
        layer = OmegaConf.load(path)
    except FileNotFoundError as error:
        raise ConfigError(f"configuration file {path} does not exist") from error
    except (OSError, YAMLError, OmegaConfBaseException, ValueError, RecursionError) as error:
        cause = " ".join(str(error).split())[:200] or type(error).__name__
        raise ConfigError(f"configuration file {path} cannot be read: {cause}") from error
    if not isinstance(layer, DictConfig):
        raise ConfigError(f"configuration file {path} must hold a mapping of keys")
    return layer


def _dotted(overrides: Iterable[str] | Mapping[str, Any]) -> Any:
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException
    from yaml import YAMLError

    if isinstance(overrides, Mapping):
        layer = OmegaConf.create()
        for key, value in overrides.items():
            try:
                OmegaConf.update(layer, key, value)
            except (OmegaConfBaseException, ValueError, TypeError) as error:
                message = str(error).splitlines()[0]
                raise ConfigError(f"overrides: configuration key {key!r} is {value!r}: {message}") from error
        return layer
    items = list(overrides)
    for item in items:
        if "=" not in item or not item.split("=", 1)[0].strip():
            raise ConfigError(f"override {item!r} must have the form key=value")
    try:
        return OmegaConf.from_dotlist(items)
    except (YAMLError, ValueError, TypeError) as error:
        raise ConfigError(f"overrides {items} cannot be read: {str(error).splitlines()[0]}") from error


def _explain(layer: str, error: Exception) -> str:
    key = getattr(error, "full_key", None) or ""
    message = str(error).splitlines()[0].rstrip(".")
    if "not in" in message and key:
        import difflib

        known = sorted(_flat_keys())
        close = difflib.get_close_matches(key, known, n=1)
        hint = f"; did you mean {close[0]!r}?" if close else ""
        return f"{layer}: there is no configuration key {key!r}{hint}"
    return f"{layer}: configuration key {key!r}: {message}" if key else f"{layer}: {message}"


@lru_cache(maxsize=1)
def _flat_keys() -> frozenset[str]:
    keys: set[str] = set()

    def walk(node: Any, prefix: str) -> None:
        for item in fields(node):
            keys.add(f"{prefix}{item.name}")
            child = getattr(node, item.name)
            if is_dataclass(child):
                walk(child, f"{prefix}{item.name}.")

    walk(Config(), "")
    return frozenset(keys)


def _validated(merged: Any) -> Config:
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    try:
        config: Any = OmegaConf.to_object(merged)
    except OmegaConfBaseException as error:
        raise ConfigError(_explain("configuration", error)) from error
    values: dict[str, Any] = {key: reduce(getattr, key.split("."), config) for key in _flat_keys()}
    for key, choices in CHOICES.items():
        if values[key] not in choices:
            known = ", ".join(choices)
            raise ConfigError(f"configuration key {key!r} is {values[key]!r}; it must be one of {known}")
    for key, value in values.items():
        if isinstance(value, float) and not isfinite(value):
            raise ConfigError(f"configuration key {key!r} is {value}; it must be a finite number")
        # OmegaConf lets a list stand for a number inside of a list.
        if isinstance(value, list) and not all(isinstance(v, float) and abs(v) <= 50.0 for v in value):
            raise ConfigError(f"configuration key {key!r} is {value}; it must be numbers from -50 to 50")
    for key, (low, high) in RANGES.items():
        value = values[key]
        if value is not None and not low <= value <= high:
            raise ConfigError(f"configuration key {key!r} is {value}; it must lie in [{low:g}, {high:g}]")
    assert isinstance(config, Config)
    return config
