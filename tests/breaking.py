"""Rows that break the process which makes them; found by worker processes under this name."""

from __future__ import annotations

import os
import signal
import time
from functools import partial

from repair.study.rows import failed_row, strict
from repair.study.worker import run_task


def broken(task, kept):
    """What the name of the scenario says."""
    if task.file == "dies.xml":
        os.kill(os.getpid(), signal.SIGSEGV)
    if task.file == "hangs.xml":
        time.sleep(600.0)
    if task.file == "grows.xml":
        taken = []
        while True:
            taken.append(bytearray(2**24))
            taken[-1][::4096] = b"x" * len(taken[-1][::4096])
            time.sleep(0.005)
    return strict(failed_row(task.file, task.backend, task.reference, "found", "")), None


breaking = partial(run_task, make=broken)
