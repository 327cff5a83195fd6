"""No backend's search has become slower, against the literal transcription that is measured beside it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from benchmarks import guard
from benchmarks.processes import environment


@pytest.mark.slow
def test_ratios_have_not_fallen() -> None:
    # In its own process: one BLAS thread, and no tracing (coverage would slow the literal loops most of all).
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.guard"],
        cwd=Path(guard.__file__).parent.parent,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_guard_sees_what_it_should() -> None:
    recorded = json.loads(guard.RATIOS.read_text(encoding="utf-8"))["ratios"]
    assert set(recorded) == set(guard.BACKENDS)
    assert not guard.fallen(recorded, recorded)
    assert not guard.fallen({name: 0.7 * value for name, value in recorded.items()}, recorded)
    halved = recorded | {"ego": 0.5 * recorded["ego"]}
    assert guard.fallen(halved, recorded) == ["ego"]
