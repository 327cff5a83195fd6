"""Studies: what the file says, what is shared, what is stored, and what becomes of processes that break."""

from __future__ import annotations

import csv
import io
import itertools
import json
import os
import signal
import socket
import sqlite3
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import Future
from contextlib import ExitStack, closing
from dataclasses import replace

import pytest
from tests import roads
from tests.breaking import breaking

import repair
from repair.cli import main
from repair.errors import OutputError, RepairError
from repair.progress import Progress, counted
from repair.study.engine import LocalLanes, rows_of
from repair.study.export import export
from repair.study.plan import NO_MEMORY, Study, Variation, labels_of, tasks_of
from repair.study.read import read_study
from repair.study.rows import STUDY_COLUMNS, failed_row, strict, type_of, volatile
from repair.study.run import estimate, run_study
from repair.study.store import STORE_FILE, Store
from repair.study.task import Kept, row_of, unpacked
from repair.study.worker import NOW, run_task

CONSTANT = ("constant",)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return three straight roads with a car ahead, each at another distance."""
    made = tmp_path_factory.mktemp("roads")
    for k, x in enumerate((45.0, 48.0, 380.0)):
        text = roads.scenario(obstacles=roads.driving(30, x, 0.0, 2.0), name=f"ZAM_Test-{k + 1}_1_T-1")
        (made / f"ZAM_Test-{k + 1}_1_T-1.xml").write_text(text, encoding="utf-8")
    return made


@pytest.fixture
def study(folder):
    """Return two backends and two settings of the search on them."""
    return Study(
        tuple(sorted(folder.glob("*.xml"))), ("ego", "qptr"), CONSTANT,
        tuple(Variation(f"{step}", (("search.delta_t", step),)) for step in (0.4, 0.2)),
        settings={"fallback": []}, official=False,
    )  # fmt: skip


def written(tmp_path, text):
    file = tmp_path / "study.yaml"
    file.write_text(text, encoding="utf-8")
    return file


def unknown(name):
    raise RepairError(f"{name} is unknown")


def without_times(row):
    return {name: value for name, value in row.items() if not volatile(name)}


# -- the file --------------------------------------------------------------------------------------


def test_a_grid_is_every_combination(tmp_path, folder):
    text = f"""
scenarios: [{folder}, "{folder}/*-1_1*.xml"]
references: constant
backends: [ego, casadi]
vary:
  search.delta_t: [0.4, 0.2]
  repair: {{goal: [true, false]}}
set: {{search.rule: scan}}
official: false
"""
    read = read_study(written(tmp_path, text), unknown)
    assert [v.name for v in read.variations] == [
        f"search.delta_t={step}, repair.goal={goal}" for step in ("0.4", "0.2") for goal in ("true", "false")
    ]
    assert len(read.files) == 3  # what is named twice is there once
    tasks = tasks_of(read)
    assert len(tasks) == 3 * 2 * 4
    assert len({task.key for task in tasks}) == len(tasks)
    assert {task.config.search.rule for task in tasks} == {"scan"}
    assert tasks[1].varied == {"search.delta_t": 0.4, "repair.goal": False}
    assert [task.key for task in tasks_of(read)] == [task.key for task in tasks]


def test_named_settings_stand_beside_each_other(tmp_path, folder):
    text = f"scenarios: {folder}\nvary:\n- {{name: fine, search.delta_t: 0.1}}\n- {{name: usual}}\n"
    fine, usual = tasks_of(read_study(written(tmp_path, text), unknown))[:2]
    assert (fine.variation, usual.variation) == ("fine", "usual")
    assert (fine.varied["search.delta_t"], usual.varied["search.delta_t"]) == (0.1, 0.4)


def test_relative_paths_and_names(tmp_path, folder):
    file = folder / "ZAM_Test-1_1_T-1.xml"
    (tmp_path / "here.xml").write_bytes(file.read_bytes())
    read = read_study(written(tmp_path, "scenarios: [here.xml, bundled]"), lambda name: file)
    assert [path.name for path in read.files] == ["here.xml", file.name]


def test_a_bundled_scenario_that_is_named_twice_is_taken_once(tmp_path):
    """Each time that one is looked up it is made anew, at another place."""
    from repair.paper.bundled import find_scenario

    file = written(tmp_path, "scenarios: [scenario_1, scenario_1]\n")
    with ExitStack() as kept:
        assert len(read_study(file, lambda name: kept.enter_context(find_scenario(name))).files) == 1


@pytest.mark.parametrize(
    "text, words",
    [
        ("scenarios: FOLDER\nvarry: {}", "did you mean 'vary'"),
        ("backends: [ego]", "names no scenarios"),
        ("scenarios: [nowhere]", "nowhere is unknown"),
        ("scenarios: 'FOLDER/*.yaml'", "no scenario files"),
        ("scenarios: FOLDER\nbackends: [egoo]", "'egoo' is unknown"),
        ("scenarios: FOLDER\nbackends: [ego, ego]", "twice"),
        ("scenarios: FOLDER\nreferences: [plan]", "plan"),
        ("scenarios: FOLDER\nreferences: [file]", "names no solution file"),
        ("scenarios: FOLDER\nreferences: [given]", "a study has none"),
        ("scenarios: FOLDER\nvary: {search.delta: [0.1]}", "did you mean 'search.delta_t'"),
        ("scenarios: FOLDER\nvary: {search.delta_t: [0.1, -3]}", "search.delta_t"),
        ("scenarios: FOLDER\nvary: {search.delta_t: 0.1}", "a list of values"),
        ("scenarios: FOLDER\nvary: {search.delta_t: [0.1, 0.1]}", "twice"),
        ("scenarios: FOLDER\nvary: [{search.delta_t: 0.1}]", "needs a name"),
        ("scenarios: FOLDER\nvary: [{name: a}, {name: a}]", "twice"),
        ("scenarios: FOLDER\nset: {backend: qptr}", "names backends"),
        ("scenarios: FOLDER\nset: {checker.clearence: 1}", "did you mean 'checker.clearance'"),
        ("scenarios: FOLDER\nofficial: maybe", "true or false"),
        ("scenarios: FOLDER\ntimeout: 0", "timeout is 0 s"),
        ("scenarios: FOLDER\nmemory: much", "a number"),
        ("scenarios: FOLDER\npreset: scenario_9", "scenario_9"),
        ("- a list", "mapping"),
    ],
)
def test_what_is_wrong_is_said_before_anything_runs(text, words, tmp_path, folder, capsys, monkeypatch):
    monkeypatch.setattr("repair.study.run.rows_of", lambda *_, **__: pytest.fail("it has begun"))
    monkeypatch.delenv("COMMONROAD_SCENARIOS", raising=False)
    file = written(tmp_path, text.replace("FOLDER", str(folder)))
    with pytest.raises(RepairError, match=words if words.isidentifier() else None) as told:
        tasks_of(read_study(file, unknown))
    assert words in str(told.value)
    assert main(["study", str(file), "--out", str(tmp_path / "out")]) == 2
    assert not (tmp_path / "out").exists()


def test_files_of_one_name_are_told_apart(tmp_path):
    files = [tmp_path / name for name in ("a/x.xml", "b/x.xml", "b/y.xml")]
    assert list(labels_of([*files, files[0]])) == [files[0].as_posix(), files[1].as_posix(), "y.xml"]


# -- rows ------------------------------------------------------------------------------------------


def test_what_is_shared_changes_no_row(study):
    tasks, kept = tasks_of(study)[:4], Kept()
    together = [row_of(task, kept) for task in tasks]
    for task, (row, whole) in zip(tasks, together, strict=True):
        alone, other = row_of(task, Kept())
        assert without_times(row) == without_times(alone)
        assert row["status"] in ("found", "no_conflict", "none_feasible"), row["detail"]
        mine, theirs = (unpacked(each)["record"] for each in (whole, other))
        assert mine["notes"] == theirs["notes"]
        assert mine["curve"] == theirs["curve"]
    assert len(kept.prepared) == 1  # of four rows with two backends and two settings of the search


def test_a_preparation_is_not_taken_for_another(folder):
    scene = repair.load_scene(next(folder.glob("*.xml")))
    from repair.preparation import again_for, prepare

    usual = repair.load_config(overrides=["reference.source=constant"])
    made = prepare(scene, usual)
    searched = repair.load_config(overrides=["reference.source=constant", "evasive.a_kick=7"], backend="qptr")
    again = again_for(made, searched)
    assert again.notes == prepare(scene, searched).notes
    assert again.notes != made.notes
    for changed in ("checker.clearance=0.2", "repair.horizon=3", "limits.a_max=2"):
        config = repair.load_config(overrides=["reference.source=constant", changed])
        with pytest.raises(RepairError, match="other settings"):
            again_for(made, config)


def test_types_are_kept(study):
    for task in tasks_of(study)[::5]:
        row, _ = row_of(task, Kept())
        assert all(value is None or type(value) is type_of(name) for name, value in row.items())
    far = next(task for task in tasks_of(study) if "-3_" in task.file)
    row, _ = row_of(far, Kept())
    assert (row["status"], row["ttb_s"], row["ttb_status"]) == ("no_conflict", None, "no_conflict")
    for name, value in (("f_ttr_s", "inf"), ("f_ttr_s", float("inf")), ("obstacle_id", True), ("status", 1)):
        with pytest.raises(RepairError, match=name):
            strict({name: value})


# -- the store -------------------------------------------------------------------------------------


def filled(study, folder, rows=None):
    tasks = tasks_of(study)
    with Store(folder) as store:
        store.plan(tasks)
        for task in tasks[:rows]:
            store.add(task, *row_of(task, Kept()))
    return tasks


def test_a_row_is_there_once(study, tmp_path):
    tasks = filled(replace(study, backends=("ego",)), tmp_path, 3)
    with Store(tmp_path) as store:
        assert len(list(store.rows())) == 3
        assert [task["done"] for task in store.tasks()] == [True] * 3 + [False] * 3
        with pytest.raises(OutputError, match="UNIQUE"):
            store.add(tasks[0], strict(failed_row("a", "b", "c", "crash", "")), None)
        with pytest.raises(sqlite3.IntegrityError):
            store.base.execute("UPDATE rows SET f_ttr_s = 'inf'")
        assert unpacked(store.whole(0))["record"]["backend"] == "ego"
        assert store.whole(5) is None


@pytest.mark.skipif(sys.platform == "win32", reason="signals are blocked on POSIX systems only")
def test_processes_start_deaf_to_an_interrupt(monkeypatch):
    """Ctrl-C while they import is for who starts them: each printed a traceback of its own."""

    def blocked():
        return signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])

    class Starts:
        def __init__(self, **_):
            self.heard = []

        def submit(self, *_):
            self.heard.append(not blocked())

    monkeypatch.setattr("joblib.externals.loky.ProcessPoolExecutor", Starts)
    (lane,) = LocalLanes(1).lanes
    lane.give(None)
    assert lane.executor.heard == [False, True]  # the first starts the process; then it is as before
    assert not blocked()


def test_a_store_that_another_program_holds_is_an_error_in_words(tmp_path, monkeypatch):
    monkeypatch.setattr("repair.study.store._PATIENCE", 0.01)
    with Store(tmp_path) as store, closing(sqlite3.connect(store.path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        for write in (lambda: store.tell(study="it"), lambda: store.plan(())):
            with pytest.raises(OutputError, match=r"cannot be written to .*: database is locked"):
                write()
        other.execute("ROLLBACK")
        store.tell(study="it")


def test_a_store_of_another_version_is_refused(tmp_path):
    base = sqlite3.connect(tmp_path / STORE_FILE)
    base.executescript("CREATE TABLE rows (key TEXT); CREATE TABLE about (name, value)")
    base.close()
    with pytest.raises(RepairError, match="other columns"):
        Store(tmp_path)
    (tmp_path / STORE_FILE).write_text("no database")
    with pytest.raises(RepairError, match="cannot be used"):
        Store(tmp_path)
    with pytest.raises(RepairError, match="holds no"):
        Store(tmp_path / "nowhere", readonly=True)


@pytest.mark.skipif(os.name != "posix", reason="locks of files")
def test_one_study_at_a_time_in_a_folder(folder, tmp_path, capsys, monkeypatch):
    out = tmp_path / "out"
    hold = "from pathlib import Path; import sys, time; from repair.study.store import Store; "
    hold += "store = Store(Path(sys.argv[1])); print('there', flush=True); time.sleep(600)"
    argv = ["study", str(written(tmp_path, f"scenarios: {folder}\n")), "--out", str(out), "--resume"]
    monkeypatch.setattr("repair.study.engine.LocalLanes", lambda count: Here("one"))
    with subprocess.Popen([sys.executable, "-c", hold, str(out)], stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline().strip() == b"there"
        for words in (argv, ["sweep", str(folder), "--out", str(out)]):
            assert main(words) == 2
            told = capsys.readouterr().err
            assert f"a study in {out} is running already (process {other.pid} on " in told
        assert main([*argv, "--dry-run"]) == 0  # who only looks may look
        other.send_signal(signal.SIGKILL)
        other.wait()
    assert main(argv) == 0
    assert main(argv) == 0


def test_exported_rows_hold_what_is_stored(study, tmp_path, capsys):
    filled(replace(study, backends=("ego",)), tmp_path, 3)
    assert main(["study", "export", str(tmp_path)]) == 0
    assert "3 rows of the study are not there yet" in capsys.readouterr().err
    rows = list(csv.DictReader(io.StringIO((tmp_path / "study.csv").read_text("utf-8"))))
    assert [row["search.delta_t"] for row in rows] == ["0.4", "0.2", "0.4"]
    assert set(rows[0]) == {*STUDY_COLUMNS, "search.delta_t"}
    assert not any(value in ("inf", "-inf", "nan") for row in rows for value in row.values())
    parquet = pytest.importorskip("pyarrow.parquet")
    with Store(tmp_path, readonly=True) as store:
        name, content = export(store, "parquet")
        stored = list(store.rows())
    (tmp_path / name).write_bytes(content)
    assert parquet.read_table(tmp_path / name).to_pylist() == stored


# -- the engine ------------------------------------------------------------------------------------


class Here:
    """Lanes that need no process; each answers at once."""

    def __init__(self, *names):
        self.names, self.seen, self.closed, self.memory, self.replaced = names, [], False, 100.0, []

    def now(self):
        return [self.Lane(name, self) for name in self.names]

    def close(self):
        self.closed = True

    class Lane:
        most = 280.0

        def __init__(self, name, all_of_them):
            self.name, self.all = name, all_of_them

        def give(self, task):
            self.all.seen.append((self.name, task.file))
            answer = Future()
            row = strict(failed_row(task.file, task.backend, "constant", "found", ""))
            answer.set_result((row | {NOW: self.all.memory}, None))
            return answer

        def ready(self):
            return True

        def replace(self):
            self.all.replaced.append(len(self.all.seen))
            return True


def test_a_lane_keeps_to_a_scenario(study):
    tasks, lanes = tasks_of(study), Here("one", "two")
    made = Counter(task.key for task, _ in rows_of(tasks, lanes))
    assert made == Counter(task.key for task in tasks)
    assert lanes.closed
    turns = [[file for name, file in lanes.seen if name == lane] for lane in ("one", "two")]
    assert all(sum(a != b for a, b in itertools.pairwise(t)) <= 2 for t in turns)
    assert abs(len(turns[0]) - len(turns[1])) <= 1  # who has nothing left helps


def test_a_process_that_has_grown_is_replaced_between_scenarios(study):
    tasks, lanes = tasks_of(study), Here("one")
    assert len(list(rows_of(tasks, lanes))) == 12
    assert lanes.replaced == []
    lanes.memory = 300.0
    lanes.seen.clear()
    assert len(list(rows_of(tasks, lanes))) == 12
    assert lanes.replaced == [4, 8, 12]


def test_only_what_is_missing_is_made(study, tmp_path, capsys):
    tasks = tasks_of(study)
    with Store(tmp_path) as store:
        assert estimate(tasks, store, 1) == (0, None)
        ran = run_study(tasks, store, Here("one"), limit=5, progress=False)
        assert (ran.tasks, ran.before, ran.made, ran.left) == (12, 0, 5, 7)
        again = Here("one")
        assert run_study(tasks, store, again, progress=False).made == 7
        assert len(again.seen) == 7
        assert run_study(tasks, store, Here("one"), progress=False).made == 0
        finer = replace(study, variations=(Variation("0.1", (("search.delta_t", 0.1),)),))
        assert run_study(tasks_of(finer), store, Here("one"), progress=False).made == 6
        assert len(list(store.rows())) == 6  # the table is that of the study that was run last


def test_who_is_given_more_time_is_made_again(study, tmp_path):
    """And nobody else: neither what is there, nor what another limit would end as well."""
    first, second, third, fourth = tasks_of(study)[:4]
    with Store(tmp_path) as store:
        store.plan([first, second, third, fourth])
        for task, status, detail in (
            (first, "timeout", first.too_late), (second, "memory", second.too_much), (third, "crash", "fell"),
            (fourth, "memory", NO_MEMORY),
        ):  # fmt: skip
            row = failed_row(task.file, task.backend, task.reference, status, detail)
            store.add(task, strict(row | {"variation": task.variation}), None)
        usual = [first, second, third, fourth]
        assert run_study(usual, store, Here("one"), progress=False).made == 0
        longer = [replace(task, timeout=900.0) for task in usual]
        assert estimate(longer, store, 1)[0] == 3
        assert run_study(longer, store, Here("one"), progress=False).made == 1
        larger = [replace(task, memory=9000.0) for task in longer]
        assert run_study(larger, store, Here("one"), progress=False).made == 1
        assert [row["status"] for row in store.rows()] == ["found", "found", "crash", "memory"]
        assert run_study(usual, store, Here("one"), progress=False).made == 0


def test_without_end_is_a_time(study):
    task = replace(tasks_of(study)[0], timeout=float("inf"))
    assert run_task(task, lambda task, kept: ({"file": task.file}, None))[0]["file"] == task.file


def test_a_dry_run_of_some_rows(folder, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("repair.study.engine.LocalLanes", lambda count: Here("one"))
    file = written(tmp_path, f"scenarios: {folder}\nbackends: [ego, qptr]\nofficial: false\n")
    argv = ["study", str(file), "--out", str(tmp_path / "out")]
    assert main([*argv, "--limit", "2"]) == 0
    with Store(tmp_path / "out") as store:
        store.base.execute("UPDATE rows SET row_time_s = 30.0")
    dry = [*argv, "--resume", "--dry-run"]
    capsys.readouterr()
    assert main(dry) == 0
    assert main([*dry, "--limit", "1"]) == 0
    assert main([*dry, "--dask", "tcp://127.0.0.1:9"]) == 0
    whole, one, cluster = capsys.readouterr().out.splitlines()
    assert whole.endswith("4 to make: about 120 s with 1 worker")
    assert one.endswith("4 to make, 1 of them now: about 30 s with 1 worker")
    assert cluster.endswith("by all workers of the cluster together")


def test_progress_where_nobody_watches(capsys):
    shown = Progress(10, 2)
    shown.told -= 60.0
    shown.one(broken=True)
    assert "3 of 10 rows, 1 could not be run" in capsys.readouterr().err
    assert list(counted(iter("ab"), 2, "letters")) == ["a", "b"]
    assert not capsys.readouterr().err  # it was over at once


@pytest.mark.slow
@pytest.mark.exhaustive  # it hangs on how fast processes start
def test_processes_that_break_are_rows(study, folder):
    first = tasks_of(replace(study, memory=800.0))[0]
    names = ("fine.xml", "dies.xml", "hangs.xml", "grows.xml", "also.xml")
    tasks = [replace(first, file=name, timeout=2.0 if name == "hangs.xml" else 300.0) for name in names]
    found = {task.file: row for task, (row, _) in rows_of(tasks, LocalLanes(1, breaking))}
    assert [found[name]["status"] for name in names] == ["found", "crash", "timeout", "memory", "found"]
    assert found["dies.xml"]["detail"] == "the worker process ended: SIGSEGV(-11)"
    assert found["hangs.xml"]["detail"] == "no answer within 2 s"
    assert found["grows.xml"]["detail"] == "it took more than 800 MB"


# -- killed and resumed ----------------------------------------------------------------------------


def table(out):
    with Store(out, readonly=True) as store:
        assert all(task["done"] for task in store.tasks())
        assert store.base.execute("SELECT count(*), count(DISTINCT key) FROM rows").fetchone()[:] == (12, 12)
        return [json.dumps(without_times(row)) for row in store.rows()]


def there(out):
    """How many rows are stored now."""
    try:
        base = sqlite3.connect(f"file:{out / STORE_FILE}?mode=ro", uri=True, timeout=10.0)
        with base:
            count = base.execute("SELECT count(*) FROM rows").fetchone()[0]
        base.close()
    except sqlite3.Error:
        return 0
    return count


def stopped(file, out, number, rows):
    """Start or go on, and send a signal when there are as many rows."""
    argv = [sys.executable, "-W", "ignore", "-m", "repair", "study", str(file), "--out", str(out), "--resume"]
    with subprocess.Popen(argv, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
        until = time.monotonic() + 120.0
        while there(out) < rows and process.poll() is None and time.monotonic() < until:
            time.sleep(0.01)
        process.send_signal(number)
        _, said = process.communicate(timeout=60.0)
    return process.returncode, said.decode()


def killed(folder, tmp_path, study, signals):
    text = f"scenarios: {folder}\nbackends: [ego, qptr]\nreferences: constant\nofficial: false\n"
    more = "set: {fallback: []}\nvary: {search.delta_t: [0.4, 0.2]}\n"
    file = written(tmp_path, text + more)
    whole, out = tmp_path / "whole", tmp_path / "out"
    with Store(whole) as store:
        tasks = tasks_of(read_study(file, unknown))
        store.plan(tasks)
        for task in tasks:
            store.add(task, *row_of(task, Kept()))
    for k, number in enumerate(signals):
        status, said = stopped(file, out, number, 1 + k * 11 // len(signals))
        if number == signal.SIGINT:
            assert status == 130
            assert "--resume goes on" in said
        else:
            assert status == -number
    assert main(["study", str(file), "--out", str(out), "--resume"]) == 0
    assert table(out) == table(whole)


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.exhaustive  # it hangs on how fast processes start
def test_killed_it_goes_on(folder, tmp_path, study):
    killed(folder, tmp_path, study, [signal.SIGKILL])


def test_interrupted_it_keeps_what_it_has(folder, tmp_path, study, capsys, monkeypatch):
    class Interrupted(Here):
        def now(self):
            if len(self.seen) == 4:
                raise KeyboardInterrupt
            return super().now()

    text = f"scenarios: {folder}\nbackends: [ego, qptr]\nofficial: false\n"
    argv = ["study", str(written(tmp_path, text)), "--out", str(tmp_path / "out")]
    monkeypatch.setattr("repair.study.engine.LocalLanes", lambda count: Interrupted("one"))
    assert main(argv) == 130
    assert "4 of 6 rows are stored" in capsys.readouterr().err
    monkeypatch.setattr("repair.study.engine.LocalLanes", lambda count: Here("one"))
    assert main(argv) == 2
    assert "--resume goes on" in capsys.readouterr().err
    assert main([*argv, "--resume", "--dry-run"]) == 0
    assert "6 rows, 4 of them there, 2 to make" in capsys.readouterr().out
    assert main([*argv, "--resume"]) == 0
    assert "2 rows made, 4 were there" in capsys.readouterr().out


@pytest.mark.exhaustive
def test_killed_five_times_and_interrupted_twice(folder, tmp_path, study):
    killed(
        folder,
        tmp_path,
        study,
        [signal.SIGKILL] * 3 + [signal.SIGINT] + [signal.SIGKILL] * 2 + [signal.SIGINT],
    )


# -- a cluster -------------------------------------------------------------------------------------


def test_a_cluster_that_is_not_there(folder, tmp_path, capsys, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("repair.study.cluster._FOUND", 0.2)
    argv = ["study", str(written(tmp_path, f"scenarios: {folder}\n")), "--out", str(tmp_path / "out")]
    assert main([*argv, "--dask", "tcp://127.0.0.1:9"]) == 2
    assert "no Dask cluster can be used at tcp://127.0.0.1:9" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    assert main([*argv, "--dask", "tcp://127.0.0.1:9", "--workers", "2"]) == 2


@pytest.mark.exhaustive
def test_a_cluster_that_loses_a_worker_gives_the_same_table(folder, tmp_path):
    pytest.importorskip("distributed")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    file = written(
        tmp_path,
        f"scenarios: {folder}\nbackends: [ego, qptr]\nreferences: constant\nofficial: false\n"
        "set: {fallback: []}\nvary: {search.delta_t: [0.4, 0.2]}\n",
    )
    start = [sys.executable, "-W", "ignore", "-m"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path}
    port = address.rpartition(":")[2]
    with ExitStack() as ended:

        def run(*argv):
            process = subprocess.Popen([*start, *argv], **quiet)
            ended.callback(process.wait)
            ended.callback(process.kill)
            return process

        run("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard")
        worker = ["distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard"]
        run(*worker)
        lost = run(*worker)
        out = tmp_path / "out"
        for _ in range(6):  # until scheduler and worker are there
            study = run("repair", "study", str(file), "--out", str(out), "--resume", "--dask", address)
            while there(out) < 4 and study.poll() is None:
                time.sleep(0.02)
            if there(out):
                break
        lost.kill()
        assert study.wait(300) == 0
    whole = tmp_path / "whole"
    assert main(["study", str(file), "--out", str(whole)]) == 0
    assert table(out) == table(whole)
