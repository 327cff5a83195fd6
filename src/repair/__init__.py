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
    from repair.api import RepairResult, repair
    from repair.backend.base import (
        BackendSpec,
        Capabilities,
        Closest,
        RepairBackend,
        SolveResult,
        SolveStatus,
    )
    from repair.bounds.latest import Bound, bound
    from repair.check.registry import register as register_check
    from repair.check.verdict import Conflict, Reason, Verdict
    from repair.config import Config, load_config, preset_names
    from repair.curves.base import FrenetTrajectory
    from repair.curves.bspline import UniformBSpline
    from repair.cycle import Cycle, Repairer
    from repair.cycle.planner import RepairingPlanner
    from repair.errors import (
        BackendError,
        ConfigError,
        OutputError,
        ReferenceTrajectoryError,
        RepairError,
        ScenarioError,
    )
    from repair.io.result_json import load_result
    from repair.metrics.registry import register as register_metric
    from repair.mitigation.mitigate import Mitigation, mitigate
    from repair.outcome.data import Outcome
    from repair.preparation import Prepared, prepare
    from repair.problem.problem import Maneuver, RepairProblem
    from repair.reference.registry import register as register_reference
    from repair.report.style import FigureStyle
    from repair.save import register as register_format
    from repair.scene.commonroad import load_scene, scene_from_scenario, with_traffic
    from repair.scene.scene import Scene
    from repair.scene.traffic.prediction import Prediction, predictions_of
    from repair.search.modes import ModeResult
    from repair.search.result import Probe, SearchResult, SearchStatus
    from repair.situation import Situation
    from repair.solvers.registry import available as available_backends
    from repair.solvers.registry import backend_names
    from repair.solvers.registry import register as register_backend
    from repair.vehicle.model import register as register_vehicle
    from repair.why.explain import Explanation, explain

    __version__: str

__all__ = [
    "BackendError",
    "BackendSpec",
    "Bound",
    "Capabilities",
    "Closest",
    "Config",
    "ConfigError",
    "Conflict",
    "Cycle",
    "Explanation",
    "FigureStyle",
    "FrenetTrajectory",
    "Maneuver",
    "Mitigation",
    "ModeResult",
    "Outcome",
    "OutputError",
    "Prediction",
    "Prepared",
    "Probe",
    "Reason",
    "ReferenceTrajectoryError",
    "RepairBackend",
    "RepairError",
    "RepairProblem",
    "RepairResult",
    "Repairer",
    "RepairingPlanner",
    "ScenarioError",
    "Scene",
    "SearchResult",
    "SearchStatus",
    "Situation",
    "SolveResult",
    "SolveStatus",
    "UniformBSpline",
    "Verdict",
    "__version__",
    "available_backends",
    "backend_names",
    "bound",
    "explain",
    "load_config",
    "load_result",
    "load_scene",
    "mitigate",
    "predictions_of",
    "prepare",
    "preset_names",
    "register_backend",
    "register_check",
    "register_format",
    "register_metric",
    "register_reference",
    "register_vehicle",
    "repair",
    "scene_from_scenario",
    "with_traffic",
]

_NAMES: dict[str, tuple[str, ...]] = {
    "repair.api": ("RepairResult", "repair"),
    "repair.backend.base": (
        "BackendSpec", "Capabilities", "Closest", "RepairBackend", "SolveResult", "SolveStatus",
    ),
    "repair.bounds.latest": ("Bound", "bound"),
    "repair.mitigation.mitigate": ("Mitigation", "mitigate"),
    "repair.check.verdict": ("Conflict", "Reason", "Verdict"),
    "repair.config": ("Config", "load_config", "preset_names"),
    "repair.curves.base": ("FrenetTrajectory",),
    "repair.cycle": ("Cycle", "Repairer"),
    "repair.cycle.planner": ("RepairingPlanner",),
    "repair.curves.bspline": ("UniformBSpline",),
    "repair.errors": (
        "BackendError", "ConfigError", "OutputError", "ReferenceTrajectoryError", "RepairError",
        "ScenarioError",
    ),
    "repair.outcome.data": ("Outcome",),
    "repair.preparation": ("Prepared", "prepare"),
    "repair.io.result_json": ("load_result",),
    "repair.report.style": ("FigureStyle",),
    "repair.problem.problem": ("Maneuver", "RepairProblem"),
    "repair.search.modes": ("ModeResult",),
    "repair.scene.commonroad": ("load_scene", "scene_from_scenario", "with_traffic"),
    "repair.scene.scene": ("Scene",),
    "repair.scene.traffic.prediction": ("Prediction", "predictions_of"),
    "repair.search.result": ("Probe", "SearchResult", "SearchStatus"),
    "repair.situation": ("Situation",),
    "repair.solvers.registry": ("backend_names",),
    "repair.why.explain": ("Explanation", "explain"),
}  # fmt: skip
# public name -> (module, name in it)
_HOME = {name: (module, name) for module, names in _NAMES.items() for name in names}
_HOME["available_backends"] = ("repair.solvers.registry", "available")
_HOME |= {
    f"register_{kind}": (module, "register")
    for kind, module in {
        "backend": "repair.solvers.registry",
        "check": "repair.check.registry",
        "format": "repair.save",
        "metric": "repair.metrics.registry",
        "reference": "repair.reference.registry",
        "vehicle": "repair.vehicle.model",
    }.items()
}


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
