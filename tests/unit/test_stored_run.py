"""``repair run --config result.json``: the settings, the scenario and the answer of a stored result again."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import repair
from repair.cli import main
from repair.errors import ConfigError
from repair.paper.bundled import find_scenario

BACKENDS = ("ego", "casadi", "qptr", "shooting", "portfolio")


@pytest.fixture(autouse=True)
def _no_scenarios(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("COMMONROAD_SCENARIOS", raising=False)


def without_times(text: str) -> str:
    """All that is written, in its order, but for the wall times."""

    def untimed(mapping):
        return {key: value for key, value in mapping.items() if not key.endswith("time_s")}

    return json.dumps(json.loads(text, object_hook=untimed), indent=1)


def stored(folder: Path) -> str:
    return without_times((folder / "result.json").read_text("utf-8"))


def again(first: Path, second: Path, *more: str) -> str:
    command = ["run", *more, "--config", str(first / "result.json"), "--out", str(second), "--no-figure"]
    assert main(command) == 0
    return stored(second)


@pytest.mark.thinned(3)
@pytest.mark.parametrize("backend", BACKENDS)
def test_a_stored_result_runs_again_and_is_the_same(backend, tmp_path):
    """Also what was set on purpose and has no effect, of which a note tells."""
    of_another = "qptr.solver=osqp" if backend != "qptr" else "ego.solver=lbfgs"
    keys = ["--set", "search.delta_t=0.8", of_another, "--backend", backend]
    first, second = tmp_path / "first", tmp_path / "second"
    assert main(["run", "scenario_1", *keys, "--out", str(first), "--no-figure"]) == 0
    assert again(first, second) == stored(first)
    if backend == "ego":
        assert main(["certify", str(second)]) == 0
        assert repair.load_config(file=first / "result.json").search.delta_t == 0.8


def test_what_was_printed_runs_again_from_anywhere(tmp_path, capsys):
    """--json writes no scenario; the reconstruction is made again."""
    assert main(["run", "scenario_2", "--json"]) == 0
    printed = capsys.readouterr().out
    file = tmp_path / "kept.json"
    file.write_text(printed, encoding="utf-8")
    assert main(["run", "--config", str(file), "--json"]) == 0
    assert without_times(capsys.readouterr().out) == without_times(printed)


def test_a_reference_from_memory_is_part_of_it(tmp_path):
    with find_scenario("scenario_1") as path:
        (tmp_path / path.name).write_bytes(path.read_bytes())
        scene = repair.load_scene(tmp_path / path.name)
    t = np.arange(0.0, 5.0, 0.1)
    s = scene.start[0, 0] + scene.initial_state.velocity * t
    plan = np.column_stack([t, scene.frame.to_cartesian(s, np.zeros(len(t)))])
    repair.repair(scene, reference=plan).save(tmp_path / "first", figure=False)
    assert again(tmp_path / "first", tmp_path / "second") == stored(tmp_path / "first")


def test_keys_are_laid_over_it_and_what_cannot_be_is_refused(tmp_path, capsys):
    first = tmp_path / "first"
    assert main(["run", "scenario_1", "--out", str(first), "--no-figure"]) == 0
    again(first, tmp_path / "second", "--backend", "casadi")
    made = json.loads((tmp_path / "second" / "result.json").read_text("utf-8"))
    assert made["backend"] == "casadi"
    assert (
        made["config"]["search"] == json.loads((first / "result.json").read_text("utf-8"))["config"]["search"]
    )
    capsys.readouterr()
    assert main(["run", "--preset", "scenario_1", "--config", str(first / "result.json")]) == 2
    assert "has no effect" in capsys.readouterr().err
    with pytest.raises(ConfigError, match="holds every key"):
        repair.load_config(preset="scenario_1", file=first / "result.json")
    next(first.glob("ZAM_*.xml")).write_text("<commonRoad/>", encoding="utf-8")
    assert main(["run", "--config", str(first / "result.json")]) == 2
    assert "checksum" in capsys.readouterr().err


def test_an_official_file_is_found_again(scenarios, tmp_path):
    first = tmp_path / "first"
    file = scenarios / "DEU_Flensburg-6_1_T-1.xml"
    assert main(["run", str(file), "--out", str(first), "--no-figure"]) == 0
    assert again(first, tmp_path / "second") == stored(first)
