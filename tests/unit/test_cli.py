"""The command line: verbs, what stands on which stream, exit statuses, bad input."""

from __future__ import annotations

import json
import os
import pkgutil
import signal
import subprocess
import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import repair
from repair.backend.base import BackendSpec, SolveResult
from repair.cli import command as cli
from repair.cli.command import main
from repair.config import Config, load_config
from repair.problem.problem import RepairProblem
from repair.settings import setting
from repair.solvers import registry

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # protobuf's deprecations, on import
    from repair.paper.synthetic import write_scenario

HEAVY = ("scipy", "matplotlib", "casadi", "commonroad", "commonroad_dc", "omegaconf", "shapely", "networkx")


@pytest.fixture(autouse=True)
def _no_scenarios(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is in the environment must not decide what these tests see."""
    monkeypatch.delenv("COMMONROAD_SCENARIOS", raising=False)


@pytest.fixture(scope="module")
def scenario_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scenario("scenario_1", tmp_path_factory.mktemp("scenario"))


def text_of(file: Path) -> str:
    return file.read_text("utf-8")


def refused(argv: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Exit status 2, nothing on stdout, one line on stderr, which is returned."""
    assert main(argv) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("repair: ")
    assert err.count("\n") == 1
    assert "Traceback" not in err
    return err


# -- run -------------------------------------------------------------------------------------------


def test_without_a_scenario_the_bundled_one_is_run(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run"]) == 0
    out, err = capsys.readouterr()
    assert "reconstruction" in out
    assert "official file," not in out
    assert "preset scenario_1" in out
    for word in (
        "TTC",
        "F-TTR",
        "t_rep",
        "feasible",
        "peak deceleration",
        "minimum speed",
        "search",
        "--out DIR",
    ):
        assert word in out
    assert err == ""


def test_json_prints_what_the_file_holds_and_nothing_else(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["run", "--json", "--out", str(tmp_path / "out"), "--no-figure"]) == 0
    out, err = capsys.readouterr()
    assert out == text_of(tmp_path / "out" / "result.json")
    assert err == ""
    content = json.loads(out)
    assert content["provenance"]["kind"] == "reconstruction"
    assert content["figure_files"] == []
    names = {"result.json", content["solution_file"], content["scenario_file"], content["drawing_file"]}
    assert {p.name for p in (tmp_path / "out").iterdir()} == names


def test_nothing_is_written_without_out(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["solution_file"] is None
    assert list(tmp_path.iterdir()) == []


def test_a_scenario_is_found_by_name(
    scenario_file: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COMMONROAD_SCENARIOS", str(scenario_file.parent))
    for name in (scenario_file.name, scenario_file.stem):
        assert main(["run", name, "--json", "--set", "scene.horizon=1.0"]) == 0
        assert json.loads(capsys.readouterr().out)["provenance"]["name"] == scenario_file.name
    assert "neither here nor in COMMONROAD_SCENARIOS" in refused(["run", "Nowhere-1"], capsys)


def test_configuration_reaches_the_search(
    scenario_file: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "own.yaml"
    file.write_text(f"scenario: {scenario_file}\nsearch: {{rule: scan, delta_t: 0.7}}\n")
    argv = ["run", "--config", str(file), "--preset", "scenario_1", "--json", "--set", "search.delta_t=0.8"]
    assert main([*argv, "search.upper=null"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["config"]["search"]["rule"] == "scan"
    assert [p["t_rep_s"] for p in content["probes"]] == [0.0, 0.8, 1.6, 2.4]


def test_no_conflict_is_an_answer(
    scenario_file: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    argv = ["run", str(scenario_file), "--set", "scene.horizon=1.0", "--out", str(tmp_path)]
    assert main(argv) == 0
    out = capsys.readouterr().out
    assert "no_conflict" in out
    assert "unlimited" in out
    assert json.loads(text_of(tmp_path / "result.json"))["f_ttr_s"] is None


def test_none_feasible_is_an_answer(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    limits = ["limits.a_min=-0.1", "limits.a_max=0.1", "limits.a_lat=0.1", "limits.a_total=0.1"]
    assert main(["run", "--set", *limits, "--out", str(tmp_path), "--no-figure"]) == 0
    out = capsys.readouterr().out
    assert "none_feasible" in out
    assert "s: brakes at 1.18 m/s² of 0.10" in out
    assert not list(tmp_path.glob("solution*"))
    assert json.loads(text_of(tmp_path / "result.json"))["solution_file"] is None


@pytest.mark.parametrize("source", ["constant", "accelerate", "planner"])
def test_reference_sources(source: str, scenario_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", str(scenario_file), "--preset", "scenario_1", "--reference", source, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["config"]["reference"]["source"] == source


def test_a_solution_file_is_a_reference(
    scenario_file: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    folder = tmp_path / "a folder: 'with' signs"
    base = ["run", str(scenario_file), "--preset", "scenario_1", "--json"]
    assert main([*base, "--out", str(folder), "--no-figure"]) == 0
    first = json.loads(capsys.readouterr().out)
    assert main([*base, "--reference", str(folder / first["solution_file"])]) == 0
    second = json.loads(capsys.readouterr().out)
    assert second["config"]["reference"]["source"] == "file"
    # What was repaired no longer collides where it did.
    assert second["ttc_s"] is None or second["ttc_s"] > first["ttc_s"]
    assert main([*base[:2], "--reference", str(folder / "result.json")]) == 2
    assert "solution file result.json is not XML" in capsys.readouterr().err


def test_what_has_no_effect_is_noted(scenario_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv = ["run", str(scenario_file), "--preset", "scenario_1", "--set", "casadi.rounds=3", "ego.w_a=1.0"]
    assert main(argv) == 0
    out = capsys.readouterr().out
    assert "casadi.rounds has no effect with backend=ego" in out
    assert "ego.w_a has no effect" not in out
    assert main([*argv, "--backend", "qptr", "--json"]) == 0
    notes = json.loads(capsys.readouterr().out)["notes"]
    assert [note.split()[0] for note in notes if "no effect" in note] == ["ego.w_a", "casadi.rounds"]
    assert main([*argv, "--backend", "casadi", "--json"]) == 0  # which ego helps
    assert not any("no effect" in note for note in json.loads(capsys.readouterr().out)["notes"])


# -- interrupts and pipes --------------------------------------------------------------------------


@dataclass
class CtrlC:
    """Settings of the backend below."""

    at: int = setting(3, "the solve during which Ctrl-C is pressed", low=1, high=9)


@pytest.fixture
def interrupted() -> Iterator[None]:
    """A backend `ctrl_c`: the soft one, but the user presses Ctrl-C during one of its solves."""

    class Interrupted:
        name = "ctrl_c"

        def __init__(self, config: Config) -> None:
            self.inner, self.calls = registry.make_backend("ego", config), 0
            self.capabilities, self.at = self.inner.capabilities, config.section("ctrl_c").at

        def solve(self, problem: RepairProblem, **keys: Any) -> SolveResult:
            self.calls += 1
            if self.calls == self.at:
                signal.raise_signal(signal.SIGINT)
            return self.inner.solve(problem, **keys)

    registry.register("ctrl_c", Interrupted, settings=CtrlC)
    yield
    registry.BACKENDS.unregister("ctrl_c")


@pytest.mark.usefixtures("interrupted")
def test_an_interrupt_loses_nothing_that_was_found(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    before = signal.getsignal(signal.SIGINT)
    argv = [
        "run",
        "--backend",
        "ctrl_c",
        "--set",
        "search.rule=scan",
        "search.sides=first",
        "--out",
        str(tmp_path),
    ]
    assert main([*argv, "--no-figure"]) == 130
    out, err = capsys.readouterr()
    assert "found: a repaired trajectory passed every check" in out
    assert "stopped early" in out
    assert "interrupted" in err
    content = json.loads(text_of(tmp_path / "result.json"))
    assert content["complete"] is False
    assert content["f_ttr_s"] == 0.4
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.usefixtures("interrupted")
def test_an_interrupt_at_the_ttr_keeps_the_ttr(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    argv = ["run", "--backend", "ctrl_c", "--set", "driver=at_ttr", "ctrl_c.at=1", "--out", str(tmp_path)]
    assert main([*argv, "--no-figure"]) == 130
    out, err = capsys.readouterr()
    assert "budget_exhausted" in out
    assert "stopped early" in out
    assert "interrupted" in err
    content = json.loads(text_of(tmp_path / "result.json"))
    assert (content["complete"], content["f_ttr_s"], content["probes"]) == (False, None, [])
    assert f"Metrics   TTR {content['metrics']['ttr']['value_s']:.2f} s" in out


def test_an_interrupt_before_anything_was_found(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def pressed(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("repair.api.prepare", pressed)
    assert main(["run"]) == 130
    out, err = capsys.readouterr()
    assert out == ""
    assert err == "repair: interrupted before anything was found\n"


def test_a_time_limit_is_an_answer(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "--set", "search.time_limit=0", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["status"] == "budget_exhausted"
    assert content["f_ttr_s"] is None


# -- the small verbs -------------------------------------------------------------------------------


def test_backends_says_what_is_missing(capsys: pytest.CaptureFixture[str]) -> None:
    needing = BackendSpec("repair.nowhere:make", None, ("no_such_package",), "another one")
    nowhere = BackendSpec("repair.nowhere:make", None, (), "a third one")
    try:
        registry.register("other", needing)
        registry.register("third", nowhere)
        assert main(["backends"]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert any(line.startswith("ego ") and "soft penalties" in line for line in lines)
        assert any(line.startswith("other ") and "not available: no_such_package" in line for line in lines)
        assert any(line.startswith("third ") and "not available: repair.nowhere" in line for line in lines)
        assert "needs the package no_such_package" in refused(["run", "--backend", "other"], capsys)
    finally:
        for name in ("other", "third"):
            registry.BACKENDS.unregister(name)
    assert main(["backends"]) == 0
    assert "no_such_package" not in capsys.readouterr().out


def test_presets_and_config(capsys: pytest.CaptureFixture[str]) -> None:
    import yaml

    assert main(["presets"]) == 0
    assert "scenario_1" in capsys.readouterr().out
    assert main(["config", "--preset", "scenario_1", "--set", "search.delta_t=0.1"]) == 0
    resolved = yaml.safe_load(capsys.readouterr().out)
    assert resolved["scene"]["s_offset"] == 2.25
    assert resolved["search"] == {
        "rule": "bisect",
        "delta_t": 0.1,
        "upper": 2.0,
        "time_limit": None,
        "sides": "best",
        "proofs": True,
    }
    assert main(["config", "--table"]) == 0
    table = capsys.readouterr().out
    assert "| `search.delta_t` | `0.4` | 0.001 to 1000 | resolution of the search grid [s] |" in table


def test_the_key_table_is_complete() -> None:
    from repair.config.schema import configuration_keys, values_of, words_of
    from repair.report.keys import key_table

    keys = configuration_keys()
    assert len(keys) == len({key.name for key in keys})
    head, rule, *rows = key_table().splitlines()
    assert head.count("|") == rule.count("|") == 5
    for key, row in zip(keys, rows, strict=True):
        name, default, possible, meaning = (x.strip() for x in row.strip("|").split(" | "))
        assert name == f"`{key.name}`"
        typed = load_config(overrides=[f"{key.name}={default.strip('`')}"])  # what is shown can be typed
        assert values_of(typed)[key.name] == key.default
        assert meaning == key.setting.says
        for word in words_of(key) or ():
            assert f"`{word}`" in possible
        for bound in (key.setting.low, key.setting.high):
            assert bound is None or f"{bound:g}" in possible


def test_what_a_solver_calls_infeasible_and_the_checker_does_not_is_explained() -> None:
    from repair.report.text import fixed, probe_table

    probe = {
        "t_rep_s": 0.4, "feasible": True, "reasons": [], "maneuver": "yield", "peak_deceleration_mps2": -1.0,
        "peak_acceleration_mps2": 0.0, "peak_lateral_acceleration_mps2": 0.0, "min_speed_mps": -0.001,
        "solver_status": "infeasible",
        "solver_detail": "that curve passes every check", "iterations": 0, "solve_time_s": 0.0,
        "check_time_s": 0.0, "details": [],
    }  # fmt: skip
    *_, row, detail = probe_table([probe])
    assert row.split()[1:6] == ["feasible", "yield", "-1.00", "0.00", "0.00"]
    assert detail == "  0.40 s: solver: that curve passes every check"
    assert len(probe_table([probe | {"solver_status": "solved"}])) == 3
    assert fixed(None) == "-"


def test_version_and_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"commonroad-repair {repair.__version__}\n"
    assert main([]) == 0
    out = capsys.readouterr().out
    assert all(verb.name in out for verb in cli.VERBS)
    with pytest.raises(SystemExit) as done:
        main(["run", "--help"])
    assert done.value.code == 0


# -- bad input -------------------------------------------------------------------------------------


def test_no_such_file(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert "no such file" in refused(["run", str(tmp_path / "nowhere.xml")], capsys)


@pytest.mark.parametrize(
    "content, sentence",
    [
        ("", "is empty"),
        ("not XML at all", "is not XML"),
        ("<html></html>", "root element is <html>"),
        ('<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]><commonRoad>&b;</commonRoad>', "DOCTYPE"),
    ],
)
def test_not_a_scenario(
    content: str, sentence: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file, out = tmp_path / "bad.xml", tmp_path / "out"
    file.write_text(content)
    err = refused(["run", str(file), "--out", str(out)], capsys)
    assert sentence in err
    assert "bad.xml" in err
    assert not out.exists()


def test_a_scenario_without_a_planning_problem(
    scenario_file: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    import re

    file = tmp_path / "empty.xml"
    file.write_text(
        re.sub(r"<planningProblem .*</planningProblem>", "", text_of(scenario_file), flags=re.DOTALL)
    )
    assert "contains no planning problem" in refused(["run", str(file)], capsys)


@pytest.mark.parametrize("number", ["nan", "inf"])
def test_a_start_that_is_not_finite(
    number: str, scenario_file: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    head, tail = text_of(scenario_file).split("<planningProblem ", 1)
    before, after = tail.split("<velocity>", 1)
    rest = after.split("</velocity>", 1)[1]
    file = tmp_path / "broken.xml"
    file.write_text(f"{head}<planningProblem {before}<velocity><exact>{number}</exact></velocity>{rest}")
    err = refused(["run", str(file), "--out", str(tmp_path / "out")], capsys)
    assert "broken.xml" in err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "argv, words",
    [
        (["run", "--backend", "magic"], ("'magic'", "ego")),
        (["run", "--preset", "scenario_9"], ("'scenario_9'", "scenario_1")),
        (["run", "--set", "search.delta=0.1"], ("search.delta", "did you mean 'search.delta_t'")),
        (["run", "--set", "search.delta_t=fast"], ("search.delta_t", "fast")),
        (["run", "--set", "search.delta_t=-1"], ("search.delta_t", "must lie in")),
        (["run", "--set", "ego.deform.collision=-1"], ("ego.deform.collision", "must lie in")),
        (["run", "--set", "search.delta_t=.nan"], ("search.delta_t", "finite")),
        (["run", "--set", "search.rule=guess"], ("search.rule", "bisect, guided, scan, as_printed")),
        (["run", "--set", "delta_t"], ("'delta_t'", "key=value")),
        (["run", "--config", "nowhere.yaml"], ("nowhere.yaml", "does not exist")),
        (["run", "--reference", "nowhere.xml"], ("'nowhere.xml'", "nor a file")),
        (["run", "--reference", "recorded"], ("reference.obstacle_id",)),
        (
            ["run", "--set", "reference.obstacle_id=7"],
            ("reference.obstacle_id", "no effect with reference.source=planner"),
        ),
        (
            ["run", "--reference", "constant", "--set", "reference.file=a.xml"],
            ("reference.file", "no effect with reference.source=constant"),
        ),
        (["run", "--set", "metrics=[ttr, tto]"], ("metrics", "'tto' is unknown", "ttb, ttk, tts, ttr")),
        (["run", "--set", "checker.extra=[tea]"], ("checker.extra", "tea")),
        (["run", "--set", "seed=3"], ("no configuration key 'seed'",)),
        (["run", "--set", "scene.vehicle=9"], ("vehicle type 9", "FORD_ESCORT")),
        (["run", "--set", "scene.planning_problem=12345"], ("no planning problem 12345",)),
        (["run", "one.xml", "two.xml"], ("two.xml", "--help")),
        (["repair"], ("'repair'", "run")),
        (["run", "--nonsense"], ("--nonsense",)),
    ],
)
def test_one_sentence_and_status_2(
    argv: list[str], words: tuple[str, ...], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    err = refused([*argv, "--out", str(tmp_path / "out")] if argv[0] == "run" else argv, capsys)
    for word in words:
        assert word in err
    assert not (tmp_path / "out").exists()


def test_an_output_folder_that_cannot_be_written(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    assert main(["run", "--out", str(tmp_path / "file"), "--no-figure"]) == 2
    out, err = capsys.readouterr()
    assert out == ""  # before the work, not after it
    assert err.count("\n") == 1
    assert "cannot be made" in err
    assert text_of(tmp_path / "file") == "in the way"


def test_a_solution_for_another_scenario(
    scenario_file: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert (
        main(["run", str(scenario_file), "--set", "scene.horizon=1.0", "--out", str(tmp_path), "--no-figure"])
        == 0
    )
    capsys.readouterr()
    solution = next(tmp_path.glob("solution_*.xml"))
    solution.write_text(text_of(solution).replace("RepairTJunction", "Elsewhere"))
    err = refused(["run", str(scenario_file), "--reference", str(solution)], capsys)
    assert "not for" in err


# -- processes of their own ------------------------------------------------------------------------


def process(*command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    full = {**{k: v for k, v in os.environ.items() if k != "COMMONROAD_SCENARIOS"}, **environment}
    return subprocess.run(
        [sys.executable, *command], capture_output=True, text=True, env=full, timeout=120, check=False
    )


def test_importing_and_asking_for_help_is_light() -> None:
    code = (
        "import sys, repair, repair.cli\n"
        "try: repair.cli.main(['run', '--help'])\n"
        "except SystemExit: pass\n"
        f"print([m for m in {HEAVY!r} if m in sys.modules], file=sys.stderr)"
    )
    done = process("-c", code)
    assert done.returncode == 0
    assert done.stderr.strip() == "[]"


def test_public_names_are_there() -> None:
    for name in repair.__all__:
        assert getattr(repair, name) is not None
    assert callable(repair.repair)
    assert "repair" in dir(repair)
    with pytest.raises(AttributeError, match="no_such_name"):
        repair.no_such_name  # noqa: B018


def test_no_module_has_the_name_of_something_public() -> None:
    """Importing a module puts it into the package under its name, over whatever stood there."""
    assert not {module.name for module in pkgutil.iter_modules(repair.__path__)} & set(repair.__all__)


def test_bad_input_in_a_process_of_its_own(tmp_path: Path) -> None:
    done = process("-m", "repair", "run", str(tmp_path / "nowhere.xml"))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"repair: {tmp_path / 'nowhere.xml'}: no such file\n"


def test_third_parties_are_not_heard(scenario_file: Path) -> None:
    # The drivability checker is asked about everything: its bindings complain when the interpreter ends.
    options = ["--preset", "scenario_1", "--json", "--set", "checker.official=always", "search.delta_t=1.6"]
    done = process("-m", "repair", "run", str(scenario_file), *options)
    assert done.returncode == 0
    assert done.stderr == ""
    assert json.loads(done.stdout)["status"] == "found"


def test_a_defect_is_a_sentence_too(tmp_path: Path) -> None:
    code = (
        "import repair.api, repair.cli\n"
        "def broken(*a, **k): raise ZeroDivisionError('oh')\n"
        "repair.api.repair = broken\n"
        "import sys; sys.argv = ['repair', 'run']\n"
        "repair.cli.entry()"
    )
    done = process("-c", code)
    assert done.returncode == 1
    assert done.stderr.startswith("repair: internal error (ZeroDivisionError: oh)")
    assert done.stderr.count("\n") == 1
    assert "Traceback" in process("-c", code, REPAIR_DEBUG="1").stderr


def test_a_reader_that_leaves_is_no_error() -> None:
    command = [sys.executable, "-m", "repair", "config", "--table"]
    running = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert running.stdout is not None
    assert running.stderr is not None
    running.stdout.close()
    with running.stderr as stderr:
        heard = stderr.read()
    assert running.wait(timeout=60) == 0
    assert heard == b""


def test_the_documented_table_is_up_to_date() -> None:
    from repair.report.keys import key_table

    usage = Path(__file__).parents[2] / "docs" / "usage.md"
    assert usage.read_text("utf-8").endswith(f"{key_table()}\n"), "renew it with `repair config --table`"
