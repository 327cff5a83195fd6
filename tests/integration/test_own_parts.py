"""The code of docs/own_parts.md does what the page says."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tests import roads

import repair
from repair.check.registry import CHECKS
from repair.errors import ConfigError, ReferenceTrajectoryError
from repair.metrics.registry import METRICS
from repair.reference.registry import SOURCES

PAGE = Path(__file__).parents[2] / "docs" / "own_parts.md"


@pytest.fixture
def file(tmp_path):
    """Return a straight road with a slower car ahead; what a page registers is gone afterwards."""
    path = tmp_path / "scenario.xml"
    path.write_text(roads.scenario(), encoding="utf-8")
    before = [registry.names() for registry in (CHECKS, METRICS, SOURCES)]
    yield path
    for registry, names in zip((CHECKS, METRICS, SOURCES), before, strict=True):
        for name in set(registry.names()) - set(names):
            registry.unregister(name)


def test_the_page(file, capsys):
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    names, said = {}, []
    for code in blocks:
        exec(compile(code.replace("scenario.xml", str(file)), str(PAGE), "exec"), names)
        said.append(capsys.readouterr().out.split())
    reference, check, metric, planner = said
    assert names["SpeedProfile"] is not None
    assert float(reference[0]) > repair.repair(file, overrides=["reference.source=constant"]).ttc
    usual, gentle = names["usual"], names["gentle"]
    assert usual.f_ttr is not None
    assert gentle.f_ttr is None or gentle.f_ttr < usual.f_ttr
    assert check[0] == str(usual.f_ttr)
    assert 1.0 < float(metric[0]) < 3.0
    assert planner[0] == "found"
    states = names["trajectory"].state_list
    assert states[0].time_step == names["problem"].initial_state.time_step
    assert names["planner"].result.f_ttr > 0.0
    assert min(s.velocity for s in states) < names["problem"].initial_state.velocity


def test_each_part_can_be_announced():
    """The groups of the page are those of the registries."""
    text = PAGE.read_text(encoding="utf-8")
    for registry in (CHECKS, METRICS, SOURCES):
        assert f'[project.entry-points."{registry.group}"]' in text


def test_who_is_no_planner_and_who_fails():
    with pytest.raises(ConfigError, match="not a int"):
        repair.RepairingPlanner(5)
    with pytest.raises(ConfigError, match="either"):
        repair.RepairingPlanner(Failing(), repair.load_config(), backend="ego")
    planner = repair.RepairingPlanner(Failing())
    with pytest.raises(ReferenceTrajectoryError, match="planning by Failing"):
        planner.plan(None, None, np.zeros((2, 2)))
    assert planner.result is None
    planner = repair.RepairingPlanner(Idle())  # whose answer is not to be another's reference
    with pytest.raises(ReferenceTrajectoryError, match="Idle has planned nothing"):
        planner.plan(None, None)
    planner = repair.RepairingPlanner(SimpleNamespace(plan=lambda *asked: "constant"))
    with pytest.raises(ReferenceTrajectoryError, match="planned a str, which is no trajectory"):
        planner.plan(None, None)
    with pytest.raises(ConfigError, match="load_config, and is a int"):
        repair.RepairingPlanner(Failing(), 5)


class Idle:
    """Gives up without a word."""

    def plan(self, sc, pp, ref_path=None):
        return None


class Failing:
    """Has no plan."""

    def plan(self, sc, pp, ref_path=None):
        raise RuntimeError("no idea")
