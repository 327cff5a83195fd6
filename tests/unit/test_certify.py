"""The certificate: every margin from the files alone, and every lie found out."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from repair.api import repair
from repair.certify.certificate import Certificate, CertificateRow, format_certificate
from repair.certify.limits import driven_rows
from repair.certify.motion import Motion
from repair.certify.recompute import certify
from repair.cli.command import main
from repair.errors import RepairError
from repair.paper.bundled import paper_scenario
from repair.problem.limits import Limits
from repair.scene.commonroad import load_scene


@pytest.fixture(scope="module")
def written(scenarios, tmp_path_factory):
    """The hard repair of Scenario 1, as it is saved."""
    folder = tmp_path_factory.mktemp("certify")
    result = repair(scenarios / "DEU_Flensburg-6_1_T-1.xml", preset="scenario_1", backend="casadi")
    result.save(folder, figure=False)
    return folder


@pytest.fixture
def folder(written, tmp_path):
    """A copy that a test may spoil."""
    for file in written.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    return tmp_path


def change(folder, edit):
    content = json.loads((folder / "result.json").read_text())
    edit(content)
    (folder / "result.json").write_text(json.dumps(content))


def broken(certificate):
    return {row.name for row in certificate.rows if not row.ok}


@pytest.mark.parametrize(
    "value, words",
    [(1.5, "1.5000"), (-0.0, "0.0000"), (-2.4e-5, "-2.4e-05"), (1e-4, "0.0001"), (float("inf"), "inf")],
)
def test_no_figure_is_shown_as_a_nought_that_it_is_not(value, words):
    row = CertificateRow("speed", value, 0.0, value, True, "exact", "m/s")
    certificate = Certificate(Path("here"), "scenario", "ego", "found", 1.0, (row,))
    assert f" {words} " in format_certificate(certificate).splitlines()[2]


def test_the_hard_repair_of_scenario_1_is_certified(written):
    certificate = certify(written)
    assert certificate.ok, format_certificate(certificate)
    assert certificate.f_ttr >= 2.0
    rows = {(row.name, row.how): row for row in certificate.rows}
    exact = rows["distance to the nearest inflated obstacle", "exact"]
    sampled = rows["distance to the nearest inflated obstacle", "sampled"]
    assert exact.value >= 0.1 - 1e-6
    assert exact.value <= sampled.value + 1e-9
    assert rows["solution_feasible", "official"].ok
    assert "certified: every margin is kept" in format_certificate(certificate)


def test_a_later_curve_is_found_out(folder):
    """Control points pushed ahead: into the car, off the seam, beyond the solution file."""

    def push(content):
        for point in content["curve"]["control_points_m"]:
            point[0] += 1.5

    change(folder, push)
    certificate = certify(folder)
    assert not certificate.ok
    assert {
        "jump in position at the seam",
        "distance to the nearest inflated obstacle",
        "solution file against the curve",
    } <= broken(certificate)
    assert "VIOLATED" in format_certificate(certificate)


def test_limits_are_those_of_the_configuration(folder):
    change(folder, lambda content: content["config"]["limits"].update(a_min=-1.0))
    assert "acceleration s'', least" in broken(certify(folder))


def test_a_kink_in_the_curve_is_found_out(folder):
    def kink(content):
        content["curve"]["control_points_m"][-2][0] += 0.5

    change(folder, kink)
    assert "jerk |s'''|" in broken(certify(folder))


@pytest.mark.parametrize(
    "edit, words",
    [
        (lambda c: c.update(solution_file=None), "no trajectory to certify"),
        (lambda c: c["provenance"].update(sha256="0" * 64), "is not the one the result was made from"),
        (lambda c: c["provenance"].update(path="/nowhere.xml"), "is not there any more"),
        (lambda c: c.update(solution_file="gone.xml"), "is not there any more"),
        (lambda c: c["curve"].pop("degree"), "incomplete"),
        (lambda c: c["curve"].update(type="samples"), "samples"),
        (lambda c: c.pop("config"), "not the result of a repair"),
    ],
)
def test_what_cannot_be_certified_is_said(folder, edit, words):
    change(folder, edit)
    with pytest.raises(RepairError, match=words):
        certify(folder)


def of_an_earlier_version(content):
    """No drawing, no metrics, no capabilities; a seed that nobody used."""
    content["versions"]["commonroad-repair"] = "0.0.9"
    for name in ("metrics", "capabilities", "drawing_file"):
        content.pop(name)
    content["config"].pop("metrics")
    content["config"]["scene"].pop("smoothing")
    content["config"]["checker"].pop("extra")
    content["config"]["seed"] = 0


@pytest.mark.exhaustive
def test_a_result_of_an_earlier_version_is_certified_alike(written, folder):
    change(folder, of_an_earlier_version)
    (folder / "drawing.json").unlink()
    now, then = certify(written), certify(folder)
    of_the_record = ("recomputed", "searched again", "official")
    assert then.ok
    assert [r for r in then.rows if r.how not in of_the_record] == [
        r for r in now.rows if r.how not in of_the_record
    ]
    assert next(r for r in then.rows if r.name == "search repeated").claim is False
    assert main(["certify", str(folder)]) == 0


@pytest.mark.thinned(2)
@pytest.mark.parametrize("earlier", [False, True])
def test_how_far_into_a_box_a_hard_repair_may_go_is_its_own_word(folder, earlier):
    """A soft one promises nothing, but what ``checker.margin`` asks for at the scenario's steps."""

    def deeper(content):
        for probe in content["probes"]:
            probe["margin_m"] = -0.5
        if earlier:
            of_an_earlier_version(content)

    def soft(content):
        content["config"]["checker"]["margin"] = False
        if earlier:
            for probe in content["probes"]:
                probe["residuals"].pop("obstacles")
        else:
            content["capabilities"]["keeps_hull"] = False

    def rows():
        found = certify(folder).rows
        return {(r.limit, r.claim) for r in found if r.name.startswith("distance to the nearest inflated")}

    change(folder, deeper)
    assert rows() == {(-0.5, True), (0.0, True)}  # the latter is that of checker.margin
    change(folder, soft)
    assert rows() == {(0.0, False)}


@pytest.mark.thinned(5)
@pytest.mark.parametrize("preset", ["scenario_1", "scenario_2"])
@pytest.mark.parametrize("backend", ["ego", "casadi", "qptr"])
def test_what_a_preset_finds_is_certified(preset, backend, tmp_path):
    with paper_scenario(preset) as path:
        certified_if_found(repair(path, preset=preset, backend=backend), tmp_path)


def certified_if_found(result, folder):
    if result.f_ttr is None:
        pytest.skip("this backend finds nothing with this preset")
    result.save(folder, figure=False)
    certificate = certify(folder)
    assert certificate.ok, format_certificate(certificate)


def test_the_configuration_is_taken_as_it_was_written(folder):
    """Nobody says again on purpose what stood in a file without an effect."""
    change(folder, lambda content: content["config"]["reference"].update(obstacle_id=7))
    assert certify(folder).ok


def test_settings_that_there_are_not_any_more_are_named(folder):
    change(folder, lambda content: content["config"].update(temper="mild"))
    with pytest.raises(RepairError, match="'temper'"):
        certify(folder)


def test_a_folder_without_a_result(tmp_path):
    with pytest.raises(RepairError, match=r"holds no result\.json"):
        certify(tmp_path)
    (tmp_path / "result.json").write_text("{")
    with pytest.raises(RepairError, match="cannot be read"):
        certify(tmp_path)


def test_the_vehicle_is_driven_from_the_start(scenarios, tmp_path):
    """With a slip angle from nowhere at t_rep it would turn its corner by millimetres into a follower."""
    repair(scenarios / "DEU_Lohmar-37_1_T-1.xml").save(tmp_path, figure=False)
    rows = {row.name: row for row in certify(tmp_path).rows}
    assert rows["first contact of the shapes"].ok


def test_a_reconstruction_is_written_beside_a_result_that_is_saved_later(monkeypatch, tmp_path):
    monkeypatch.delenv("COMMONROAD_SCENARIOS", raising=False)
    with paper_scenario("scenario_1") as path:
        result = repair(path, preset="scenario_1")
    result.save(tmp_path, figure=False)
    assert certify(tmp_path).ok


def test_a_plan_from_memory_may_begin_as_far_aside_as_it_is_taken(scenarios, tmp_path):
    """It is CommonRoad's tolerance; a plan that is made here has none."""
    scene = load_scene(scenarios / "DEU_Flensburg-6_1_T-1.xml")
    start, t = scene.initial_state, scene.dt * np.arange(31)
    along = np.array([np.cos(start.orientation), np.sin(start.orientation)])
    places = np.array([start.x, start.y]) + 0.05 * along + np.outer(start.velocity * t, along)
    result = repair(scene, reference=np.column_stack([t, places]), backend="ego")
    result.save(tmp_path, figure=False)
    rows = [row for row in certify(tmp_path).rows if row.name.startswith("start: ")]
    assert all(row.ok for row in rows)
    assert max(row.value for row in rows if "position" in row.name) == pytest.approx(0.05, abs=1e-3)


@pytest.mark.parametrize("when, ok", [(0.0, True), (1.0, False)], ids=["standing", "driving"])
def test_a_direction_may_jump_where_the_ego_stands_and_nowhere_else(when: float, ok: bool) -> None:
    t = np.arange(0.0, 2.0, 1e-3)
    speed = 0.5 * t
    # Below 0.01 m/s the direction of the last motion is held.
    heading = np.where(speed < max(0.5 * when, 0.01), 0.0, 0.4)
    limits = Limits(v_max=20.0, v_lat=8.0, a_min=-8.0, a_max=8.0, a_lat=2.0, a_total=8.0, j_lon=60.0,
                    j_lat=60.0, curvature=0.4)  # fmt: skip
    motion = Motion(t, np.zeros((len(t), 3)), speed, heading)
    rows = {row.name: row for row in driven_rows(motion, limits, limits, 0.0)}
    assert rows["lateral acceleration"].ok is ok
    assert rows["friction circle"].ok is ok
