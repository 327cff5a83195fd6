"""Whatever is wrong with the input is a RepairError of one sentence, from the library too."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests import roads

import repair
from repair.api import prepare
from repair.backend.base import Capabilities, Closest, SolveResult, SolveStatus
from repair.backend.guard import Guarded
from repair.check.registry import CHECKS
from repair.config.load import load_config
from repair.curves.base import FrenetTrajectory
from repair.curves.bspline import UniformBSpline
from repair.errors import BackendError, RepairError, in_words, path_of
from repair.metrics.registry import METRICS
from repair.reference.registry import SOURCES
from repair.report.birdseye import birdseye_figure
from repair.report.profiles import profile_figure
from repair.report.text import summary
from repair.save import FORMATS
from repair.scene import reading
from repair.solvers.registry import BACKENDS, make_backend
from repair.study.rows import SweepSettings
from repair.study.run import sweep
from repair.study.task import run_file

CONSTANT = ["reference.source=constant"]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Return a straight road with a slower car ahead."""
    file = tmp_path_factory.mktemp("road") / "ZAM_Test-1_1_T-1.xml"
    file.write_text(roads.scenario(), encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def scene(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return repair.load_scene(path)


@pytest.fixture(scope="module")
def written(scene, tmp_path_factory):
    folder = tmp_path_factory.mktemp("written") / "out"
    repair.repair(scene, overrides=CONSTANT).save(folder, figure=False)
    return folder


@pytest.fixture
def copied(written, tmp_path):
    return Path(shutil.copytree(written, tmp_path / "out"))


class Thing:
    """Something that is none of ours."""

    def __repr__(self):  # the name of a test has to be the same in every process
        return "Thing()"


NOTHINGS = [
    None,
    5,
    2.5,
    [],
    {},
    b"x",
    {1: 2},
    set(),
    True,
    float("nan"),
    np.zeros(3),
    np.zeros((2, 2)),
    Thing(),
    Thing,
]
TEXTS = ["x", "a\0b", "${x}", "\udcff", "a" * 400]


def sentence(error):
    """A message of one line that is not too long."""
    text = str(error)
    assert text
    assert "\n" not in text
    assert len(text) < 700
    return text


def refused(call):
    with pytest.raises(RepairError) as caught:
        call()
    return sentence(caught.value)


# -- arguments -------------------------------------------------------------------------------------


@pytest.mark.parametrize("thing", NOTHINGS + TEXTS, ids=str)
def test_what_is_no_scenario(thing):
    refused(lambda: repair.repair(thing))
    refused(lambda: repair.load_scene(thing))


def test_objects_where_a_path_is_expected(scene, path):
    assert "scene_from_scenario" in refused(lambda: repair.repair(scene.scenario))
    assert "is a directory" in refused(lambda: repair.repair(path.parent))
    refused(lambda: repair.scene_from_scenario(path, scene.planning_problem))
    refused(lambda: repair.scene_from_scenario(scene, scene.planning_problem))
    refused(lambda: repair.scene_from_scenario(scene.scenario, 5))
    made = repair.scene_from_scenario(scene.scenario, scene.planning_problem)
    assert made.id == scene.id


@pytest.mark.parametrize("key", ["planning_problem", "vehicle", "horizon", "after_prediction", "smoothing"])
@pytest.mark.parametrize("thing", [[], {}, "x", True, np.zeros(3), Thing()], ids=str)
def test_settings_of_a_scene(key, thing, path):
    refused(lambda: repair.load_scene(path, **{key: thing}))


def test_numpy_numbers_are_numbers(path):
    assert repair.load_scene(path, horizon=np.float32(2.0), vehicle=np.int64(2)).horizon == pytest.approx(2.0)


@pytest.mark.parametrize("thing", NOTHINGS[1:] + TEXTS, ids=str)
def test_what_is_no_configuration(thing, scene):
    refused(lambda: repair.repair(scene, thing))
    refused(lambda: repair.repair(scene, nonsense=thing))
    refused(lambda: load_config(file=thing))
    refused(lambda: load_config(preset=thing))
    refused(lambda: load_config(backend=thing) and repair.repair(scene, backend=thing))


@pytest.mark.parametrize("thing", [5, [], "constnat", np.zeros((4, 2)), Thing(), True], ids=str)
def test_a_reference_of_a_wrong_type(thing, scene):
    assert "reference" in refused(lambda: repair.repair(scene, reference=thing))


@pytest.mark.parametrize(
    "thing", [None, 5, "search.delta_t=0.1", b"a=b", [5], [None], ["delta_t"], Thing(), {5: 1}], ids=str
)
def test_overrides_of_a_wrong_type(thing):
    refused(lambda: load_config(overrides=thing))


def test_other_arguments(scene, tmp_path):
    assert "cannot be read" in refused(lambda: load_config(file=tmp_path))
    assert "on_probe" in refused(lambda: repair.repair(scene, on_probe=5))
    found = repair.repair(scene, overrides=["reference.source=constant"])
    assert "a FigureStyle, not a str" in refused(lambda: found.save(tmp_path / "out", figure="pdf"))
    refused(lambda: load_config(overrides=["backend=${nowhere}"]))
    config = load_config()
    for broken in (replace(config, backend=[]), replace(config, scene=5), replace(config, metrics="ttr")):
        refused(lambda broken=broken: repair.repair(scene, broken))


def test_in_words_of_anything():
    class Rude:
        def __repr__(self):
            raise ValueError

    assert in_words(Rude()) == "Rude"
    assert in_words(ValueError()) == "ValueError"
    assert len(in_words("x" * 999)) < 250
    with pytest.raises(RepairError, match="bytes"):
        path_of(Bytes(), "a file", RepairError)


class Bytes:
    def __fspath__(self):
        return b"x"


# -- backends --------------------------------------------------------------------------------------


@pytest.fixture
def registered():
    def register(solve, capabilities=None):
        class Backend:
            def __init__(self, config):
                self.inner = make_backend("ego", config)
                self.capabilities = capabilities or Capabilities()

            def solve(self, problem, **keys):
                return solve(self.inner.solve(problem, **keys), problem)

        repair.register_backend("strange", Backend)

    yield register
    BACKENDS.unregister("strange")


class Broken:
    """A curve with a hole."""

    def __init__(self, curve, change):
        self.curve, self.change = curve, change
        self.t_start, self.t_end = curve.t_start, curve.t_end

    def sample(self, t):
        found = self.curve.sample(t)
        return self.change(found)


class Unreadable:
    """A curve that does not say when it begins."""

    t_end = 9.0

    @property
    def t_start(self):
        raise ZeroDivisionError("oh")

    def sample(self, t):
        return None


def _hole(found):
    position = found.position.copy()
    position[-1] = np.nan
    return FrenetTrajectory(found.t, position, found.velocity, found.acceleration, found.jerk)


def _spline(answer, change):
    assert isinstance(answer.curve, UniformBSpline)
    return replace(answer, curve=replace(answer.curve, points=change(answer.curve.points)))


def _short(answer, problem):
    curve = Broken(answer.curve, lambda found: found)
    curve.t_end = problem.t_rep + 0.1
    return replace(answer, curve=curve)


def _raises(answer, problem):
    raise ZeroDivisionError("oh")


ANSWERS = {
    "gave None": lambda answer, problem: None,
    "gave a dict": lambda answer, problem: {},
    "no SolveStatus": lambda answer, problem: replace(answer, status="solved"),
    "as its curve": lambda answer, problem: replace(answer, curve=np.zeros(3)),
    "as its curve, which needs t_start": lambda answer, problem: replace(answer, curve=Unreadable()),
    "not finite": lambda answer, problem: replace(answer, curve=Broken(answer.curve, _hole)),
    "a curve that is not finite": lambda answer, problem: _spline(answer, lambda points: points * np.nan),
    "samples of shape (9, 3)": lambda answer, problem: _spline(
        answer, lambda points: np.hstack([points, points[:, :1]])
    ),
    "numbers beyond 1e+15": lambda answer, problem: _spline(answer, lambda points: points * 1e200),
    "cannot be sampled (OverflowError": lambda answer, problem: replace(
        answer, curve=replace(answer.curve, spacing=1e300)
    ),
    "cannot be sampled (ValueError": lambda answer, problem: _spline(answer, np.ma.masked_array),
    "a B-spline of degree 0": lambda answer, problem: replace(answer, curve=replace(answer.curve, degree=0)),
    "was asked for": _short,
    "FrenetTrajectory": lambda answer, problem: replace(
        answer, curve=Broken(answer.curve, lambda found: found.t)
    ),
    "cannot be sampled": lambda answer, problem: replace(
        answer, curve=Broken(answer.curve, lambda found: 1 / 0)
    ),
    "of shape": lambda answer, problem: replace(
        answer, curve=Broken(answer.curve, lambda f: replace(f, position=f.position[:1]))
    ),
    "no pair of numbers": lambda answer, problem: replace(answer, curve=_spanless(answer.curve)),
    "iterations": lambda answer, problem: replace(answer, iterations="3"),
    "objective": lambda answer, problem: replace(answer, objective=None),
    "residuals": lambda answer, problem: replace(answer, residuals={"a": "b"}),
    "stages": lambda answer, problem: replace(answer, stages={"a": 5}),
    "no Closest": lambda answer, problem: SolveResult(SolveStatus.INFEASIBLE, closest=answer.curve),
    "closest nothing": lambda answer, problem: SolveResult(
        SolveStatus.INFEASIBLE, closest=Closest(None, 0.1)
    ),
    "ZeroDivisionError: oh": _raises,
}


def _spanless(curve):
    made = Broken(curve, lambda found: found)
    made.t_end = "late"
    return made


@pytest.mark.parametrize("words", ANSWERS)
def test_a_backend_that_answers_nonsense_is_named(words, scene, registered):
    registered(ANSWERS[words])
    with pytest.raises(BackendError, match="'strange'") as caught:
        repair.repair(scene, overrides=CONSTANT, backend="strange")
    text = sentence(caught.value)
    assert words in text or words == "closest nothing"


@pytest.mark.parametrize("far", [-1e3, 1e9, -1e9])
def test_a_curve_that_leads_nowhere_is_refused(far, scene, registered):
    registered(lambda answer, problem: _spline(answer, lambda points: points * far))
    result = repair.repair(scene, overrides=[*CONSTANT, "fallback=[]"], backend="strange")
    assert result.status.value == "none_feasible"


@pytest.mark.parametrize("behind", [0.0, 0.5])
def test_a_curve_that_begins_otherwise_is_refused(behind, scene, registered):
    """At the start of the scenario nothing is driven before it that it would have to go on from."""

    def answer(solved, problem):
        def stands(found):
            still = np.zeros_like(found.position)
            place = still + problem.start[0] - np.array([behind, 0.0])
            return FrenetTrajectory(found.t, place, still, still, still)

        return replace(solved, curve=Broken(solved.curve, stands))

    registered(answer)
    settings = [*CONSTANT, "fallback=[]", "search.upper=0"]
    result = repair.repair(scene, overrides=settings, backend="strange")
    (probe,) = result.search.probes
    assert any("begins" in violation.detail for violation in probe.verdict.violations)


def test_a_backend_that_cannot_be_made(scene):
    def factory(config):
        raise KeyError("nowhere")

    repair.register_backend("strange", factory)
    try:
        with pytest.raises(BackendError, match="making backend 'strange' failed: KeyError"):
            repair.repair(scene, overrides=CONSTANT, backend="strange")
    finally:
        BACKENDS.unregister("strange")


def fails(*_):
    raise ZeroDivisionError("oh")


@pytest.mark.parametrize("what", ["no list", [3], fails], ids=["text", "number", "raises"])
def test_a_check_that_is_none_is_named(what, scene):
    repair.register_check("strange", what if callable(what) else lambda driven: what)
    try:
        with pytest.raises(RepairError, match="check 'strange'"):
            repair.repair(scene, overrides=[*CONSTANT, "checker.extra=[strange]"])
    finally:
        CHECKS.unregister("strange")


def test_a_metric_that_raises_is_named(scene):
    repair.register_metric("strange", fails)
    try:
        with pytest.raises(RepairError, match="metric 'strange' failed: ZeroDivisionError: oh"):
            repair.repair(scene, overrides=[*CONSTANT, "metrics=[strange]"])
    finally:
        METRICS.unregister("strange")


def test_a_reference_source_that_raises_is_named(scene):
    repair.register_reference("strange", fails)
    try:
        with pytest.raises(RepairError, match="reference source 'strange' failed: ZeroDivisionError: oh"):
            repair.repair(scene, overrides=["reference.source=strange"])
    finally:
        SOURCES.unregister("strange")


def test_a_format_that_raises_is_named(scene, tmp_path):
    repair.register_format("strange", fails)
    try:
        with pytest.raises(RepairError, match="format 'strange' failed: ZeroDivisionError: oh"):
            repair.repair(scene, overrides=CONSTANT).save(tmp_path, figure=False)
    finally:
        FORMATS.unregister("strange")
    assert not list(tmp_path.iterdir())


def test_settings_of_metrics_that_nobody_asks_for_are_noted(scene):
    keys = [*CONSTANT, "evasive.a_brake=7.0"]
    idle = repair.repair(scene, overrides=keys).to_dict()
    assert "evasive.a_brake has no effect with metrics=[]" in idle["notes"]
    asked = repair.repair(scene, overrides=[*keys, "metrics=[ttb]"]).to_dict()
    assert not [note for note in asked["notes"] if "no effect" in note]


def test_what_a_backend_raises_on_purpose_goes_through(scene, registered):
    def solve(answer, problem):
        raise BackendError("the problem is malformed")

    registered(solve)
    with pytest.raises(BackendError, match="the problem is malformed"):
        repair.repair(scene, overrides=CONSTANT, backend="strange")


def test_an_answer_is_handed_on_as_it_is(scene, registered):
    registered(lambda answer, problem: answer)
    config = load_config(overrides=CONSTANT, backend="strange")
    prepared = prepare(scene, config)
    backend = make_backend("strange", config)
    problem = prepared.source.at(0.0)[0]
    answer = Guarded(backend, "strange").solve(problem)
    assert answer.status is SolveStatus.SOLVED
    assert Guarded(backend, "strange").capabilities is backend.capabilities


def test_in_a_sweep_a_broken_backend_is_a_crash(path, registered):
    registered(_raises)
    settings = SweepSettings(backends=["strange"], references=["constant"], official=False)
    (row,) = run_file(path, settings)
    assert row["status"] == "crash"
    assert "ZeroDivisionError" in row["detail"]


# -- results ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("thing", NOTHINGS + TEXTS, ids=str)
def test_what_is_no_folder_of_a_result(thing):
    refused(lambda: repair.load_result(thing))


def test_files_where_folders_are_wanted(scene, written, tmp_path):
    assert "is a file" in refused(lambda: repair.load_result(written / "result.json"))
    result = repair.repair(scene, overrides=CONSTANT)
    file = tmp_path / "file"
    file.write_text("in the way")
    assert "is a file" in refused(lambda: result.save(file))
    assert "is a file" in refused(lambda: result.save(file / "below"))
    for thing in (None, 5, np.zeros(2), "a\0b", "a" * 400):
        refused(lambda thing=thing: result.save(thing))
    refused(lambda: result.to_dynamic_obstacle("7"))
    assert result.to_dynamic_obstacle(np.int64(7)).obstacle_id == 7


WRONG = [None, "x", -1.5, [], {}, [1], {"a": 1}, True, 10**400, "gone"]
KEYS = [
    "status", "scenario", "provenance", "provenance.kind", "conflict", "conflict.kind",
    "conflict.obstacle_id", "ttc_s", "f_ttr_s", "t_end_s", "probes", "probes.0", "probes.0.t_rep_s",
    "probes.0.reasons", "probes.0.feasible", "probes.0.details", "trajectory", "trajectory.dt_s",
    "trajectory.x_m", "limits", "limits.a_min_mps2", "config", "config.scene", "notes", "time_s", "curve",
    "drawing_file", "peak_deceleration_mps2", "peak_acceleration_mps2", "contact_ttc_s", "metrics",
    "solution_file", "probes.0.peak_acceleration_mps2",
]  # fmt: skip
DRAWN = [
    "steps", "lines", "lines.0", "lines.0.t", "lines.0.x", "lines.1.t_rep_s", "boxes", "bodies", "body",
    "ego", "until_s", "areas", "edges", "unrepaired", "start_s_m",
]  # fmt: skip


def change(folder, name, key, value):
    content = json.loads((folder / name).read_text("utf-8"))
    *owner, last = key.split(".")
    where = content
    for part in owner:
        where = where[int(part)] if isinstance(where, list) else where[part]
    last = int(last) if isinstance(where, list) else last
    if value == "gone":
        del where[last]
    else:
        where[last] = value
    (folder / name).write_text(json.dumps(content), encoding="utf-8")


@pytest.mark.thinned(5)
@pytest.mark.parametrize(
    "name, key", [*(("result.json", k) for k in KEYS), *(("drawing.json", k) for k in DRAWN)]
)
def test_an_edited_result_is_drawn_or_refused(name, key, copied):
    before = (copied / name).read_bytes()
    refusals = 0
    for value in WRONG:
        change(copied, name, key, value)
        try:
            outcome = repair.load_result(copied)
            assert summary(outcome.record, None)
            profile_figure(outcome)
            birdseye_figure(outcome)
        except RepairError as error:
            sentence(error)
            refusals += 1
        (copied / name).write_bytes(before)
    assert refusals >= 2


@pytest.mark.parametrize(
    "text", ["NaN", "1e999", "[" * 100_000, "\ufeff{}", "{", "[]", '{"status": "found"}']
)
def test_a_result_that_is_no_json(text, copied):
    content = (copied / "result.json").read_text("utf-8")
    (copied / "result.json").write_text(text, "utf-8")
    refused(lambda: repair.load_result(copied))
    numbers = text if text in ("NaN", "1e999") else "0.0"
    (copied / "result.json").write_text(
        content.replace('"t_end_s": ', f'"t_end_s": {numbers}, "was": '), "utf-8"
    )
    if numbers != "0.0":
        refused(lambda: repair.load_result(copied))


def test_drawing_and_record_that_do_not_fit(copied):
    change(copied, "result.json", "probes.0", "gone")
    outcome = repair.load_result(copied)
    assert "does not fit" in refused(lambda: profile_figure(outcome))


# -- what is installed, and what the environment says ----------------------------------------------


@pytest.mark.parametrize("found", ["2026.1", "2026.1.0rc1", "2031.2"])
def test_a_commonroad_io_that_is_too_new(found, path, monkeypatch, tmp_path):
    from repair.paper.synthetic import write_scenario

    monkeypatch.setattr(reading, "version", lambda name: found)
    reading.require_commonroad.cache_clear()
    try:
        for call in (
            lambda: repair.load_scene(path),
            lambda: reading.read_solution(written_solution(tmp_path)),
            lambda: write_scenario("scenario_1", tmp_path),
        ):
            text = refused(call)
            assert f"commonroad-io {found} is installed" in text
            assert "pip install 'commonroad-io>=2024.3,<2026'" in text
    finally:
        reading.require_commonroad.cache_clear()


def written_solution(folder):
    file = folder / "solution.xml"
    file.write_text("<CommonRoadSolution/>")
    return file


def test_a_commonroad_io_that_lacks_a_module(path, monkeypatch):
    monkeypatch.setitem(sys.modules, "commonroad.geometry.shape", None)
    reading.require_commonroad.cache_clear()
    try:
        text = refused(lambda: repair.load_scene(path))
    finally:
        reading.require_commonroad.cache_clear()
    assert "lacks what is needed" in text
    assert "pip install" in text


def python(code, **environment):
    full = {**os.environ, **environment}
    command = [sys.executable, "-W", "ignore", "-c", code]
    return subprocess.run(command, capture_output=True, text=True, env=full, timeout=300, check=False)


@pytest.mark.thinned(3)
@pytest.mark.parametrize("backend", ["nonsense", "module://nowhere", "agg"])
def test_figures_need_no_backend_of_matplotlib(backend, written):
    code = (
        "import os, repair\n"
        "from repair.report.birdseye import birdseye_figure\n"
        "from repair.report.style import render\n"
        f"figure = birdseye_figure(repair.load_result({str(written)!r}))\n"
        "print(len(render(figure)), os.environ['MPLBACKEND'])\n"
        "import sys; print('matplotlib.pyplot' in sys.modules)"
    )
    done = python(code, MPLBACKEND=backend)
    assert done.returncode == 0, done.stderr
    size, kept, pyplot = done.stdout.split()
    assert int(size) > 1000
    assert kept == backend
    assert pyplot == "False"


def test_the_official_checker_needs_none_either(written):
    done = python(
        "import sys; from pathlib import Path; from repair.certify.recompute import certify\n"
        f"print(certify(Path({str(written)!r})).status)",
        MPLBACKEND="nonsense",
    )
    assert done.returncode == 0, done.stderr


# -- sweeps: before the work -----------------------------------------------------------------------


@pytest.mark.parametrize(
    "keys, words",
    [
        ({"backends": ["foo"]}, "'foo' is unknown"),
        ({"references": ["foo"]}, "foo"),
        ({"overrides": ["search.delta=1"]}, "search.delta"),
        ({"preset": "scenario_9"}, "scenario_9"),
        ({"jobs": 0}, "jobs is 0"),
        ({"jobs": -3}, "jobs is -3"),
        ({"timeout": 0.0}, "timeout"),
        ({"timeout": float("nan")}, "timeout"),
    ],
)
def test_a_sweep_says_what_is_wrong_before_the_work(keys, words, path, monkeypatch):
    monkeypatch.setattr("repair.study.run.run_study", lambda *_, **__: pytest.fail("it has begun"))
    assert words in refused(lambda: sweep(path.parent, replace(SweepSettings(), **keys)))
