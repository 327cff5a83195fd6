"""The errors a user can act on. Nothing else is meant to leave the library."""

from __future__ import annotations

__all__ = [
    "BackendError",
    "ConfigError",
    "OutputError",
    "ReferenceTrajectoryError",
    "RepairError",
    "ScenarioError",
]


class RepairError(Exception):
    """Base of every error raised on purpose: one sentence that says what is wrong with which input."""


class ScenarioError(RepairError):
    """The scenario (file) cannot be used: unreadable, incomplete, or without a usable route."""


class ConfigError(RepairError):
    """A configuration key, value or preset is wrong."""


class ReferenceTrajectoryError(RepairError):
    """No reference trajectory can be had: planner, file or recorded obstacle."""


class BackendError(RepairError):
    """A backend is unknown or cannot be imported, or it was handed a malformed problem."""


class OutputError(RepairError):
    """A result cannot be written."""
