"""A search of one file by whatever version is imported: warm, everything built before.

It runs under this version and under earlier ones. Reads pickled requests, writes pickled answers.
"""

from __future__ import annotations

import contextlib
import math
import pickle
import sys
import time
import warnings
from typing import Any

from repair.api import find
from repair.config import load_config
from repair.errors import RepairError
from repair.preparation import prepare
from repair.scene.commonroad import load_scene
from repair.solvers.registry import make_backend


def searched(file: str, backend: str, keys: list[str]) -> tuple[str, float | None, float]:
    """Status, F-TTR [s], and the processor time of a warm search [s]; NaN where there is none."""
    try:
        config = load_config(backend=backend, overrides=keys)
        prepared = prepare(load_scene(file, config), config)
        if not math.isfinite(prepared.conflict.time):
            return "no_conflict", None, math.nan
        maker = make_backend(backend, config)
        find(prepared, maker)
        begin = time.process_time()
        found = find(prepared, maker)
        spent = time.process_time() - begin
    except RepairError as error:
        return f"error: {error}", None, math.nan
    return str(found.status.value), found.f_ttr, spent


def main() -> int:
    """Answer requests until there are none."""
    warnings.simplefilter("ignore")
    requests, answers = sys.stdin.buffer, sys.stdout.buffer
    with contextlib.redirect_stdout(sys.stderr):
        while True:
            try:
                request: tuple[Any, ...] = pickle.load(requests)
            except EOFError:
                return 0
            pickle.dump(searched(*request), answers)
            answers.flush()


if __name__ == "__main__":
    sys.exit(main())
