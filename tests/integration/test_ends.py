"""How a repair ends: what is called safe is so, by a judge of its own; and what the setting does."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.crossings import crossing
from tests.ends import fault, situation
from tests.roads import ROAD, car, driving, problem, scenario, state

import repair
from repair import SearchStatus
from repair.cli.command import main
from repair.config import load_config
from repair.terminal.verdict import Ending

BACKENDS = ("ego", "casadi", "qptr")


def answer(file: Path, backend: str = "ego", *keys: str) -> repair.RepairResult:
    return repair.repair(file, backend=backend, overrides=["reference.source=constant", *keys])


@pytest.fixture
def write(tmp_path: Path):
    """Write a scenario into a file of its own."""

    def written(text: str) -> Path:
        file = tmp_path / f"{len(list(tmp_path.iterdir()))}.xml"
        file.write_text(text, encoding="utf-8")
        return file

    return written


# ------------------------------------------------------------------ by a judge of its own


def _judge(seed: int, file: Path) -> None:
    case = situation(seed) if seed % 4 else crossing(seed)
    file.write_text(case.text, encoding="utf-8")
    result = answer(file, BACKENDS[seed % 3])
    assert fault(result, file) == "", case.words
    if result.terminal is not None and result.terminal.ending is Ending.UNSAFE and seed % 4:
        told = replace(result, terminal=replace(result.terminal, ending=Ending.SAFE))
        assert fault(told, file), f"the judge sees nothing: {case.words}"


@pytest.mark.thinned(2)
@pytest.mark.parametrize("seed", range(2000, 2010))
def test_what_is_called_safe_meets_nothing(seed: int, tmp_path: Path) -> None:
    """``python -m tests.ends --seeds 2000`` does it at length."""
    _judge(seed, tmp_path / "situation.xml")


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", range(3000, 3400))
def test_what_is_called_safe_meets_nothing_at_length(seed: int, tmp_path: Path) -> None:
    _judge(seed, tmp_path / "situation.xml")


@pytest.mark.exhaustive
@pytest.mark.parametrize("reference", ["constant", "planner"])
@pytest.mark.parametrize("backend", BACKENDS)
def test_what_is_called_safe_meets_nothing_recorded(backend: str, reference: str, scenarios: Path) -> None:
    """``python -m tests.ends --folder DIR`` prints what there is."""
    judged = 0
    for file in sorted(scenarios.glob("*.xml")):
        result = repair.repair(file, backend=backend, overrides=[f"reference.source={reference}"])
        judged += result.terminal is not None
        assert fault(result, file) == "", file.name
    assert judged


@pytest.mark.parametrize("name", ["DEU_Flensburg-6_1_T-1", "USA_US101-26_1_T-1"])
def test_recorded_traffic(name: str, scenarios: Path) -> None:
    file = scenarios / f"{name}.xml"
    result = answer(file, "qptr")
    assert result.terminal is not None
    assert fault(result, file) == ""


# ------------------------------------------------------------------ what each word says

_CROSSES = [state(50.0, 3.0 * (0.1 * k - 2.5), k=k, heading=np.pi / 2, v=3.0,
                  tag="state" if k else "initialState") for k in range(31)]  # fmt: skip
CROSSES = car(40, _CROSSES[0], f"<trajectory>{''.join(_CROSSES[1:])}</trajectory>")


def stands(x: float, steps: int) -> str:
    """A car on the ego's lane, predicted for so many steps."""
    return driving(41, x, 0.0, 0.0, range(1, steps + 1))


def at_speed(obstacles: str, *keys: str) -> str:
    """An ego at 12 m/s that can only brake or swerve a little."""
    return scenario(road=ROAD, obstacles=obstacles, problems=problem(100, state(20.0, 0.0, v=12.0)))


def test_who_can_stop_ends_safe(write) -> None:
    result = answer(write(at_speed(CROSSES)))
    terminal = result.terminal
    assert terminal is not None
    assert terminal.ending is Ending.SAFE
    assert terminal.extended == {"constant_velocity": None, "hold": None}
    stop = terminal.continuation.stop
    assert stop.t_start == pytest.approx(result.prepared.t_end)
    end = stop.sample([stop.stands_at])
    assert end.velocity[0] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_who_stood_in_the_way_when_last_seen(write) -> None:
    """Beyond its prediction it is gone for the search; what hangs on that is said by name and time."""
    keys = ["repair.lateral=none", "repair.horizon=3.0"]
    for x in np.arange(
        45.0, 70.0, 1.0
    ):  # the nearest place that the repair does not reach, but its stop does
        result = answer(write(at_speed(CROSSES + stands(float(x), 15))), "qptr", *keys)
        if result.terminal is not None and result.terminal.ending is Ending.SAFE_UNLESS_EXTENDED:
            break
    else:
        pytest.fail("no such place")
    for how in ("constant_velocity", "hold"):
        met = result.terminal.extended[how]
        assert met.obstacle_id == 41
        assert met.time > result.prepared.t_end - 0.1 - 1e-9


HASTY = ("repair.lateral=none", "repair.after_conflict=0.1")  # the repair ends right after the conflict


@pytest.mark.parametrize("backend", BACKENDS)
def test_who_ends_at_speed_behind_a_standing_car(write, backend: str) -> None:
    file = write(at_speed(stands(60.0, 90)))
    result = answer(file, backend, *HASTY)
    assert result.terminal is not None
    assert result.terminal.ending is Ending.UNSAFE
    assert {v.obstacle_id for v in result.terminal.violations} == {41}
    assert result.terminal.extended == {}
    required = answer(file, backend, *HASTY, "checker.terminal=require")
    assert required.terminal is None or required.terminal.ending is not Ending.UNSAFE
    assert required.f_ttr is None or required.f_ttr < result.f_ttr
    said = [v for p in required.search.probes for v in p.verdict.violations]
    words = [v.detail for v in said if v.reason.value == "unsafe_end"]
    assert words
    assert all("full braking fails by" in one and "obstacle 41" in one for one in words)


def test_longer_standing_asks_more(write) -> None:
    """Who comes from behind meets the vehicle that has stopped only after a while."""
    behind = driving(42, -15.0, 0.0, 10.0, range(1, 95))
    file = write(at_speed(CROSSES + behind))
    short, long = (
        answer(file, "ego", "repair.lateral=none", f"checker.terminal_wait={wait}") for wait in (0.0, 5.0)
    )
    assert long.terminal.continuation.stop.t_end == pytest.approx(
        short.terminal.continuation.stop.t_end + 5.0
    )
    assert long.terminal.ending is Ending.UNSAFE or short.terminal.ending is Ending.UNSAFE
    assert (short.terminal.ending, long.terminal.ending) != (Ending.UNSAFE, Ending.SAFE)


# ------------------------------------------------------------------ the setting, the files, the words


def test_off_is_a_word_everywhere(write) -> None:
    file = write(at_speed(CROSSES))
    assert load_config(overrides=["checker.terminal=off"]).checker.terminal == "off"
    assert load_config(overrides={"checker": {"terminal": False}}).checker.terminal == "off"
    result = answer(file, "ego", "checker.terminal=off")
    assert result.terminal is None
    assert result.to_dict()["terminal"] is None
    assert result.search.f_ttr == answer(file).search.f_ttr


@pytest.mark.parametrize("preset", ["scenario_1", "scenario_2"])
def test_the_papers_presets_ask_for_nothing(preset: str) -> None:
    assert load_config(preset).checker.terminal == "off"


def test_the_stop_is_in_the_files_and_in_words(write, tmp_path: Path, capsys) -> None:
    file, out = write(at_speed(CROSSES)), tmp_path / "out"
    assert main(["run", str(file), "--reference", "constant", "--out", str(out)]) == 0
    assert "After it  safe: full braking, at rest at" in capsys.readouterr().out
    content = json.loads((out / "result.json").read_text(encoding="utf-8"))
    terminal = content["terminal"]
    columns = terminal["trajectory"]
    assert columns["t_s"][0] == content["t_end_s"]
    assert columns["x_m"][0] == pytest.approx(content["trajectory"]["x_m"][-1], abs=1e-6)
    assert columns["speed_mps"][-1] == 0.0
    outcome = repair.load_result(out)
    assert [line.kind for line in outcome.drawing.lines].count("continuation") == 1
    assert main(["certify", str(out)]) == 0
    content["terminal"]["ending"] = "unsafe"
    (out / "result.json").write_text(json.dumps(content), encoding="utf-8")
    assert main(["certify", str(out)]) == 1


def test_no_repair_has_no_end(write) -> None:
    result = answer(write(scenario(obstacles="")))
    assert result.status is SearchStatus.NO_CONFLICT
    assert result.terminal is None
