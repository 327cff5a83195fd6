"""Speed limits by traffic signs along a route."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from repair.arrays import frozen
from repair.scene.frame import FrenetFrame
from repair.scene.road.lanes import Lane
from repair.scene.road.passes import every_pass
from repair.scene.road.route import Route
from repair.scene.scene import SpeedLimit
from repair.scene.start import SPEED_RANGE

__all__ = ["speed_limit_along"]


def speed_limit_along(
    scenario: Any, frame: FrenetFrame, route: Route, lanes: Mapping[int, Lane], notes: list[str]
) -> SpeedLimit | None:
    """Limits by traffic signs on the route's lanelets; None where no sign limits the speed.

    Parameters
    ----------
    scenario : commonroad.scenario.scenario.Scenario
    frame : FrenetFrame
        Over whose arc length they are tabulated.
    route : Route
    lanes : mapping
        The map's lanes by id.
    notes : list of str
        Signs that cannot be read are added here.
    """
    from commonroad.scenario.traffic_sign import SupportedTrafficSignCountry
    from commonroad.scenario.traffic_sign_interpreter import TrafficSignInterpreter

    try:
        country = SupportedTrafficSignCountry(scenario.scenario_id.country_id)
    except ValueError:
        country = SupportedTrafficSignCountry.ZAMUNDA
    interpreter = TrafficSignInterpreter(country, scenario.lanelet_network)
    entries: list[tuple[float, float]] = []
    for name in route.lanelets:
        try:
            limit = interpreter.speed_limit(frozenset({name}))
        except (AssertionError, AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
            notes.append(f"the traffic signs of lanelet {name} cannot be read ({error})")
            limit = None
        before = entries[-1][0] if entries else 0.0
        found = [float(one[0, 0]) for one in every_pass(frame, lanes[name].center[:1])]
        later = [entry for entry in found if entry > before + 1e-6]
        # a lanelet that begins before the path counts from its start on
        begin = float(np.clip(min(later, default=before), before, frame.length))
        entries.append(
            (begin, np.inf if limit is None or not 0.0 < limit <= SPEED_RANGE[1] else float(limit))
        )
    if all(np.isinf(limit) for _, limit in entries):
        return None
    s, speed = zip(*entries, strict=True)
    return SpeedLimit(frozen(s), frozen(speed))
