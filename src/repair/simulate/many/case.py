"""A file made ready for its drives: plans, shifts and beliefs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from repair.config.load import load_config
from repair.config.schema import Config, wanted_beside
from repair.curves.base import Curve
from repair.errors import ConfigError
from repair.preparation import Prepared, among, prepare
from repair.scene.road.lanes import lanes_of
from repair.scene.scene import Scene
from repair.simulate.data import Driven
from repair.simulate.drive import drive
from repair.simulate.eyes import Grounds
from repair.simulate.policies.registry import make_policy
from repair.simulate.predictions.network import Network
from repair.simulate.predictions.registry import make_predictor
from repair.simulate.watch import Watch
from repair.simulate.world import Beliefs, World
from repair.timegrid import steps_until

__all__ = ["Case", "Plan", "case_at", "plan_on", "simulation_config"]

_LOOKAHEAD = 5.0  # where the configuration does not say [s]
_LEAST = 1.0  # a drive that is shorter says nothing [s]
_GRID = 0.1  # the F-TTR is looked for on this grid, at least a step [s]
#: What a simulation has where nothing else is asked for: cycles are short.
USUAL: dict[str, Any] = {
    "fallback": [], "search.rule": "guided", "search.delta_t": _GRID, "search.sides": "first",
    "checker.terminal": "off", "checker.official": "never", "repair.widen": [], "repair.narrow": [],
    "repair.ease": [],
}  # fmt: skip


def simulation_config(
    preset: str | None = None, file: str | Path | None = None, overrides: Any = (), **named: Any
) -> Config:
    """As :func:`repair.load_config`, where nothing else is asked for with what makes cycles short.

    Raises
    ------
    ConfigError
        If a key is misspelt, out of range, or of no use in a simulation.
    """
    asked = load_config(preset, file, overrides, **named)
    usual = {key: value for key, value in USUAL.items() if key not in asked.given}
    config = load_config(preset, file, overrides, **named) if not usual else _over(asked, usual)
    if config.driver != "f_ttr":
        raise ConfigError(f"a simulation searches for the F-TTR; driver={config.driver} has no effect in it")
    if beside := [key for key in wanted_beside(config) if key in config.given]:
        raise ConfigError(f"{beside[0]} has no effect in a simulation, whose cycles look at the search alone")
    wrong = [a for a in config.simulate.gentle if a <= 0.0]
    if wrong:
        raise ConfigError(f"simulate.gentle holds {wrong[0]:g} m/s²; friction limits are positive")
    return config


def _over(config: Config, values: dict[str, Any]) -> Config:
    """Values laid under what was asked for."""
    made = replace(
        config,
        **{k: v for k, v in values.items() if "." not in k},
        **{
            section: replace(
                getattr(config, section),
                **{k.partition(".")[2]: v for k, v in values.items() if k.startswith(f"{section}.")},
            )
            for section in {k.partition(".")[0] for k in values if "." in k}
        },
    )
    made.given = config.given
    return made


@dataclass(eq=False)
class Plan:
    """A plan on a road, ready to be driven.

    Attributes
    ----------
    name : str
        The source of the reference.
    prepared : Prepared
    n_steps : int
        As long as it can be driven where nobody else is, and as something is known.
    hard : Watch
    gentle : tuple of Watch
    """

    name: str
    prepared: Prepared
    n_steps: int
    hard: Watch
    gentle: tuple[Watch, ...]

    @property
    def scene(self) -> Scene:
        """In whose frame it is."""
        return self.prepared.scene


@dataclass(eq=False)
class Case:
    """A plan among the traffic that begins so much later.

    Attributes
    ----------
    plan : Plan
    world : World
    config : Config
    never : Driven
        The plan, whatever happens.
    """

    plan: Plan
    world: World
    config: Config
    never: Driven

    @property
    def curve(self) -> Curve:
        """The plan."""
        return self.plan.prepared.reference

    def grounds(self, prediction: str) -> Grounds:
        """With a prediction. Made anew for each drive: its cycles pay for all that they look at."""
        return _grounds(self.plan, self.world, self.config, prediction)

    def drive(self, prediction: str, policy: str) -> Driven:
        """The drive."""
        return drive(self.grounds(prediction), self.curve, make_policy(policy, self.config.simulate))


def _grounds(plan: Plan, world: World, config: Config, prediction: str) -> Grounds:
    predictor, lookahead = make_predictor(prediction, config.simulate), config.simulate.lookahead
    if lookahead is None:
        lookahead = world.n_steps * world.dt if getattr(predictor, "to_the_end", False) else _LOOKAHEAD
    beliefs = Beliefs(world, predictor, max(steps_until(lookahead, world.dt), 3))
    return Grounds(plan.scene, config, beliefs, plan.hard, plan.gentle)


def plan_on(scene: Scene, config: Config) -> Plan:
    """The plan that ``reference.source`` names, on a scene.

    It is looked at where nobody else is: where it leaves the road or cannot be driven it ends, since that is
    no conflict with traffic.

    Raises
    ------
    RepairError
        If no reference can be had.
    """
    if "search.delta_t" not in config.given:
        grid = scene.dt * max(np.ceil(_GRID / scene.dt - 1e-9), 1.0)
        config = _over(config, {"search.delta_t": float(grid)})
    prepared = prepare(scene, config)
    alone = among(prepared, ())
    end = min(alone.conflict.time, prepared.t_reference)
    gentle = tuple(
        Watch(prepared.scene, _over(config, {"limits.a_total": float(a)})).along(prepared.checker)
        for a in config.simulate.gentle
    )
    return Plan(
        config.reference.source,
        prepared,
        steps_until(end, scene.dt),
        Watch(prepared.scene, config).along(prepared.checker),
        gentle,
    )


def case_at(plan: Plan, config: Config, shift: float) -> Case | str:
    """The plan among the traffic that begins so much later [s]; in words why it cannot be driven."""
    scene = plan.scene
    by = round(shift / scene.dt)
    n_steps = min(plan.n_steps, scene.n_steps - by)
    if n_steps * scene.dt < _LEAST - 1e-9:
        return f"there is less than {_LEAST:g} s to drive"
    lanes = Network(lanes_of(scene.scenario.lanelet_network)[0])
    world = World(scene.obstacles, scene.dt, n_steps, by, lanes)
    grounds = _grounds(plan, world, config, "constant_velocity")
    never = drive(grounds, plan.prepared.reference, make_policy("never", config.simulate))
    if never.struck is not None and never.struck.time <= 0.0:
        return "somebody stands where it begins"
    return Case(plan, world, config, never)
