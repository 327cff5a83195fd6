"""Steps and seconds: the one place that says which multiple of a step a time is.

Times are floats and steps are integers; 0.3 / 0.1 is 2.9999999999999996. A time counts as on a step where it
is within :data:`STEP` of the step's length from it, and as not before another one within :data:`INSTANT`.
"""

from __future__ import annotations

import math

__all__ = ["INSTANT", "ROUNDING", "SHORT", "STEP", "intervals", "on_grid", "steps_until"]

#: Share of a step by which a time may be off it.
STEP = 1e-6
#: Times [s] closer than this are one.
INSTANT = 1e-9
#: By how much rounding alone moves a multiple of a step [s]: what is tabulated by step is looked up this
#: near to it only, since a time farther off has values of its own.
ROUNDING = 1e-12
#: [s]; a scenario's step below it is no reason to look at curves, or to change controls, more often.
SHORT = 0.04


def steps_until(t: float, step: float) -> int:
    """Number of whole steps [s] until a time [s]; one that a rounding error hides counts."""
    return math.floor(t / step + STEP)


def intervals(duration: float, step: float) -> int:
    """Number of steps that cover a duration; a rounding error takes no further one."""
    return math.ceil(duration / step - STEP)


def on_grid(t: float, step: float) -> float:
    """The last multiple of a step that is not after a time [s]."""
    return steps_until(t, step) * step
