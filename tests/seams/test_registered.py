"""One file and one line: a backend, a reference, a vehicle, a check and a metric that only this file knows.

Each is registered through the public names, runs on a real search, and leaves nothing behind.
"""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
import pytest
from tests import roads
from tests.registries import REGISTRIES, nothing_left

import repair
from repair.backend.base import Capabilities
from repair.check.verdict import Reason, Violation
from repair.errors import ConfigError, RepairError
from repair.metrics.base import MetricValue
from repair.reference.profile import SpeedProfile
from repair.save import Files
from repair.search.rules import RULES
from repair.settings import setting
from repair.solvers.registry import BACKENDS
from repair.vehicle.model import KinematicSingleTrack
from repair.vehicle.parameters import load_vehicle


@pytest.fixture(autouse=True)
def nothing_is_left():
    with nothing_left():
        yield


@pytest.fixture
def path(tmp_path):
    """Return a straight road with a slower car ahead."""
    file = tmp_path / "ZAM_Test-1_1_T-1.xml"
    file.write_text(roads.scenario(), encoding="utf-8")
    return file


@contextmanager
def refused(sentence):
    with pytest.raises(RepairError, match=sentence):
        yield


# -- a backend -------------------------------------------------------------------------------------


@dataclass
class LazyConfig:
    """A backend that asks another one."""

    share: float = setting(0.5, "of the control points that move", low=0.0, high=1.0)


def test_a_backend(path):
    asked = []

    class Lazy:
        name = "lazy"
        capabilities = Capabilities()

        def __init__(self, config):
            self.settings = config.section("lazy")
            self.inner = BACKENDS["ego"].factory

        def solve(self, problem, *, warm_start=None, time_limit=None):
            asked.append((problem.t_rep, warm_start))
            return repair.SolveResult(repair.SolveStatus.INFEASIBLE, detail=f"share {self.settings.share:g}")

    repair.register_backend("lazy", Lazy, settings=LazyConfig)
    result = repair.repair(
        path, backend="lazy",
        overrides=["lazy.share=0.25", "reference.source=constant", "fallback=[]", "search.rule=bisect"],
    )  # fmt: skip
    assert result.status is repair.SearchStatus.NONE_FEASIBLE
    assert result.search.probes[0].solve.detail == "share 0.25"
    assert asked == [(0.0, None)] * len(asked)
    assert result.to_dict()["config"]["lazy"] == {"share": 0.25}
    assert result.to_dict()["capabilities"] == {
        "relaxes": False, "keeps_hull": False, "uses_warm_start": False, "own_way": False,
        "keeps_path": False, "jumps": False,
    }  # fmt: skip
    with refused("'lazy' already"):
        repair.register_backend("lazy", Lazy)
    with refused("lazy.share.*lie in"):
        repair.load_config(overrides=["lazy.share=2"])
    BACKENDS.unregister("lazy")
    with refused("no configuration key 'lazy'"):
        repair.load_config(overrides=["lazy.share=0.25"])


@pytest.mark.parametrize("name", ["search", "scenario", "for_backend"])
def test_a_section_may_not_hide_a_key(name):
    repair.load_config()
    with refused(f"cannot have the name '{name}': the configuration has a key of that name"):
        repair.register_backend(name, lambda config: None, settings=LazyConfig)


def test_a_section_that_was_registered_before_there_was_a_configuration_hides_no_key(monkeypatch):
    monkeypatch.setattr(BACKENDS, "_reserved", {})
    repair.register_backend("search", lambda config: None, settings=LazyConfig)
    with refused("'search' cannot have a section"):
        repair.load_config()


def test_settings_that_are_no_dataclass_are_refused():
    with refused("dataclass"):
        repair.register_backend("lazy", lambda config: None, settings=dict)


# -- a reference -----------------------------------------------------------------------------------


def test_a_reference(path):
    def slow(scene, config, occupancy):
        s0, v0 = scene.start[0, 0], scene.start[1, 0]
        return SpeedProfile.from_accelerations(s0, v0, [2.0, scene.horizon - 2.0], [-0.5, 0.0])

    repair.register_reference("gentle", slow)
    result = repair.repair(path, overrides=["reference.source=gentle"])
    assert result.prepared.reference.sample([2.0]).velocity[0, 0] == pytest.approx(9.0)
    assert result.ttc > repair.repair(path, overrides=["reference.source=constant"]).ttc
    with refused("'gentle' already"):
        repair.register_reference("gentle", slow)


def test_what_is_no_curve_is_no_reference(path):
    repair.register_reference("numbers", lambda scene, config, occupancy: np.zeros(3))
    with refused("gave ndarray"):
        repair.repair(path, overrides=["reference.source=numbers"])


# -- a vehicle -------------------------------------------------------------------------------------


def test_a_vehicle_by_its_parameters(path, tmp_path):
    long = replace(load_vehicle(1), type_id=0, length=8.0, a_max=6.0)
    repair.register_vehicle("shuttle", long)
    result = repair.repair(path, overrides=["scene.vehicle=shuttle", "reference.source=constant"])
    assert result.prepared.scene.vehicle.length == 8.0
    assert result.prepared.limits.a_total == pytest.approx(0.9 * 6.0)
    usual = repair.repair(path, overrides=["reference.source=constant"])
    assert (
        result.ttc <= usual.ttc - (8.0 - usual.prepared.scene.vehicle.length) / 2 / 10.0
    )  # closer by its nose
    assert result.to_dict()["config"]["scene"]["vehicle"] == "shuttle"
    result.save(tmp_path / "out", figure=False)
    assert repair.load_result(tmp_path / "out").record["solution_file"] is None
    with refused("none of CommonRoad's"):
        result.to_solution()


def test_a_vehicle_with_kinematics_of_its_own(path):
    asked = []

    class Stubborn(KinematicSingleTrack):
        """Cannot brake at all."""

        def first_undrivable(self, t, xy, speed, slip, orientation, dt, official, until):
            asked.append(len(t))
            slower = np.flatnonzero(np.diff(speed) < -1e-3)
            return (float(t[slower[0]]), "it has no brakes") if len(slower) else None

    repair.register_vehicle("stubborn", Stubborn(load_vehicle(1)))
    keys = ["scene.vehicle=stubborn", "reference.source=constant", "repair.lateral=none"]
    result = repair.repair(path, overrides=keys)
    assert result.status is repair.SearchStatus.NONE_FEASIBLE
    assert "it has no brakes" in str(result.search.probes[0].verdict)
    assert asked
    with refused("no vehicle model"):
        repair.register_vehicle("nothing", object())


# -- a check ---------------------------------------------------------------------------------------


def test_a_check(path):
    seen = []

    def comfortable(driven):
        """Nobody spills their coffee."""
        seen.append((len(driven.path.t), len(driven.states), driven.late))
        a = np.gradient(driven.path.speed, driven.path.t)[driven.late :]
        if a.min() >= -1.5:
            return []
        return [Violation(Reason.EXTRA, float(driven.path.t[driven.late]), f"coffee: {a.min():.1f} m/s²")]

    repair.register_check("coffee", comfortable)
    keys = ["reference.source=constant", "repair.lateral=none", "search.rule=scan"]
    free = repair.repair(path, overrides=keys)
    result = repair.repair(path, overrides=[*keys, "checker.extra=[coffee]"])
    assert seen
    assert all(points == states and 0 <= late < points for points, states, late in seen)
    assert free.f_ttr is not None
    assert result.f_ttr is None or result.f_ttr < free.f_ttr
    assert any("coffee" in v.detail for probe in result.search.probes for v in probe.verdict.violations)
    assert Reason.EXTRA in {v.reason for p in result.search.probes for v in p.verdict.violations}
    with refused("checker.extra.*'tea' is unknown"):
        repair.load_config(overrides=["checker.extra=[coffee, tea]"])


# -- a metric --------------------------------------------------------------------------------------


def test_a_metric(path, capsys):
    def headway(asked):
        """Time until the ego is where the obstacle in conflict begins now."""
        situation = asked.situation
        if situation.conflict.obstacle_id is None:
            return MetricValue(float("inf"), "no_conflict")
        row = situation.occupancy.ids.tolist().index(situation.conflict.obstacle_id)
        gap = situation.occupancy.lower[row, 0, 0] - situation.scene.start[0, 0]
        return MetricValue(gap / situation.scene.start[1, 0])

    repair.register_metric("thw", headway)
    result = repair.repair(path, overrides=["reference.source=constant", "metrics=[thw, ttb]"])
    record = result.to_dict()
    assert list(record["metrics"]) == ["thw", "ttb"]
    assert record["metrics"]["thw"]["value_s"] == pytest.approx(result.metrics["thw"].value)
    assert 1.0 < result.metrics["thw"].value < 3.0
    from repair.cli import main

    assert main(["run", str(path), "--set", "metrics=[thw]"]) == 0
    assert "THW" in capsys.readouterr().out
    repair.register_metric("nothing", lambda asked: 1.0)
    with refused("has to give a MetricValue"):
        repair.repair(path, overrides=["metrics=[nothing]"])
    with pytest.raises(ConfigError, match="unit"):
        MetricValue(1.0, unit="m/s")


# -- a search rule, an output format -----------------------------------------------------------------


def test_a_search_rule(path):
    def backwards(end, delta_t, is_open):
        """From the latest grid point on, until one is feasible."""
        k = int(np.ceil(end / delta_t - 1e-6)) - 1
        while k >= 0 and not (yield k * delta_t):
            k -= 1

    RULES.register("backwards", backwards)
    keys = ["reference.source=constant", "repair.lateral=none"]
    found = repair.repair(path, overrides=[*keys, "search.rule=backwards"])
    scan = repair.repair(path, overrides=[*keys, "search.rule=scan"])
    assert found.f_ttr == pytest.approx(scan.f_ttr)
    assert [p.feasible for p in found.search.probes] == [False] * (len(found.search.probes) - 1) + [True]


def test_an_output_format(path, tmp_path):
    def text(result):
        return Files({"summary.txt": f"{result.outcome.f_ttr}\n".encode()}, {"summary_file": "summary.txt"})

    repair.register_format("summary", text)
    result = repair.repair(path, overrides=["reference.source=constant"])
    written = result.save(tmp_path / "out", figure=False)
    assert (tmp_path / "out" / "summary.txt").read_text() == f"{result.f_ttr}\n"
    assert tmp_path / "out" / "summary.txt" in written
    assert repair.load_result(tmp_path / "out").record["summary_file"] == "summary.txt"


@pytest.mark.parametrize("registry", REGISTRIES, ids=lambda registry: registry.kind)
def test_names_are_taken_once_and_are_identifiers(registry):
    registry.register("taken", object())
    for name in registry.names():
        with refused(f"'{name}' already" if name.isidentifier() else "identifier"):
            registry.register(name, object())
    for name in ("", "two words", "1", None):
        with refused("identifier"):
            registry.register(name, object())
    with refused("is unknown; there are"):
        registry["no_such_thing"]
