"""What a program registers is known in the processes that a study starts."""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace

import pytest
from tests import roads
from tests.registries import nothing_left

import repair
from repair.errors import RepairError
from repair.reference.profile import SpeedProfile
from repair.registry import adopt, registered
from repair.report.loop.table import table_of
from repair.settings import setting
from repair.solvers.registry import BACKENDS
from repair.study.engine import LocalLanes
from repair.study.plan import Study, tasks_of
from repair.study.run import run_study
from repair.study.store import Store


@pytest.fixture(autouse=True)
def nothing_is_left():
    with nothing_left():
        yield


def braking() -> None:
    """Register a backend that brakes, and a reference that rolls; neither can be imported from anywhere."""

    @dataclass
    class BrakeConfig:
        deceleration: float = setting(4.0, "how hard it brakes [m/s²]", low=0.1, high=20.0)

    class Brake:
        name = "brake"
        capabilities = repair.Capabilities(own_way=True, jumps=True)

        def __init__(self, config):
            self.rate = -config.section("brake").deceleration

        def solve(self, problem, *, warm_start=None, time_limit=None):
            (s, _), (v, _), _ = problem.start
            lasts = problem.t_end - problem.t_rep
            brakes = min(v / -self.rate, lasts)
            made = SpeedProfile.from_accelerations(s, v, [brakes, lasts - brakes], [self.rate, 0.0])
            return repair.SolveResult(
                repair.SolveStatus.SOLVED, replace(made, knots=made.knots + problem.t_rep)
            )

    def rolling(scene, config, occupancy):
        s, v = scene.start[0, 0], scene.start[1, 0]
        return SpeedProfile.from_accelerations(s, v, [scene.horizon], [-0.1])

    repair.register_backend("brake", Brake, settings=BrakeConfig)
    repair.register_reference("rolling", rolling)


def test_a_study_in_the_program_has_what_the_program_has(tmp_path):
    braking()
    file = tmp_path / "ZAM_Test-1_1_T-1.xml"
    file.write_text(roads.scenario(), encoding="utf-8")
    asked = Study((file,), ("brake",), ("rolling",), settings={"brake.deceleration": 7.0}, official=False)
    with Store(tmp_path / "out", fresh=True) as store:
        run_study(tasks_of(asked), store, LocalLanes(1), progress=False)
        (row,) = list(store.rows())
    keys = ["reference.source=rolling", "brake.deceleration=7"]
    here = repair.repair(file, backend="brake", overrides=keys)
    assert (row["status"], row["detail"]) == ("found", "")
    assert row["f_ttr_s"] == pytest.approx(here.f_ttr)
    assert row["peak_deceleration_mps2"] == pytest.approx(-7.0)


def test_what_cannot_be_handed_over_is_named():
    lock = threading.Lock()
    repair.register_metric("locked", lambda asked: lock)
    with pytest.raises(RepairError, match=r"'locked'.*cannot be handed to other processes"):
        LocalLanes(1)


def test_what_is_there_already_stays():
    braking()
    parts = registered()
    there = {name for _, _, name, _ in parts}  # and what other tests have registered
    assert {"brake", "rolling"} <= there
    before = BACKENDS["brake"]
    BACKENDS.unregister("brake")
    assert {name for _, _, name, _ in registered()} == there - {"brake"}
    adopt(parts)
    adopt([(home, attribute, name, None) for home, attribute, name, _ in parts])
    assert BACKENDS["brake"] is before


def test_drives_that_were_left_out_say_why():
    row = {"file": "a.xml", "reference": "constant", "shift_s": 0.0, "status": "crash", "detail": "it broke"}
    rows = [
        row,
        {**row, "shift_s": 1.0},
        {**row, "file": "b.xml", "status": "not_driven", "detail": "no way"},
    ]
    said = table_of(rows).splitlines()
    assert said[-2:] == ["left out, 2 drives, crash: it broke", "left out, 1 drives, not_driven: no way"]
    many = [{**row, "detail": str(k)} for k in range(11)]
    assert table_of(many).splitlines()[-1] == "left out for 3 more reasons"
