"""The ego's state now."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from repair.errors import ScenarioError, in_words, kind_of
from repair.reference.given import given_start
from repair.scene.scene import InitialState, Scene
from repair.scene.start import initial_state_of, possible_state

__all__ = ["ego_of"]

_EGO = ("x", "y", "yaw", "v")
_WHOSE = "the ego's"  # in sentences


def ego_of(ego: Any, reference: Any, scene: Scene) -> InitialState:
    """The ego's state now, in one of the ways to say it; by default where the plan begins.

    Raises
    ------
    ScenarioError
        If something of it is missing, no number, or out of range.
    """
    if isinstance(ego, InitialState):
        return possible_state((getattr(ego, part.name) for part in fields(InitialState)), _WHOSE)
    if ego is None:
        return given_start(reference, scene)
    if isinstance(ego, Mapping):
        strange = [k for k in ego if k not in (*_EGO, "a", "yaw_rate")]
        missing = [k for k in _EGO if k not in ego]
        if strange or missing:
            wrong = f"has {in_words(strange[0])}" if strange else f"lacks {missing[0]}"
            raise ScenarioError(f"the ego's state {wrong}; it is x, y, yaw, v and, if known, a and yaw_rate")
        values = (*(ego[k] for k in _EGO), *(ego.get(k, 0.0) for k in ("a", "yaw_rate")))
        return possible_state(values, _WHOSE)
    if hasattr(ego, "position"):
        return initial_state_of(ego, _WHOSE)
    raise ScenarioError(
        f"the ego's state is a mapping x, y, yaw, v, or a CommonRoad state, not {kind_of(ego)}"
    )
