"""The ego's state now."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from repair.errors import ScenarioError, in_words, kind_of
from repair.reference.given import given_start
from repair.scene.scene import InitialState, Scene
from repair.scene.start import initial_state_of

__all__ = ["ego_of"]

_EGO = ("x", "y", "yaw", "v")


def ego_of(ego: Any, reference: Any, scene: Scene) -> InitialState:
    """The ego's state now, in one of the ways to say it; by default where the plan begins.

    Raises
    ------
    ScenarioError
        If something of it is missing or no number.
    """
    if isinstance(ego, InitialState):
        return ego
    if ego is None:
        return given_start(reference, scene)
    if isinstance(ego, Mapping):
        strange = [k for k in ego if k not in (*_EGO, "a", "yaw_rate")]
        missing = [k for k in _EGO if k not in ego]
        if strange or missing:
            wrong = f"has {in_words(strange[0])}" if strange else f"lacks {missing[0]}"
            raise ScenarioError(f"the ego's state {wrong}; it is x, y, yaw, v and, if known, a and yaw_rate")
        x, y, yaw, v = (_number(ego[k], k) for k in _EGO)
        return InitialState(x, y, yaw, v, *(_number(ego.get(k, 0.0), k) for k in ("a", "yaw_rate")))
    if hasattr(ego, "position"):
        return initial_state_of(ego)
    raise ScenarioError(
        f"the ego's state is a mapping x, y, yaw, v, or a CommonRoad state, not {kind_of(ego)}"
    )


def _number(value: Any, name: str) -> float:
    try:
        found = float(value)
    except (TypeError, ValueError) as error:
        raise ScenarioError(f"the ego's {name} is {in_words(value)}, which is no number") from error
    if not np.isfinite(found):
        raise ScenarioError(f"the ego's {name} is not finite")
    return found
