"""Trajectory repair on CommonRoad scenarios: the latest moment to react, and an executable plan from there.

>>> import repair
>>> scene = repair.load_scene("DEU_Flensburg-6_1_T-1.xml")            # doctest: +SKIP
>>> result = repair.repair(scene, preset="scenario_1")                # doctest: +SKIP
>>> result.f_ttr, result.trajectory                                   # doctest: +SKIP

The names below are imported when they are first asked for; ``import repair`` itself costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from repair.api import Prepared, RepairResult, prepare, repair
    from repair.bspline import UniformBSpline
    from repair.config import Config, load_config, preset_names
    from repair.errors import (
        BackendError,
        ConfigError,
        OutputError,
        ReferenceTrajectoryError,
        RepairError,
        ScenarioError,
    )
    from repair.scene.commonroad import Scene, load_scene, scene_from_scenario
    from repair.solvers.registry import available as available_backends
    from repair.solvers.registry import backend_names
    from repair.solvers.registry import register as register_backend
    from repair.types import (
        Conflict,
        FrenetTrajectory,
        Maneuver,
        Probe,
        Reason,
        RepairBackend,
        RepairProblem,
        SearchResult,
        SearchStatus,
        SolveResult,
        SolveStatus,
        Verdict,
    )

    __version__: str

__all__ = [
    "BackendError",
    "Config",
    "ConfigError",
    "Conflict",
    "FrenetTrajectory",
    "Maneuver",
    "OutputError",
    "Prepared",
    "Probe",
    "Reason",
    "ReferenceTrajectoryError",
    "RepairBackend",
    "RepairError",
    "RepairProblem",
    "RepairResult",
    "ScenarioError",
    "Scene",
    "SearchResult",
    "SearchStatus",
    "SolveResult",
    "SolveStatus",
    "UniformBSpline",
    "Verdict",
    "__version__",
    "available_backends",
    "backend_names",
    "load_config",
    "load_scene",
    "prepare",
    "preset_names",
    "register_backend",
    "repair",
    "scene_from_scenario",
]

_NAMES: dict[str, tuple[str, ...]] = {
    "repair.api": ("Prepared", "RepairResult", "prepare", "repair"),
    "repair.bspline": ("UniformBSpline",),
    "repair.config": ("Config", "load_config", "preset_names"),
    "repair.errors": (
        "BackendError", "ConfigError", "OutputError", "ReferenceTrajectoryError", "RepairError",
        "ScenarioError",
    ),
    "repair.scene.commonroad": ("Scene", "load_scene", "scene_from_scenario"),
    "repair.solvers.registry": ("backend_names",),
    "repair.types": (
        "Conflict", "FrenetTrajectory", "Maneuver", "Probe", "Reason", "RepairBackend", "RepairProblem",
        "SearchResult", "SearchStatus", "SolveResult", "SolveStatus", "Verdict",
    ),
}  # fmt: skip
# public name -> (module, name in it)
_HOME = {name: (module, name) for module, names in _NAMES.items() for name in names}
_HOME["available_backends"] = ("repair.solvers.registry", "available")
_HOME["register_backend"] = ("repair.solvers.registry", "register")


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import PackageNotFoundError, version

        try:
            value: Any = version("commonroad-repair")
        except PackageNotFoundError:  # run from a checkout that is not installed
            value = "unknown"
    elif name in _HOME:
        module, attribute = _HOME[name]
        value = getattr(import_module(module), attribute)
    else:
        raise AttributeError(f"module 'repair' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
