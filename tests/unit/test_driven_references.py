"""References from files that CommonRoad's checker accepts are never called undrivable, and are followed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests import driven
from tests.driven import Case

from repair.api import repair
from repair.certify.recompute import certify
from repair.check.conflict import detect_conflict
from repair.config.load import load_config
from repair.errors import ReferenceTrajectoryError
from repair.preparation import Prepared, prepare
from repair.scene.commonroad import load_scene

pytestmark = pytest.mark.filterwarnings("ignore")  # of the checker, about NumPy and SciPy
JUDGED = {"kinematics", "limits"}
NOISE = (0.1, 0.4, 1.0)  # of what the checker lets pass


def prepared(case: Case, folder, *overrides: str) -> Prepared:
    """The case with its file as the reference; that the file is accepted has been seen to."""
    scenario, solution = driven.written(case, folder)
    if not driven.official(scenario, solution):
        pytest.skip("CommonRoad's checker refuses this one")
    return given(case, scenario, solution, *overrides)


def given(case: Case, scenario, solution, *overrides: str) -> Prepared:
    wanted = ("reference.source=file", f"reference.file={solution}", f"scene.vehicle={case.vehicle}")
    config = load_config(overrides=[*wanted, *overrides])
    return prepare(load_scene(scenario, config), config)


def verdict_of(made: Prepared) -> set[str]:
    _, verdict = detect_conflict(made.reference, made.boxes, made.checker, made.t_reference)
    return set(verdict.reasons)


def require_followed(made: Prepared, solution_positions: np.ndarray) -> None:
    count = len(solution_positions)
    path = made.scene.frame.cartesian(made.reference.sample(np.arange(count) * made.scene.dt))
    off = float(np.abs(path.xy - solution_positions).max())
    assert off < 0.06
    said = [note for note in made.notes if note.startswith("the reference is followed to within")]
    assert said or off < 1e-3


def falsely_judged(cases: list[Case], folder) -> tuple[int, list[str]]:
    """How many of the cases CommonRoad's checker accepts, and which of these are called undrivable."""
    accepted, wrong = 0, []
    for k, case in enumerate(cases):
        place = folder / str(k)
        place.mkdir()
        scenario, solution = driven.written(case, place)
        if not driven.official(scenario, solution):
            continue
        accepted += 1
        try:
            made = given(case, scenario, solution)
        except ReferenceTrajectoryError as error:
            wrong.append(f"{case}: {error}")
            continue
        if JUDGED & verdict_of(made):
            wrong.append(f"{case}: {made.conflict}")
        require_followed(made, np.array([state.position for state in driven.drive(case)[0]]))
    return accepted, wrong


def test_what_commonroad_accepts_is_drivable(tmp_path):
    few = [case for case in driven.cases(60) if case.model == "KS" and case.dt >= 0.1][:5]
    noisy = [replace(case, noise=NOISE[k % 3]) for k, case in enumerate(few[::4])]
    other = [case for case in driven.cases(60) if case.model in ("PM", "ST") and case.dt >= 0.2][:2]
    accepted, wrong = falsely_judged([*few, *noisy, *other], tmp_path)
    assert wrong == []
    assert accepted >= 7


@pytest.mark.exhaustive
@pytest.mark.parametrize("part", range(12))
def test_what_commonroad_accepts_is_drivable_many_times(tmp_path, part):
    cases = driven.cases(25, 1000 + 25 * part)
    noisy = [replace(case, noise=NOISE[part % 3]) for case in cases if case.model == "KS"][::2]
    accepted, wrong = falsely_judged([*cases, *noisy], tmp_path)
    assert wrong == []
    assert accepted >= 20


@pytest.mark.thinned(2)
@pytest.mark.parametrize("seed", [3, 5])
def test_what_is_written_for_it_is_accepted_as_well(tmp_path, seed):
    case = Case("curved", "stop", 0.1, "KS", 2, seed, 1.5)
    scenario, solution = driven.written(case, tmp_path)
    assert driven.official(scenario, solution)
    wanted = (f"reference.file={solution}", "reference.source=file", f"scene.vehicle={case.vehicle}")
    result = repair(scenario, overrides=list(wanted))
    assert result.status.value == "no_conflict"
    result.save(tmp_path / "out", figure=False)
    (found,) = (tmp_path / "out").glob("solution*.xml")
    assert driven.official(scenario, found)
    made = certify(tmp_path / "out")
    assert made.ok, [row for row in made.rows if row.claim and not row.ok]
    again = given(case, scenario, found)  # and is a reference in its turn
    assert verdict_of(again) == set()


def test_more_than_a_lap_is_followed_on_each(tmp_path):
    case = Case("ring", "start", 0.2, "KS", 1, 2)
    states, _ = driven.drive(case, duration=25.0)
    assert np.hypot(*np.diff([s.position for s in states], axis=0).T).sum() > 1.1 * driven.LAP
    scenario, solution = driven.written(case, tmp_path, duration=25.0)
    made = given(case, scenario, solution, "scene.horizon=25")
    require_followed(made, np.array([state.position for state in states]))
    assert "kinematics" not in verdict_of(made)
    assert np.all(np.diff(made.reference.sample(np.arange(0.0, 24.0, 0.1)).position[:, 0]) > -1e-9)


def test_a_point_mass_may_turn_as_no_vehicle_can(tmp_path):
    """It is feasible for its own model, so that it is no conflict; which model it is for is said."""
    case = Case("straight", "turn", 0.2, "PM", 2, 1)
    made = prepared(case, tmp_path)
    assert not JUDGED & verdict_of(made)
    assert any("is accepted by CommonRoad's checker for the model PM" in note for note in made.notes)


def test_limits_that_are_asked_for_are_kept_to(tmp_path):
    case = Case("straight", "stop", 0.1, "KS", 2, 3)
    assert verdict_of(prepared(case, tmp_path)) == set()
    scenario, solution = tmp_path / "scenario.xml", tmp_path / "reference.xml"
    asked = given(case, scenario, solution, "limits.a_min=-0.5")
    assert asked.conflict.kind == "limits"


def test_what_commonroad_refuses_is_a_conflict(tmp_path):
    """A turn that asks for 1.3 times the grip of the tyres from 2 s on."""
    case = Case("straight", "free", 0.1, "KS", 2, 4)
    vehicle = driven.parameters(case)
    v, limit = 15.0, vehicle.longitudinal.a_max
    bend = 1.3 * limit / v**2
    steering = float(np.arctan((vehicle.a + vehicle.b) * bend))
    t = np.arange(60) * 0.1
    psi = v * bend * np.maximum(t - 2.0, 0.0)
    x = 40.0 + v * np.minimum(t, 2.0) + np.sin(psi) / bend + vehicle.b * (np.cos(psi) - 1.0)
    y = (1.0 - np.cos(psi)) / bend + vehicle.b * np.sin(psi)
    rows = np.column_stack([x, y, np.where(t > 2.0 - 1e-9, steering, 0.0), np.full(60, v), psi])
    scenario, solution = driven.written(case, tmp_path, rows=rows[:40], start=(40.0, 0.0, 0.0, v))
    assert not driven.official(scenario, solution)
    made = given(case, scenario, solution)
    assert made.conflict.kind in JUDGED
    assert made.conflict.time == pytest.approx(2.0, abs=0.11)
