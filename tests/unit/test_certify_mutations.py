"""What the certificate must notice: a written result is changed, and every change is found out."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

import pytest
from tests import roads

from repair.api import repair
from repair.certify.certificate import format_certificate
from repair.certify.recompute import certify
from repair.errors import RepairError

# -- results to spoil --------------------------------------------------------------------------------


def _gone():
    """A slower car ahead whose prediction ends before the ego is there: the reference can be followed."""
    return roads.scenario(obstacles=roads.driving(30, 60.0, 0.0, 4.0, range(1, 41)))


@pytest.fixture(scope="module")
def official(request):
    """A file of COMMONROAD_SCENARIOS, asked for only where it is needed."""
    return lambda: request.getfixturevalue("scenarios") / "DEU_Flensburg-6_1_T-1.xml"


@pytest.fixture(scope="module")
def results(tmp_path_factory, official):
    """Results by name, made once each: their folders hold the scenario too."""
    made: dict[str, Path] = {}

    def result(name: str) -> Path:
        if name not in made:
            folder = tmp_path_factory.mktemp(name)
            file, backend, text = folder / "scenario.xml", name, None
            if name == "no_conflict":
                backend, text = "ego", _gone()
            elif name == "dev":
                backend, text = "casadi", official().read_text()
            file.write_text(text or roads.scenario())
            repair(file, backend=backend, overrides=["reference.source=constant"]).save(folder, figure=False)
            made[name] = folder
        return made[name]

    return result


@pytest.fixture
def folder(request, results, tmp_path):
    """A copy of a result that a test may spoil."""
    for file in results(request.param).iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    change(tmp_path, lambda c: c["provenance"].update(path=str(tmp_path / "scenario.xml")))
    return tmp_path


def change(folder, edit):
    file = folder / "result.json"
    content = json.loads(file.read_text())
    edit(content)
    file.write_text(json.dumps(content))


def solution(folder, edit):
    """Change the text of the solution file."""
    (file,) = folder.glob("solution_*.xml")
    before = file.read_text()
    after = edit(before)
    assert after != before
    file.write_text(after)


STATE = re.compile(r"\s*<ksState>.*?</ksState>", re.DOTALL)


def states(edit):
    """Change the list of states in a solution file."""

    def edited(text):
        found = STATE.findall(text)
        first, last = text.index(found[0]), text.rindex(found[-1]) + len(found[-1])
        return text[:first] + "".join(edit(found)) + text[last:]

    return lambda folder: solution(folder, edited)


def values(tag, new, which=slice(None)):
    """Change one value of some states: ``new`` of the old one."""

    def one(state):
        return re.sub(rf"<{tag}>(.*?)</{tag}>", lambda m: f"<{tag}>{new(float(m.group(1)))!r}</{tag}>", state)

    def edited(found):
        found[which] = [one(s) for s in found[which]]
        return found

    return states(edited)


def record(edit):
    """Change the record."""
    return lambda folder: change(folder, edit)


def column(name, new):
    """Change a column of the record's trajectory."""
    return record(lambda c: c["trajectory"].update({name: [new(v) for v in c["trajectory"][name]]}))


def both(*edits):
    """Several changes that go together."""

    def edited(folder):
        for edit in edits:
            edit(folder)

    return edited


def shorter(count):
    """Fewer rows in the record's trajectory."""

    def edit(content):
        for key, value in content["trajectory"].items():
            if isinstance(value, list):
                content["trajectory"][key] = value[:count]

    return record(edit)


def text(old, new):
    """Change the first place in the solution file that matches."""
    return lambda folder: solution(folder, lambda t: re.sub(old, new, t, count=1))


def setting(section, **keys):
    return record(lambda c: c["config"][section].update(keys))


def scenario(edit, *, checksum):
    """Change the scenario, and with ``checksum`` what the record says of it."""

    def edited(folder):
        file = folder / "scenario.xml"
        file.write_text(edit(file.read_text()))
        if checksum:
            digest = hashlib.sha256(file.read_bytes()).hexdigest()
            change(folder, lambda c: c["provenance"].update(sha256=digest))

    return edited


def wall(folder):
    """A wall across the ego's last place, as a static obstacle of the scenario; the checksum agrees."""
    c = json.loads((folder / "result.json").read_text())["trajectory"]
    place = len(c["x_m"]) // 2
    where = f"<x>{c['x_m'][place]}</x><y>{c['y_m'][place]}</y>"
    obstacle = (
        '<staticObstacle id="987654"><type>parkedVehicle</type><shape><rectangle><length>2.0</length>'
        f"<width>2.0</width></rectangle></shape><initialState><position><point>{where}</point></position>"
        "<orientation><exact>0.0</exact></orientation><time><exact>0</exact></time></initialState>"
        "</staticObstacle>"
    )
    scenario(lambda t: t.replace("<planningProblem ", f"{obstacle}<planningProblem ", 1), checksum=True)(
        folder
    )


def points(edit):
    """Change the control points of the curve."""

    def edited(content):
        edit(content["curve"]["control_points_m"])

    return record(edited)


def nudge(k, by):
    def edit(control):
        control[k][0] += by

    return points(edit)


def residual(content):
    probe = content["probes"][-1]
    probe["residuals"] = {**probe["residuals"], next(iter(probe["residuals"]), "obstacles"): 0.5}


def flip(content):
    for probe in content["probes"]:
        probe["feasible"] = not probe["feasible"]


MUTATIONS = {
    "cut short": states(lambda s: s[:10]),
    "cut short, in the record too": both(states(lambda s: s[:10]), shorter(10)),
    "the last state gone": states(lambda s: s[:-1]),
    "a state in the middle gone": states(lambda s: s[:5] + s[6:]),
    "t_end shortened": record(lambda c: c.update(t_end_s=c["t_end_s"] - 1.0)),
    "t_end shortened, all cut": both(
        record(lambda c: c.update(t_end_s=0.9)), states(lambda s: s[:10]), shorter(10)
    ),
    "orientation off by 0.02": values("orientation", lambda v: v + 0.02),
    "the last orientation off by 0.02": values("orientation", lambda v: v + 0.02, slice(-1, None)),
    "orientation off, in the record too": both(
        values("orientation", lambda v: v + 0.02), column("orientation_rad", lambda v: v + 0.02)
    ),
    "speed off by 2 %": values("velocity", lambda v: 1.02 * v),
    "speed off by 2 %, in the record too": both(
        values("velocity", lambda v: 1.02 * v), column("speed_mps", lambda v: 1.02 * v)
    ),
    "one speed off by 2 %": values("velocity", lambda v: 1.02 * v, slice(1, 2)),
    "steering changed": values("steeringAngle", lambda v: v + 0.01),
    "positions shifted": values("x", lambda v: v + 0.05),
    "positions shifted, in the record too": both(
        values("y", lambda v: v - 0.01), column("y_m", lambda v: v - 0.01)
    ),
    "a position off by a millimetre": values("x", lambda v: v + 1.5e-3, slice(2, 3)),
    "another vehicle model": text(r"KS1:", "ST1:"),
    "another vehicle type": text(r"KS1:", "KS2:"),
    "another planning problem": text(r'planningProblem="\d+"', 'planningProblem="777"'),
    "another scenario": text(r"(benchmark_id=\"[^\"]*:)[A-Z]{3}_[A-Za-z]+-", r"\1USA_Elsewhere-"),
    "steps shifted by one": values("time", lambda v: int(v) + 1),
    "limits": record(lambda c: c["limits"].update(a_total_mps2=99.0)),
    "a limit, weaker in the configuration": setting("limits", a_total=30.0),
    "a limit, in both": both(
        record(lambda c: c["limits"].update(a_total_mps2=30.0, a_min_mps2=-30.0, a_lat_mps2=30.0)),
        setting("limits", a_total=30.0),
    ),
    "TTC": record(lambda c: c.update(ttc_s=9.0)),
    "TTC of the conflict": record(lambda c: c["conflict"].update(t_s=0.3)),
    "contact TTC": record(lambda c: c.update(contact_ttc_s=7.77)),
    "contact TTC of the conflict": record(lambda c: c["conflict"].update(contact_t_s=7.77)),
    "kind of the conflict": record(lambda c: c["conflict"].update(kind="off_road")),
    "obstacle of the conflict": record(lambda c: c["conflict"].update(obstacle_id=4711)),
    "obstacle of the contact": record(lambda c: c["conflict"].update(contact_obstacle_id=4711)),
    "status": record(lambda c: c.update(status="found" if c["status"] != "found" else "no_conflict")),
    "status no search gives": record(lambda c: c.update(status="none_feasible")),
    "trajectory of the record": column("x_m", lambda v: v + 1e-3),
    "reference of the record": record(lambda c: c["reference"].update(spare=1)),
    "notes": record(lambda c: c["notes"].append("everything was looked at twice")),
    "backend": record(lambda c: c.update(backend="qptr")),
    "scenario of the record": record(lambda c: c.update(scenario="ZAM_Other-1_1_T-1")),
    "checker.limits off": setting("checker", limits=False),
    "checker.road off": setting("checker", road=False),
    "checker.official off": setting("checker", official="never"),
    "no clearance": setting("checker", clearance=0.0),
    "wider tolerance": setting("checker", tolerance=0.1),
    "wider gaps": setting("checker", road_gap=2.0),
    "vehicle of the configuration": setting("scene", vehicle=2),
    "horizon of the configuration": setting("scene", horizon=1.5),
    "checksum": record(lambda c: c["provenance"].update(sha256="0" * 64)),
    "no checksum": record(lambda c: c["provenance"].update(sha256=None)),
    "scenario changed": scenario(
        lambda t: t.replace("<dynamicObstacle", "<!-- --><dynamicObstacle", 1), checksum=False
    ),
    "an obstacle in the path": wall,
    "interrupted, it says": both(
        record(lambda c: c.update(complete=False)), record(lambda c: c.update(status_sentence="all is well")),
        record(lambda c: c["trajectory"].update(dt_s=0.2)),
    ),
    "made by others, it says": both(
        record(lambda c: c["versions"].update(numpy="1.0")), values("velocity", lambda v: 1.02 * v)
    ),
}  # fmt: skip

OF_REPAIRS = {
    "F-TTR later": record(lambda c: c.update(f_ttr_s=round(c["f_ttr_s"] + 0.1, 9))),
    "F-TTR earlier": record(lambda c: c.update(f_ttr_s=round(c["f_ttr_s"] - 0.1, 9))),
    "manoeuvre": record(lambda c: c.update(maneuver="left")),
    "peak deceleration": record(lambda c: c.update(peak_deceleration_mps2=-0.5)),
    "smallest speed": record(lambda c: c.update(min_speed_mps=c["min_speed_mps"] + 0.5)),
    "peaks of a probe": record(lambda c: c["probes"][0].update(peak_deceleration_mps2=-0.01)),
    "residuals of a probe": record(residual),
    "verdicts of the probes": record(flip),
    "a probe left out": record(lambda c: c["probes"].pop()),
    "a control point by a millimetre": nudge(-1, 1.2e-3),
    "a control point by a metre": nudge(4, 1.0),
    "a jump at the seam": nudge(0, 0.01),
    "no curve": record(lambda c: c.update(curve=None)),
    "no repair, it says": record(
        lambda c: c.update(curve=None, status="no_conflict", ttc_s=None, contact_ttc_s=None, f_ttr_s=None)
    ),
    "what the backend is able to do": record(lambda c: c["capabilities"].update(keeps_hull=None)),
    "the conflict denied": record(
        lambda c: c.update(ttc_s=None, conflict={**c["conflict"], "kind": "none", "t_s": None})
    ),
}

DEV = (pytest.mark.exhaustive, pytest.mark.scenarios)
CASES = [
    *((name, mutation) for name in ("casadi", "no_conflict") for mutation in MUTATIONS),
    *((name, mutation) for name in ("casadi",) for mutation in OF_REPAIRS),
    *((name, mutation) for name in ("dev",) for mutation in (*MUTATIONS, *OF_REPAIRS)),
]


def noticed(folder) -> str:
    """How a spoilt result is found out; empty where it is not."""
    try:
        certificate = certify(folder)
    except RepairError as error:
        return f"refused: {error}"
    shown = format_certificate(certificate)
    if not certificate.ok:
        assert "NOT certified" in shown
        return ", ".join(certificate.broken)
    if certificate.weaker:
        assert "weaker than usual" in shown
        return f"weaker: {', '.join(certificate.weaker)}"
    return ""


@pytest.mark.thinned(3)
@pytest.mark.parametrize(
    "folder",
    ["casadi", "no_conflict", "ego", pytest.param("dev", marks=pytest.mark.scenarios)],
    indirect=True,
)
def test_an_honest_result_is_certified(folder):
    certificate = certify(folder)
    shown = format_certificate(certificate)
    assert certificate.ok, shown
    assert not certificate.weaker, shown
    assert len(certificate.rows) <= 50
    assert "judged under" in shown


@pytest.mark.thinned(7)
@pytest.mark.parametrize(
    "folder, mutation",
    [
        pytest.param(name, mutation, marks=DEV if name == "dev" else (), id=f"{name}-{mutation}")
        for name, mutation in CASES
    ],
    indirect=["folder"],
)
def test_a_change_is_noticed(folder, mutation):
    {**MUTATIONS, **OF_REPAIRS}[mutation](folder)
    assert noticed(folder)
