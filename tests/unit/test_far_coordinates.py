"""The same scene at the origin and where UTM puts it: the same answers, at the same cost."""

from __future__ import annotations

import re

import pytest
from tests import roads

from repair.api import repair
from repair.vehicle import model


def moved(text: str, x: float, y: float) -> str:
    off = {"x": x, "y": y}
    number = r"<([xy])>([^<]*)</[xy]>"
    return re.sub(number, lambda m: f"<{m[1]}>{float(m[2]) + off[m[1]]!r}</{m[1]}>", text)


@pytest.mark.parametrize("backend", ["ego", "casadi", "qptr"])
def test_answers_and_questions_are_the_same_far_away(tmp_path, monkeypatch, backend):
    asked = []
    original = model.official_check
    monkeypatch.setattr(model, "official_check", lambda *given: asked.append(1) or original(*given))
    text, found = roads.scenario(), []
    for x, y in ((0.0, 0.0), (6e3, -6e3), (691184.0, 5334569.0)):
        scenario = tmp_path / "scenario.xml"
        scenario.write_text(moved(text, x, y), encoding="utf-8")
        asked.clear()
        result = repair(scenario, backend=backend, overrides=["reference.source=constant"])
        verdicts = [(probe.t_rep, probe.verdict.reasons) for probe in result.search.probes]
        found.append((result.status, result.ttc, result.f_ttr, verdicts, len(asked)))
    assert found[0][1] < 10.0
    assert found[1] == found[0]
    assert found[2] == found[0]
