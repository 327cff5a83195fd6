"""Many drives: files, plans, shifts, predictions and policies, as the tasks of a study."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

from repair.config.schema import Config
from repair.errors import ConfigError, ScenarioError, in_words
from repair.simulate.measures import SIMULATION
from repair.simulate.policies.registry import make_policy
from repair.simulate.predictions.registry import make_predictor
from repair.study.plan import Task, checksum, labels_of
from repair.study.store import Store
from repair.study.task import unpacked

__all__ = ["Simulation", "drives_in", "files_of", "tasks_of"]

_TIMEOUT, _MEMORY = 900.0, 4000.0  # of one drive [s], [MB]


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
        driven = {*self.policies, *self.predictions}
        for key, owner in _OWNERS.items():
            if f"simulate.{key}" in self.config.given and owner not in driven and driven <= _OWN:
                raise ConfigError(f"simulate.{key} has no effect without {owner}")


#: Keys of the section that only one policy or prediction of ours reads; what others read nobody knows.
_OWNERS = {"ttc": "ttc", "gentle": "graded", "error": "graded", "doubt": "graded", "delay": "delayed"}
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


def tasks_of(what: Simulation) -> list[Task]:
    """Every drive, those of a file, a plan and a shift one after the other.

    Raises
    ------
    RepairError
        If something that is named is not there, or a file cannot be read: before any work.
    """
    what.require()
    configs = {plan: _planned(what.config, plan) for plan in what.plans}
    return [
        Task(
            file, str(path), sha256, what.config.backend, plan, f"{prediction}, {policy}, {shift:g} s later",
            varied, configs[plan], False, False, True, _TIMEOUT, _MEMORY, _digest(configs[plan], varied),
            SIMULATION,
        )
        for file, path in labels_of(what.files).items()
        for sha256 in (checksum(path),)
        for plan, shift, prediction, policy in product(
            what.plans, what.shifts, what.predictions, what.policies
        )
        for varied in ({"shift_s": shift, "prediction": prediction, "policy": policy},)
    ]  # fmt: skip


def _planned(config: Config, plan: str) -> Config:
    made = replace(config, reference=replace(config.reference, source=plan))
    made.given = config.given
    return made


def _digest(config: Config, varied: dict[str, Any]) -> str:
    """Checksum of everything that is asked for, the file apart, and what no part of the drive reads."""
    asked = config.to_dict()
    driven = {varied["policy"], varied["prediction"]}
    for key, owner in _OWNERS.items():
        if driven <= _OWN and owner not in driven:
            del asked["simulate"][key]
    text = json.dumps({**asked, "drive": varied}, sort_keys=True, default=str)
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()


def drives_in(store: Store) -> Iterator[dict[str, Any]]:
    """The rows of a simulation, each with its ``drive``: states and cycles."""
    positions = (task["position"] for task in store.tasks() if task["done"])
    for position, row in zip(positions, store.rows(), strict=True):
        whole = store.whole(position)
        yield row if whole is None else {**row, "drive": unpacked(whole)["record"]}
