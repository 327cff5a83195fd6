"""A planner of commonroad-io whose plans are repaired."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from commonroad.planning.planner_interface import TrajectoryPlannerInterface

from repair.api import RepairResult, repair
from repair.config.load import load_config
from repair.config.schema import Config
from repair.errors import ConfigError, ReferenceTrajectoryError, foreign, kind_of
from repair.scene.commonroad import scene_from_scenario

if TYPE_CHECKING:
    import numpy.typing as npt

__all__ = ["RepairingPlanner"]


class RepairingPlanner(TrajectoryPlannerInterface):  # type: ignore[misc]  # commonroad-io has no types
    """Asks another planner for its trajectory, and repairs it.

    Parameters
    ----------
    nominal : TrajectoryPlannerInterface
        Its trajectories begin at the planning problem's initial state.
    config : Config, optional
        See :func:`repair.load_config`.
    **keys
        Configuration keys where no ``config`` is given: ``preset=``, ``backend=``, ``overrides=``.

    Attributes
    ----------
    result : RepairResult or None
        Of the last call: its status says whether the trajectory is safe to drive.

    Raises
    ------
    ConfigError
        If that is no planner, or the configuration cannot be used.
    """

    def __init__(self, nominal: Any, config: Config | None = None, **keys: Any) -> None:
        if not callable(getattr(nominal, "plan", None)):
            raise ConfigError(f"a planner with a method plan is expected, not {kind_of(nominal)}")
        if config is not None and keys:
            raise ConfigError("give either a config or configuration keys, not both")
        config = load_config(**keys) if config is None else config
        if not isinstance(config, Config):
            raise ConfigError(f"config has to come from repair.load_config, and is {kind_of(config)}")
        self.nominal, self.config = nominal, config
        self.result: RepairResult | None = None

    def plan(self, sc: Any, pp: Any, ref_path: npt.NDArray[Any] | None = None) -> Any:
        """The other planner's trajectory, repaired where it runs into a conflict.

        Parameters
        ----------
        sc : commonroad.scenario.scenario.Scenario
        pp : commonroad.planning.planning_problem.PlanningProblem
        ref_path : (M, 2) array, optional
            A path [m], handed on.

        Returns
        -------
        commonroad.scenario.trajectory.Trajectory
            Of KS states. Where no repair is found it is the other planner's, and ``result`` says so.

        Raises
        ------
        RepairError
            If scenario or trajectory cannot be used, or the other planner fails.
        """
        with foreign(f"planning by {type(self.nominal).__name__}", ReferenceTrajectoryError):
            planned = self.nominal.plan(sc, pp, ref_path)
        if planned is None:  # which would ask for a reference of our own
            raise ReferenceTrajectoryError(f"{type(self.nominal).__name__} has planned nothing")
        if isinstance(planned, str | Path):  # which would name a reference of our own, or a file
            raise ReferenceTrajectoryError(
                f"{type(self.nominal).__name__} has planned {kind_of(planned)}, which is no trajectory"
            )
        scene = scene_from_scenario(sc, pp, self.config)
        self.result = repair(scene, self.config, reference=planned)
        return self.result.trajectory
