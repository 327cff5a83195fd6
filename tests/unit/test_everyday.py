"""Everyday use of the command: how much it says, and what a shell completes."""

from __future__ import annotations

import logging
import subprocess
import sys

import pytest

from repair.cli import main


@pytest.fixture(autouse=True)
def _alone(monkeypatch):
    """No folder of scenarios, and the logger of the project as it was."""
    monkeypatch.delenv("COMMONROAD_SCENARIOS", raising=False)
    logger = logging.getLogger("repair")
    handlers, level = logger.handlers, logger.level
    yield
    logger.handlers, logger.level = handlers, level
    logger.setLevel(level)


def test_quiet_is_the_answer_alone(capsys):
    assert main(["run", "scenario_1", "--quiet"]) == 0
    out, err = capsys.readouterr()
    assert [line.split()[0] for line in out.splitlines()] == [
        "Scenario", "Backend", "Status", "TTC", "F-TTR", "Repair",
    ]  # fmt: skip
    assert err == ""
    assert main(["run", "scenario_1", "--quiet", "--json"]) == 2


def test_verbose_is_python_logging_on_standard_error():
    """In a process of its own: import-linter, in test_architecture.py, switches loggers off."""
    command = [sys.executable, "-m", "repair", "run", "scenario_1", "-vv", "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    said = [line for line in done.stderr.splitlines() if line.startswith("repair.")]
    assert sum("t_rep" in line for line in said) == 4  # as many as the table has rows
    assert sum("4 feasible" in line for line in said) == 1
    assert any("conflict margin at 2.9 s" in line for line in said)
    assert "t_rep" not in done.stdout


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_a_shell_completes_verbs_and_options(shell, capsys):
    pytest.importorskip("shtab")
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert all(word in script for word in ("certify", "--reference", "scenarios"))
    if shell == "bash":
        ask = "COMP_WORDS=(repair ce); COMP_CWORD=1; _shtab_repair; echo ${COMPREPLY[*]}"
        done = subprocess.run(["bash", "-c", f"{script}\n{ask}"], capture_output=True, text=True, check=True)
        assert done.stdout.split() == ["certify"]
