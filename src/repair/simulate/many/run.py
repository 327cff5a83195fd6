"""Many drives: files, plans, shifts, predictions and policies, resumable."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from repair import __version__
from repair.config.schema import Config
from repair.errors import ConfigError, RepairError, ScenarioError, in_words
from repair.scene.commonroad import load_scene
from repair.scene.scene import Scene
from repair.scene.settings import SceneConfig
from repair.simulate.many.case import Case, cases_of, plan_on
from repair.simulate.many.store import Rows
from repair.simulate.measures import COLUMNS, row_of
from repair.simulate.policies.registry import POLICIES, make_policy
from repair.simulate.predictions.registry import PREDICTIONS, make_predictor

__all__ = ["Simulation", "files_of", "simulate"]


@dataclass(frozen=True)
class Simulation:
    """What is driven.

    Attributes
    ----------
    files : tuple of Path
    policies, predictions, plans : tuple of str
        Plans are sources of references.
    shifts : tuple of float
        By how much the traffic begins later than recorded [s].
    config : Config
    """

    files: tuple[Path, ...]
    policies: tuple[str, ...]
    predictions: tuple[str, ...]
    plans: tuple[str, ...]
    shifts: tuple[float, ...]
    config: Config

    def require(self) -> None:
        """See that everything that is named is there: before any work.

        Raises
        ------
        RepairError
            Naming what is wrong.
        """
        for what, values in (("policies", self.policies), ("predictions", self.predictions),
                             ("plans", self.plans), ("shifts", self.shifts)):  # fmt: skip
            if not values:
                raise ConfigError(f"the simulation names no {what}")
            if len(set(values)) < len(values):
                raise ConfigError(f"the simulation names one of its {what} twice")
        for name in self.policies:
            make_policy(name, self.config.simulate)
        for name in self.predictions:
            make_predictor(name, self.config.simulate)
        for shift in self.shifts:
            if not 0.0 <= shift <= 1e3:
                raise ConfigError(f"the traffic begins {shift:g} s later; from 0 to 1000 s is possible")
        self._require_effect()

    def _require_effect(self) -> None:
        """Refuse settings of policies and predictions that are not driven."""
        owners = (("simulate.ttc", self.policies, "ttc"), ("simulate.gentle", self.policies, "graded"),
                  ("simulate.error", self.policies, "graded"),
                  ("simulate.delay", self.predictions, "delayed"))  # fmt: skip
        for key, names, owner in owners:
            own = {*POLICIES.names(), *PREDICTIONS.names()}
            others = [name for name in names if name not in _OWN and name in own]
            if key in self.config.given and owner not in names and not others:
                raise ConfigError(f"{key} has no effect without {owner}")


_OWN = frozenset({
    "f_ttr", "at_once", "ttc", "brake", "graded", "never",
    "recorded", "constant_velocity", "constant_turn", "lane", "delayed",
})  # fmt: skip


def files_of(path: Path) -> tuple[Path, ...]:
    """The scenario, or those of a folder.

    Raises
    ------
    ScenarioError
        If there is none.
    """
    try:
        found = tuple(sorted(path.glob("*.xml"))) if path.is_dir() else (path,)
    except (OSError, ValueError) as error:
        raise ScenarioError(f"the folder {path} cannot be read: {in_words(error)}") from error
    if not found:
        raise ScenarioError(f"{path} is a folder without CommonRoad scenario files (*.xml)")
    return found


def simulate(
    what: Simulation, rows: Rows, *, told: Callable[[int, int], None] = lambda done, total: None
) -> None:
    """Make the rows that are not there, one prediction after the other.

    Parameters
    ----------
    what : Simulation
    rows : Rows
    told : callable
        Called with the groups done and all: one for each file, plan and prediction.
    """
    what.require()
    groups = [(f, plan, p) for p in what.predictions for f in what.files for plan in what.plans]
    told(0, len(groups))
    for k, (file, plan, prediction) in enumerate(groups):
        for key, row in _group(what, file, plan, prediction, rows):
            rows.add(key, row)
        told(k + 1, len(groups))


def _group(
    what: Simulation, file: Path, plan: str, prediction: str, rows: Rows
) -> Iterator[tuple[str, dict[str, Any]]]:
    """The rows of a file, a plan and a prediction; what cannot be driven is a row that says so."""
    config = replace(what.config, reference=replace(what.config.reference, source=plan))
    config.given = what.config.given
    known = _digest(file, plan, prediction, config)
    wanted = {
        (s, p): key for s in what.shifts for p in what.policies if (key := f"{known}/{s:g}/{p}") not in rows
    }
    if not wanted:
        return
    common = {"file": file.name, "plan": plan, "prediction": prediction}
    try:
        made = plan_on(_scene(file, _text(config)), config)
        shifts = tuple(dict.fromkeys(s for s, _ in wanted))
        for shift, case in cases_of(made, config, shifts):
            for policy in (p for s, p in wanted if s == shift):
                row = {**dict.fromkeys(COLUMNS), **common, "shift_s": shift, "policy": policy}
                yield wanted[shift, policy], _driven(row, case)
    except RepairError as error:
        for (shift, policy), key in wanted.items():
            row = {**dict.fromkeys(COLUMNS), **common, "shift_s": shift, "policy": policy}
            yield key, {**row, "status": "not_driven", "detail": in_words(error)}


def _text(config: Config) -> str:
    return json.dumps(asdict(config.scene), sort_keys=True, default=str)


@lru_cache(maxsize=1)
def _scene(file: Path, settings: str) -> Scene:
    """The scene of a file, kept for its other plans."""
    return load_scene(file, SceneConfig(**json.loads(settings)))


def _driven(row: dict[str, Any], case: Case | str) -> dict[str, Any]:
    if isinstance(case, str):
        return {**row, "status": "not_driven", "detail": case}
    prediction, policy = row["prediction"], row["policy"]
    driven = case.never if policy == "never" else case.drive(prediction, policy)
    period = case.grounds(prediction).period
    clearance = case.config.checker.clearance
    measured = row_of(driven, case.never, clearance, period)
    return {**row, "status": "driven", "detail": "", **measured, "drive": driven.plain()}


def _digest(file: Path, plan: str, prediction: str, config: Config) -> str:
    """Checksum of everything that a row depends on."""
    try:
        content = hashlib.sha256(file.read_bytes()).hexdigest()
    except OSError as error:
        raise ScenarioError(f"{file} cannot be read: {error.strerror or in_words(error)}") from error
    asked = json.dumps(config.to_dict(), sort_keys=True, default=str)
    text = "\0".join((file.name, content, plan, prediction, asked, __version__))
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:24]
