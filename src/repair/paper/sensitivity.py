"""How far TTC, TTR, F-TTR and peak acceleration depend on what the paper leaves open, factor by factor."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repair.errors import RepairError
from repair.paper.cases import origin_of, origin_text, paper_scenes
from repair.paper.table1 import PEAK_NAMES, peak_of, status_of
from repair.progress import counted
from repair.report.tables import Section, Table, against, decimal

if TYPE_CHECKING:
    from repair.config import Config
    from repair.preparation import Prepared
    from repair.scene.scene import Scene

__all__ = ["VARIATIONS", "Variation", "sensitivity"]

_BACKENDS = {1: ("ego", "casadi"), 2: ("ego",)}
_COARSE, _FINE = 0.4, 0.1  # the paper's Delta T, and one that shows smaller effects [s]


@dataclass(frozen=True)
class Variation:
    """One row: a factor, its value, and what it changes of the preset.

    Attributes
    ----------
    factor, value : str
    overrides : mapping of dotted keys
        Laid over the preset.
    damage : mapping
        Fields of :class:`repair.paper.scenario_2.RoadDamage` that differ; Scenario 2 only.
    """

    factor: str
    value: str
    overrides: Mapping[str, Any] = field(default_factory=dict)
    damage: Mapping[str, float] = field(default_factory=dict)

    @property
    def for_ego_only(self) -> bool:
        """Whether other backends cannot notice."""
        return bool(self.overrides) and all(key.startswith("ego.") for key in self.overrides)


def _key(name: str, *values: Any) -> list[Variation]:
    """A configuration key at each of ``values``."""
    return [Variation(name, str(v).lower() if isinstance(v, bool) else str(v), {name: v}) for v in values]


def _road(name: str, *values: float) -> list[Variation]:
    """A number of the reconstructed Scenario 2 at each of ``values``."""
    return [Variation(name, f"{v:g}", damage={name: v}) for v in values]


def _brakes(limit: float) -> Variation:
    keys = {f"limits.{k}": limit for k in ("a_max", "a_lat", "a_total")} | {"limits.a_min": -limit}
    return Variation("all limits.a_*", f"{limit:g}", keys)


_WEIGHTS = [v for name in ("ego.w_v", "ego.w_a", "ego.w_j") for v in _key(name, 0.1, 10.0)]

VARIATIONS: Mapping[int, tuple[Variation, ...]] = {
    1: (
        Variation("preset", ""),
        *_key("reference.a_lat", 0.6, 0.65, 0.75, 0.8, 0.9, 1.0, 1.1, 1.2),
        *_key("reference.speed_step", 0.1, 0.15, 0.25, 0.5),
        *_key("reference.source", "constant"),
        *_key("repair.horizon", 3.8, 4.2, 4.5, 5.0),
        *_key("repair.spacing", 0.2, 0.3),
        *_key("repair.degree", 4, 5),
        *_key("repair.lateral", "lane"),
        *_key("repair.clearance", 0.5, 0.75, 1.25, 1.5),
        *_key("scene.s_offset", 2.0, 2.5, 3.0),
        *_key("checker.margin", False),
        *map(_brakes, (2.0, 3.0, 8.0)),
        *_WEIGHTS,
        *_key("ego.elastic", 0.8, 0.9, 0.99),
        *_key("ego.joint", 1.2, 2.0, 5.0),
        *_key("ego.rebounds", 3),
    ),
    2: (
        Variation("preset", ""),
        *_road("speed", 13.0, 14.0, 16.0, 17.0),
        *(
            Variation(
                "speed, and damage_gap for the same TTC",
                f"{v:g}, {1.55 * v + 7.95:.1f}",
                damage={"speed": v, "damage_gap": 1.55 * v + 7.95},
            )
            for v in (13.0, 14.0, 16.0, 17.0)
        ),
        *_road("lane_width", 3.0, 3.25, 3.75),
        *_road("damage_gap", 28.0, 30.0, 32.0, 34.0),
        *_road("damage_length", 1.0, 6.0),
        *_road("damage_width", 1.6, 1.8, 2.2, 2.5),
        *_road("damage_offset", -0.6, -0.3, 0.3),
        *_road("second_gap", 10.0, 15.0, 25.0, 30.0),
        *_road("third_gap", -40.0, -25.0, -20.0, -15.0),
        *_road("change_start", 0.0, 1.0, 2.0),
        *_road("change_duration", 3.0, 5.0),
        *_key("repair.horizon", 2.4, 2.6, 3.0, 3.2, 3.6, 4.0),
        *_key("limits.a_lat", 4.0, 4.5, 5.5),
        *_key("limits.a_min", -2.0, -4.0, -5.0),
        *_key("repair.spacing", 0.2, 0.3),
        *_key("repair.degree", 4, 5),
        *_key("repair.lateral", "lane"),
        *_key("repair.clearance", 1.0, 1.5),
        *_key("checker.margin", True),
        *_key("reference.source", "planner"),
        *_WEIGHTS,
        *_key("ego.elastic", 0.8, 0.99),
        *_key("ego.joint", 1.2, 5.0),
        *_key("ego.rebounds", 3),
    ),
}
"""What is varied, by the number of the paper's scenario; the first row is the preset itself."""


def sensitivity(
    number: int,
    scenario_dir: Path | str | None = None,
    *,
    variations: Sequence[Variation] | None = None,
    backends: Sequence[str] | None = None,
    overrides: Sequence[str] = (),
) -> Table:
    """Vary one free choice at a time around the preset of a scenario of the paper.

    Parameters
    ----------
    number : int
        1 or 2.
    scenario_dir : path, optional
        See :func:`repair.paper.table1.table1`.
    variations : sequence of Variation, optional
        :data:`VARIATIONS` of that scenario by default.
    backends : sequence of str, optional
        By default ego, and casadi in Scenario 1; the first one's status is shown.
    overrides : sequence of ``"key=value"``
        Laid over the preset in every row, below what the row varies.

    Returns
    -------
    Table
        A row that cannot be computed says why.
    """
    scene = paper_scenes(scenario_dir, [number])[number]
    backends = _BACKENDS[number] if backends is None else backends
    chosen = VARIATIONS[number] if variations is None else variations
    data = [
        _row(number, scene, variation, backends, overrides)
        for variation in counted(chosen, len(chosen), "variations")
    ]
    origin = origin_of(scene)
    name = PEAK_NAMES[number]
    columns = ["factor (preset)", "value", "TTC [s]", "TTR [s]"]
    for backend in backends:
        columns += [f"{backend} F-TTR [s], grid 0.4", "grid 0.1", f"{name} [m/s²]"]
    lines = [_line(row, backends) for row in data]
    notes = (
        "One factor at a time around the preset; its value there in brackets. The search has no upper end "
        "but the TTC (search.upper=null), so that a later F-TTR can show.",
        "TTR: the latest fixed evasive manoeuvre. Peak and status belong to the search on the grid of 0.4 s "
        f"(status: backend {backends[0]}). A dash: none, or the factor does not concern the backend.",
        *(("The scenario is a reconstruction, not the paper's own file.",)
          if origin["kind"] == "reconstruction" else ()),
    )  # fmt: skip
    heading = f"Scenario {number} ({origin_text(origin)})"
    return Table(
        f"Sensitivity of Scenario {number} to what the paper leaves open",
        (Section(heading, (*columns, "status"), tuple(lines)),),
        notes,
        {"scenario": number, "provenance": origin, "rows": data},
    )


def _row(
    number: int, scene: Scene, variation: Variation, backends: Sequence[str], overrides: Sequence[str]
) -> dict[str, Any]:
    """One variation as plain values."""
    from repair.baselines.evasive.times import evasive_ttr
    from repair.preparation import prepare

    row: dict[str, Any] = {
        "factor": variation.factor, "value": variation.value, "preset": _preset_value(number, variation),
        "ttc_s": None, "ttr_s": None, "backends": {}, "status_text": "",
    }  # fmt: skip
    configs = {name: _config(number, name, variation, overrides) for name in backends}
    try:
        seen = _varied(scene, variation)
        first = prepare(seen, configs[backends[0]])
    except RepairError as error:
        return {**row, "status_text": f"not available: {error}"}
    row["ttc_s"] = against(None, first.conflict.time)["ours"]
    row["ttr_s"] = against(None, evasive_ttr(first, first.config.evasive).ttr)["ours"]
    for name in backends:
        if name != backends[0] and variation.for_ego_only:
            continue
        # Preparing does not look at the backend, unless a preset has keys for it alone.
        same = replace(configs[name], backend=first.config.backend) == first.config
        prepared = replace(first, config=configs[name]) if same else prepare(seen, configs[name])
        row["backends"][name] = _searched(prepared, number)
    texts = {name: found["status_text"] for name, found in row["backends"].items()}
    row["status_text"] = texts.pop(backends[0])
    for name, text in texts.items():
        if row["backends"][name]["f_ttr_s"] is None:
            row["status_text"] += f"; {name}: {text}"
    return row


def _searched(prepared: Prepared, number: int) -> dict[str, Any]:
    """F-TTR on both grids, and the peak on the coarse one."""
    from repair.api import find
    from repair.solvers.registry import make_backend

    config = prepared.config
    try:
        backend = make_backend(config.backend, config)
    except RepairError as error:
        return {"f_ttr_s": None, "f_ttr_fine_s": None, "peak_mps2": None,
                "status": "unavailable", "status_text": f"not available: {error}"}  # fmt: skip
    coarse, fine = (
        find(prepared, backend, settings=replace(config.search, delta_t=step)) for step in (_COARSE, _FINE)
    )
    peak = None if coarse.best is None else peak_of(prepared, coarse.best, number)
    return {
        "f_ttr_s": against(None, coarse.f_ttr)["ours"],
        "f_ttr_fine_s": against(None, fine.f_ttr)["ours"],
        "peak_mps2": against(None, peak)["ours"],
        "status": coarse.status.value,
        "status_text": status_of(coarse),
    }


def _config(number: int, backend: str, variation: Variation, overrides: Sequence[str]) -> Config:
    from repair.config import load_config

    varied = [f"{key}={str(value).lower()}" for key, value in variation.overrides.items()]
    keys = [f"backend={backend}", "search.upper=null", *overrides, *varied]
    return load_config(preset=f"scenario_{number}", overrides=keys)


def _varied(scene: Scene, variation: Variation) -> Scene:
    """The scene, generated anew where numbers of the road differ."""
    if not variation.damage:
        return scene
    from repair.paper.scenario_2 import RoadDamage, scenario_2
    from repair.scene.commonroad import scene_from_scenario

    scenario, problems = scenario_2(RoadDamage(**variation.damage))
    return scene_from_scenario(scenario, next(iter(problems.planning_problem_dict.values())))


def _preset_value(number: int, variation: Variation) -> Any:
    """What the varied factor is in the preset, None where there is not one such value."""
    from repair.config import load_config
    from repair.paper.scenario_2 import RoadDamage

    config = load_config(preset=f"scenario_{number}", backend="ego")
    values: list[Any] = [reduce(getattr, key.split("."), config) for key in variation.overrides]
    values += [getattr(RoadDamage(), key) for key in variation.damage]
    if len(values) > 1 and variation.overrides:  # the limits: one number, signs apart
        values = [max(values)]
    return values[0] if len(values) == 1 else values or None


def _line(row: Mapping[str, Any], backends: Sequence[str]) -> tuple[str, ...]:
    preset = row["preset"]
    shown = "" if preset is None else f" ({_text(preset)})"
    cells = [row["factor"] + shown, row["value"], decimal(row["ttc_s"], 1), decimal(row["ttr_s"], 1)]
    for name in backends:
        found = row["backends"].get(name, {})
        values: tuple[tuple[str, int], ...] = (("f_ttr_s", 1), ("f_ttr_fine_s", 1), ("peak_mps2", 2))
        cells += [decimal(found.get(key), digits) for key, digits in values]
    return (*cells, row["status_text"])


def _text(value: Any) -> str:
    """A value as in a configuration file."""
    convert: dict[type, Callable[[Any], str]] = {
        bool: lambda v: str(v).lower(),
        float: lambda v: f"{v:g}",
        list: lambda v: ", ".join(_text(x) for x in v),
    }
    return convert.get(type(value), str)(value)
