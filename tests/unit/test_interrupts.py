"""Ctrl-C after the search: what was found is printed and written."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import repair

_AT = {
    "figures": "import repair.report.profiles as module; name = 'profile_figure'",
    "files": "import repair.save as module; name = 'write_files'",
    "states": "import repair.check.checker as it; module = it.Checker; name = 'peaks'",
}


def run_interrupted(moment: str, times: int, folder: Path) -> subprocess.CompletedProcess[str]:
    """``repair run`` in a process of its own, with so many Ctrl-C whenever a function is called."""
    code = f"""
import os, signal, sys
{_AT[moment]}
real = getattr(module, name)
def interrupted(*arguments, **keys):
    for _ in range({times}):
        os.kill(os.getpid(), signal.SIGINT)
    return real(*arguments, **keys)
setattr(module, name, interrupted)
from repair.cli.command import entry
sys.argv = ["repair", "run", "--json", "--out", sys.argv[1]]
entry()
"""
    source = str(Path(repair.__file__).parents[1])
    environment = {**os.environ, "PYTHONPATH": source, "MPLBACKEND": "Agg"}
    environment.pop("COMMONROAD_SCENARIOS", None)
    return subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code, str(folder)],
        check=False, capture_output=True, text=True, timeout=120, env=environment,
    )  # fmt: skip


@pytest.mark.thinned(3)
@pytest.mark.parametrize("moment", _AT)
def test_an_interrupt_after_the_search_loses_nothing(moment, tmp_path):
    folder = tmp_path / "out"
    ran = run_interrupted(moment, 1, folder)
    assert ran.returncode == 130, ran.stderr
    printed = json.loads(ran.stdout)
    assert printed["status"] == "found"
    written = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    assert written["f_ttr_s"] == printed["f_ttr_s"]
    for name in written["figure_files"]:
        assert (folder / name).is_file()
    assert "interrupted" in ran.stderr


def test_a_second_interrupt_ends_the_writing_and_not_the_printing(tmp_path):
    folder = tmp_path / "out"
    ran = run_interrupted("figures", 2, folder)
    assert ran.returncode == 130, ran.stderr
    assert json.loads(ran.stdout)["status"] == "found"
    assert not folder.exists() or not list(folder.iterdir())
