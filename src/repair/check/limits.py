"""Whether a driven path keeps the limits: by its peaks, and by bounds of them that cost less."""

from __future__ import annotations

import math

from repair.arrays import largest, smallest
from repair.check.peaks import peaks
from repair.curves.plane import CartesianPath
from repair.problem.limits import Limits

__all__ = ["exceeded", "exceeded_by_peaks", "surely_kept"]

# Speeds this far below zero [m/s] still count as standing, and limits are met up to this share:
# a soft backend ends near its limits, not on them.
STANDSTILL = 0.05
SLACK = 0.01


def exceeded(path: CartesianPath, late: int, limits: Limits) -> list[str]:
    """Limits that are broken from the path's sample ``late`` on, in words; none where all are kept."""
    return [] if surely_kept(path, late, limits) else exceeded_by_peaks(path, late, limits)


def surely_kept(path: CartesianPath, late: int, limits: Limits) -> bool:
    """Whether bounds of the peaks, which cost less than the peaks, meet the limits already.

    No difference quotient is beyond the largest change of one sample to the next.
    """
    since = max(late - 1, 0)
    if len(path.t) - since < 2:
        return False
    speed = path.speed[since:]
    change = speed[1:] - speed[:-1]
    rate = 1.0 / float(path.t[1] - path.t[0])
    v_high = largest(speed)
    a_low, a_high = smallest(change), largest(change)
    lateral = max(-path.slowest, v_high) * path.sharpest
    return (
        path.slowest >= -STANDSTILL
        and v_high <= limits.v_max
        and a_low * rate >= limits.a_min
        and a_high * rate <= limits.a_max
        and lateral * rate <= limits.a_lat
        and math.hypot(max(-a_low, a_high), lateral) * rate <= limits.a_total
    )


def exceeded_by_peaks(path: CartesianPath, late: int, limits: Limits) -> list[str]:
    """The same as :func:`exceeded`, by the peaks themselves."""
    reached, more = peaks(path, slice(late, None)), 1 + SLACK
    v_low, v_high = reached.min_speed, reached.max_speed
    a_low, a_high = reached.min_acceleration, reached.max_acceleration
    lateral, total = reached.max_lateral_acceleration, reached.max_total_acceleration
    checks = (
        (v_low < -STANDSTILL, "reverses at {:.2f} m/s", -v_low),
        (v_high > limits.v_max * more + 0.1, "speed {:.1f} m/s", v_high),
        (a_low < limits.a_min * more, "brakes at {:.2f} m/s²", a_low),
        (a_high > limits.a_max * more, "accelerates at {:.2f}", a_high),
        (lateral > limits.a_lat * more, "lateral acceleration {:.2f} m/s²", lateral),
        (total > limits.a_total * more, "total acceleration {:.2f} m/s²", total),
    )
    return [text.format(value) for bad, text, value in checks if bad]
