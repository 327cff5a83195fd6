"""Sensitivity tables: what is varied, that every row answers, and that the table says where it comes from."""

from __future__ import annotations

import json
import re

import pytest

from repair.cli.command import main
from repair.config import load_config
from repair.paper import sensitivity as report
from repair.paper.scenario_2 import RoadDamage
from repair.paper.sensitivity import VARIATIONS, Variation, sensitivity


@pytest.fixture(autouse=True, scope="module")
def _no_official_file():
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("COMMONROAD_SCENARIOS", raising=False)
        yield


def chosen(number, *factors):
    return [v for v in VARIATIONS[number] if v.factor in factors]


@pytest.fixture(scope="module")
def first():
    return sensitivity(1, variations=chosen(1, "preset", "reference.source", "ego.w_a"))


@pytest.mark.exhaustive
@pytest.mark.parametrize("number", [1, 2])
def test_every_variation_is_a_valid_one_that_differs_from_the_preset(number):
    def configured(overrides):
        return load_config(preset=f"scenario_{number}", backend="ego", overrides=overrides)

    preset = configured({"search.upper": None})
    for variation in VARIATIONS[number]:
        made = configured({"search.upper": None, **variation.overrides})
        typed = [f"{key}={str(value).lower()}" for key, value in variation.overrides.items()]
        assert made == configured(["search.upper=null", *typed]), variation
        assert list(made.without_effect()) == [], variation
        assert (made != preset) == bool(variation.overrides), variation
        assert (RoadDamage(**variation.damage) != RoadDamage()) == bool(variation.damage), variation
        assert number == 2 or not variation.damage
    assert VARIATIONS[number][0].factor == "preset"


def test_rows_of_scenario_1(first):
    preset, constant, *weights = first.data["rows"]
    assert (preset["ttc_s"], preset["backends"]["ego"]["f_ttr_s"]) == (2.9, 1.6)
    assert preset["backends"]["casadi"]["f_ttr_s"] == 2.0
    assert preset["backends"]["ego"]["f_ttr_fine_s"] >= 1.6
    # A reference that does not slow down for the turn: earlier conflict, earlier reaction.
    assert constant["ttc_s"] < preset["ttc_s"]
    assert constant["backends"]["ego"]["f_ttr_s"] < 1.6
    assert constant["preset"] == "planner"
    assert all(set(row["backends"]) == {"ego"} for row in weights)  # nothing that CasADi could notice


def test_rows_of_scenario_2():
    table = sensitivity(2, variations=chosen(2, "preset", "damage_gap"))
    preset, *gaps = table.data["rows"]
    assert (preset["ttc_s"], preset["backends"]["ego"]["f_ttr_s"]) == (1.6, 0.8)
    times = [row["ttc_s"] for row in gaps]
    assert times == sorted(times)
    assert times[0] < 1.6 < times[-1]
    assert {row["preset"] for row in gaps} == {RoadDamage().damage_gap}
    assert any("reconstruction" in note for note in table.notes)


def test_markdown_and_json_say_where_it_comes_from(first):
    lines = [line for line in first.to_markdown().splitlines() if line.startswith("|")]
    assert len({len(re.findall(r"(?<!\\)\|", line)) for line in lines}) == 1
    assert "reconstruction" in first.sections[0].heading
    content = json.loads(first.to_json(), parse_constant=lambda c: pytest.fail(f"{c} in JSON"))
    assert content["provenance"]["kind"] == "reconstruction"


def test_a_row_that_cannot_be_computed_says_why():
    short = Variation("repair.horizon", "1.0", {"repair.horizon": 1.0})
    (row,) = sensitivity(1, variations=[short], backends=["ego"]).data["rows"]
    assert "has to reach beyond it" in row["status_text"]
    assert row["ttc_s"] is None


def test_the_verb(monkeypatch, capsys):
    monkeypatch.setattr(report, "VARIATIONS", {1: VARIATIONS[1][:1], 2: VARIATIONS[2][:1]})
    assert main(["sensitivity", "scenario_2", "--format", "json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["rows"]) == 1
    assert main(["sensitivity", "scenario_3"]) == 2
    assert "scenario_1" in capsys.readouterr().err
