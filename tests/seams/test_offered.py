"""What installed packages announce, by whatever they name: it works, or harms only who asks for it."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module

import numpy as np
import pytest
from tests import roads

import repair
from repair.check.registry import CHECKS
from repair.errors import RepairError
from repair.metrics.base import MetricValue
from repair.metrics.registry import METRICS
from repair.reference.profile import SpeedProfile
from repair.reference.registry import SOURCES
from repair.save import FORMATS
from repair.search.rules import RULES
from repair.solvers.registry import BACKENDS, available, make_backend
from repair.vehicle.model import VEHICLES
from repair.vehicle.parameters import load_vehicle


class Point:
    """An entry point."""

    def __init__(self, thing):
        self.thing = thing

    def load(self):
        return self.thing


@pytest.fixture
def installed(monkeypatch):
    """Return what makes a registry find things of an installed package."""

    def offer(registry, **things):
        points = {name: Point(thing) for name, thing in things.items()}
        monkeypatch.setattr("repair.registry._entry_points", lambda: {registry.group: points})
        monkeypatch.setattr(registry, "_offered", None)
        monkeypatch.setattr(registry, "_broken", {})
        registry.names()

    return offer


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    file = tmp_path_factory.mktemp("road") / "ZAM_Test-1_1_T-1.xml"
    file.write_text(roads.scenario(), encoding="utf-8")
    return file


def rolling(scene, config, occupancy):
    s, v = scene.start[0, 0], scene.start[1, 0]
    return SpeedProfile.from_accelerations(s, v, [scene.horizon], [-0.3])


def test_a_reference_is_a_function(installed, path):
    """As the page of own parts has it in `pyproject.toml`."""
    installed(SOURCES, rolling=rolling)
    found = repair.repair(path, overrides=["reference.source=rolling", "search.delta_t=1"])
    speed = found.prepared.reference.sample([0.0, 1.0]).velocity[:, 0]
    assert speed[0] - speed[1] == pytest.approx(0.3)


@dataclass(frozen=True)
class Firm:
    """Settings that are not to be changed."""

    force: float = 2.0


@dataclass
class Demanding:
    """Settings without a default."""

    force: float


@dataclass
class Foreign:
    """Settings of a type that no YAML holds."""

    table: np.ndarray | None = None


def like_ego(config):
    return make_backend("ego", config)


def test_backends_are_specifications_or_what_makes_them(installed, path):
    seen = []

    def make(config):
        seen.append(config.section("firm").force)
        return like_ego(config)

    firm = repair.BackendSpec(make, Firm, says="with settings")
    broken = {
        "demanding": repair.BackendSpec(make, Demanding),
        "foreign": repair.BackendSpec(make, Foreign),
        "classless": repair.BackendSpec(make, dict),
        "nothing": None,
    }
    installed(BACKENDS, firm=firm, plain=like_ego, **broken)
    assert repair.load_config(backend="firm", overrides=["firm.force=3"]).section("firm") == Firm(3.0)
    assert repair.repair(path, backend="firm", overrides=["firm.force=3"]).status == "found"
    assert seen == [3.0]
    assert repair.repair(path, backend="plain").status == "found"
    for name in broken:
        assert "cannot be loaded" in available()[name]
        with pytest.raises(RepairError, match=f"'{name}' of an installed package cannot be loaded"):
            repair.load_config(backend=name) and repair.repair(path, backend=name)


def test_a_vehicle_is_parameters_a_model_or_makes_them(installed):
    ford = load_vehicle(1)
    installed(VEHICLES, parameters=ford, makes=lambda: load_vehicle(2), none=5)
    assert VEHICLES["parameters"]().parameters == ford
    assert VEHICLES["makes"]().parameters == load_vehicle(2)
    with pytest.raises(RepairError, match="a vehicle is expected, and a int is none"):
        VEHICLES["none"]


@pytest.mark.parametrize(
    "registry",
    [
        CHECKS,
        METRICS,
        SOURCES,
        RULES,
        FORMATS,
        "repair.simulate.policies.registry:POLICIES",
        "repair.simulate.predictions.registry:PREDICTIONS",
    ],
    ids=lambda each: each if isinstance(each, str) else each.kind,
)
def test_what_cannot_be_called_is_no_part(registry, installed, path):
    """Whoever asks for something else does not know of it."""
    if isinstance(registry, str):
        module, _, name = registry.partition(":")
        registry = getattr(import_module(module), name)
    installed(registry, odd=5)
    assert "odd" not in registry.names()
    with pytest.raises(RepairError, match="'odd' of an installed package cannot be loaded: it is a int"):
        registry["odd"]


def test_a_check_and_a_metric_are_functions(installed, path):
    installed(METRICS, one=lambda asked: MetricValue(1.0, "always"))
    found = repair.repair(path, overrides=["metrics=[one]", "reference.source=constant"])
    assert found.metrics["one"].value == 1.0
    installed(CHECKS, fine=lambda driven: [])
    assert (
        repair.repair(path, overrides=["checker.extra=[fine]", "reference.source=constant"]).status == "found"
    )


def test_a_backend_with_the_name_of_a_key_harms_only_who_asks_for_it(installed):
    installed(BACKENDS, search=repair.BackendSpec(lambda config: None, Firm))
    assert repair.load_config().search.delta_t == 0.4
    assert "the configuration has a key of that name" in available()["search"]
    with pytest.raises(RepairError, match="of an installed package cannot be loaded: the configuration has"):
        make_backend("search", repair.load_config(backend="search"))
