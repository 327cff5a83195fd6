"""Files of a result: whole or not there, one set at a time, whoever else writes into the folder."""

from __future__ import annotations

import fcntl
import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from repair.errors import OutputError
from repair.io import files as module
from repair.io.files import write_files

NAMES = ("result.json", "solution_A.xml", "drawing.json", "profiles.png")


def content(mark: str) -> dict[str, bytes]:
    """A set whose files all say to which one they belong."""
    return {name: json.dumps({"mark": mark, "fill": mark * 200}).encode() for name in NAMES}


def marks(folder: Path) -> set[str]:
    return {json.loads((folder / name).read_bytes())["mark"] for name in NAMES}


def save_often(folder: Path, who: str, times: int = 30) -> list[str]:
    """Save again and again; every set is looked at while the folder is held."""
    failures = []
    for k in range(times):
        try:
            write_files(folder, content(f"{who}-{k}"), ["stale.txt"])
            with module._alone(folder):
                found = marks(folder)
            if len(found) != 1:
                failures.append(f"mixed: {sorted(found)}")
        except Exception as error:
            failures.append(repr(error))
    return failures


def test_the_files_are_there_and_nothing_else(tmp_path):
    (tmp_path / "stale.txt").write_text("old")
    paths = write_files(tmp_path, content("a"), ["stale.txt", "never.txt"])
    assert [p.name for p in paths] == list(NAMES)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(NAMES)
    write_files(tmp_path, content("b"))
    assert marks(tmp_path) == {"b"}
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(NAMES)


def test_one_file_alone(tmp_path):
    assert write_files(tmp_path / "x" / "y", {"table.csv": b"1"}) == [tmp_path / "x" / "y" / "table.csv"]


def test_four_threads_save_into_one_folder(tmp_path):
    folder = tmp_path / "out"  # which none of them has made
    failures: list[str] = []
    threads = [
        threading.Thread(target=lambda k=k: failures.extend(save_often(folder, f"t{k}"))) for k in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failures == []
    assert len(marks(folder)) == 1
    assert sorted(p.name for p in folder.iterdir()) == sorted(NAMES)


def test_two_processes_save_into_one_folder(tmp_path):
    folder = tmp_path / "out"
    code = (
        "import sys; from pathlib import Path; from tests.unit.test_files import save_often; "
        "print(save_often(Path(sys.argv[1]), sys.argv[2]))"
    )
    root = Path(__file__).parents[2]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, [str(root), *sys.path]))}
    running = [
        subprocess.Popen(
            [sys.executable, "-c", code, str(folder), f"p{k}"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=root, env=environment,
        )
        for k in range(2)
    ]  # fmt: skip
    for process in running:
        out, err = process.communicate(timeout=120)
        assert (out.strip(), process.returncode) == ("[]", 0), err
    assert len(marks(folder)) == 1
    assert sorted(p.name for p in folder.iterdir()) == sorted(NAMES)


def test_what_names_the_others_never_stands_beside_those_of_another_set(tmp_path, monkeypatch):
    write_files(tmp_path, content("a"))
    seen = []
    replace = os.replace

    def watched(source, target):
        replace(source, target)
        there = {n: json.loads((tmp_path / n).read_bytes())["mark"] for n in NAMES if (tmp_path / n).exists()}
        seen.append((there.get("result.json"), set(there.values())))

    monkeypatch.setattr(module.os, "replace", watched)
    write_files(tmp_path, content("b"))
    assert len(seen) >= len(NAMES)
    assert all(first is None or everything == {first} for first, everything in seen)


def test_where_nothing_could_be_replaced_all_stays_as_it_was(tmp_path):
    write_files(tmp_path, content("a"))
    (tmp_path / "z_blocked").mkdir()
    new = content("b")
    with pytest.raises(OutputError, match="cannot be written"):
        write_files(tmp_path, {"result.json": new["result.json"], "z_blocked": b"x", **new})
    assert marks(tmp_path) == {"a"}
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([*NAMES, "z_blocked"])


def test_a_set_that_is_replaced_in_part_has_no_file_that_names_it(tmp_path, monkeypatch):
    write_files(tmp_path, content("a"))
    rename = os.replace

    def full(source, target):
        if Path(target).name == NAMES[-1]:
            raise OSError(28, "No space left on device")
        rename(source, target)

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OutputError, match="cannot be written"):
        write_files(tmp_path, content("b"))
    assert not (tmp_path / "result.json").exists()
    assert not [p for p in tmp_path.iterdir() if p.name.startswith(".")]


def test_who_keeps_the_folder_to_himself_is_waited_for_and_then_named(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_PATIENCE", 0.05)
    handle = os.open(tmp_path, os.O_RDONLY)
    fcntl.flock(handle, fcntl.LOCK_EX)
    try:
        with pytest.raises(OutputError, match=r"another process has been writing there for 0\.05 s"):
            write_files(tmp_path, content("a"))
        assert list(tmp_path.iterdir()) == []
    finally:
        os.close(handle)
    write_files(tmp_path, content("a"))  # the lock went with its holder
    assert marks(tmp_path) == {"a"}


def test_a_file_system_without_locks_does(tmp_path, monkeypatch):
    def none(handle, operation):
        raise OSError(38, "Function not implemented")

    monkeypatch.setattr(module.fcntl, "flock", none)
    write_files(tmp_path, content("a"))
    assert marks(tmp_path) == {"a"}
