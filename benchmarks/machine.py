"""What the figures were measured on."""

from __future__ import annotations

import os
import platform
import sys
from importlib.metadata import PackageNotFoundError, version
from typing import Any

PACKAGES = (
    "commonroad-repair", "numpy", "scipy", "casadi", "qpsolvers", "osqp", "daqp", "clarabel", "shapely",
    "commonroad-io", "commonroad-drivability-checker",
)  # fmt: skip


def describe() -> dict[str, Any]:
    """Machine, load, threads and versions."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "python": sys.version.split()[0],
        "load_average": list(os.getloadavg()) if hasattr(os, "getloadavg") else None,
        "blas": _blas(),
        "versions": {name: _version(name) for name in PACKAGES},
    }


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            for line in file:
                if line.startswith("model name"):
                    return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed" if name != "commonroad-repair" else "from the sources"


def _blas() -> list[str]:
    """Each BLAS in the process and its threads, where threadpoolctl is installed."""
    import numpy  # noqa: F401
    import scipy.linalg  # noqa: F401

    try:
        from threadpoolctl import threadpool_info
    except ImportError:
        return [f"OPENBLAS_NUM_THREADS={os.environ.get('OPENBLAS_NUM_THREADS')}"]
    return [
        f"{i['internal_api']} {i.get('version')}, {i['num_threads']} thread(s)" for i in threadpool_info()
    ]
