"""What all tests share: one thread, reproducible Hypothesis, and the folder of CommonRoad files."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

# Nothing has imported NumPy yet. A second BLAS thread makes the small dense algebra here slower, not faster.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["MPLBACKEND"] = "Agg"

# Now: a test may change the environment before the first one asks.
_SCENARIOS = os.environ.get("COMMONROAD_SCENARIOS")

settings.register_profile("repair", derandomize=True, deadline=None, max_examples=30)
settings.load_profile("repair")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what reads scenario files, and what is left to `-m exhaustive`.

    Of the cases of a test that is `thinned(k)` every k-th runs by default, from the first on.
    """
    seen: dict[str, int] = {}
    for item in items:
        if "scenarios" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.scenarios)
        thinned = item.get_closest_marker("thinned")
        if thinned is not None:
            name = item.nodeid.partition("[")[0]
            seen[name] = seen.get(name, -1) + 1
            if seen[name] % thinned.args[0]:
                item.add_marker(pytest.mark.exhaustive)


@pytest.fixture(scope="session")
def scenarios() -> Path:
    """Return the folder COMMONROAD_SCENARIOS of CommonRoad files; without it skip, or fail when CI is set."""
    value = _SCENARIOS
    if value and any(Path(value).glob("*.xml")):
        return Path(value).resolve()
    problem = f"no *.xml file in COMMONROAD_SCENARIOS={value}" if value else "COMMONROAD_SCENARIOS is not set"
    if os.environ.get("CI", "").lower() in ("", "0", "false"):
        pytest.skip(problem)
    pytest.fail(f"{problem}, and CI is set", pytrace=False)
