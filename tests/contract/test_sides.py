"""Sides are compared at the F-TTR alone; what is found is what comparing them there from the start finds."""

from __future__ import annotations

import pytest
from tests.crossings import crossing

from repair.api import find
from repair.config import load_config
from repair.preparation import prepare
from repair.scene.commonroad import load_scene
from repair.solvers.registry import make_backend


@pytest.mark.parametrize("rule", ["guided", "bisect"])
def test_the_best_side_is_found_whenever_it_is_compared(rule, tmp_path):
    several = 0
    for seed in range(16):
        file = tmp_path / f"{seed}.xml"
        file.write_text(crossing(seed).text, encoding="utf-8")
        keys = ["reference.source=constant", "fallback=[]", f"search.rule={rule}"]
        config = load_config(overrides=keys, backend="ego")
        prepared, solver = prepare(load_scene(file, config), config), make_backend("ego", config)
        found = find(prepared, solver)
        if found.best is None:
            continue
        whole = find(prepared, solver, visits=[found.f_ttr]).best
        assert found.best.maneuver is whole.maneuver
        assert found.best.solve.objective == pytest.approx(whole.solve.objective)
        assert found.best.tried == whole.tried
        several += len(whole.tried) > 1
    assert several
