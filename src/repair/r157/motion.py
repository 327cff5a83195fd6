"""What the others do at a point: two readings of the same case, sampled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from repair.arrays import Array
from repair.r157.cases import GRAVITY, KMH, LANE, LENGTH, WIDTH, Flags, Points

__all__ = ["ASIDE", "HEADWAY", "Others", "published", "sight", "stated"]

ASIDE = 0.375  # how far off its lane's middle somebody is seen to leave it [m]
HEADWAY = 2.0  # behind the lead, in the cut-out and deceleration cases [s]
CLEAR = LANE - WIDTH  # between the facing sides of two vehicles in the middle of neighbouring lanes [m]

_RAMP = 1.5  # lateral acceleration at the begin of a cut-in [m/s²]
_STEP, _STEPS = 0.1, 350  # of the published numerics [s]
_ASIDE = 4.0  # where the lead of a cut-out goes to [m]
_BEHIND = 3.95  # beyond gap and distance stands the rear of who stands, in the published cut-out [m]


@dataclass(frozen=True)
class Others:
    """Others over time; places are those of bodies seen from the ego's front at the start.

    Attributes
    ----------
    step : float
        Between samples [s].
    rear : (K, N) array
        Of who drives ahead or cuts in [m].
    speed : (K, N) array
        Of the same [m/s].
    offset, lateral : (K, N) array
        How far its middle is from that of the ego's lane [m], and its lateral speed [m/s], both towards it
        or away from it without a sign.
    moved : (K, N) array
        How far its middle has come from that of the lane it started in [m].
    standing : (N,) array or None
        Rear of who stands ahead of a lead that cuts out [m].
    stuck : (K, N) array or None
        Whether that lead has itself run into who stands there, and stays.
    begun : float
        How far the ego has come at the first sample, in steps at its speed.
    """

    step: float
    rear: Array
    speed: Array
    offset: Array
    lateral: Array
    moved: Array
    standing: Array | None = None
    stuck: Flags | None = None
    begun: float = 0.0


def published(points: Points, gap: Array) -> Others:
    """As the published implementation has it: steps of 0.1 s, speed first and place with the new speed.

    A cut-in begins with a lateral ramp, and ``distance`` and a clearance of 1.6 m hold where that ends. In
    the cut-out the first sample lies one step after the start; a lead that runs into who stands ahead while
    it still overlaps that one stays there.

    Parameters
    ----------
    gap : (N,) array
        From the ego's front to the lead's rear at the start [m], where there is a lead.
    """
    speed = points.other * KMH
    k = np.arange(_STEPS + 1)[:, None]
    if points.cut_in:
        ramp = np.ceil(points.lateral / _RAMP / _STEP).astype(np.int64)
        lateral = np.where(k < ramp, np.minimum(_RAMP * _STEP * k, points.lateral), points.lateral)
        moved = np.vstack([np.zeros(len(points)), np.cumsum(lateral[:-1], axis=0)]) * _STEP
        offset = np.take_along_axis(moved, ramp[None], 0) - moved + WIDTH + CLEAR
        rear = points.distance + (points.ego - points.other) * KMH * ramp * _STEP + speed * _STEP * k
        offset = np.maximum(offset, 0.0)
        lateral = np.where(offset > 0.0, lateral, 0.0)
        return Others(_STEP, rear, np.broadcast_to(speed, rear.shape), offset, lateral, moved)
    if points.case == "deceleration":
        brake = points.deceleration * GRAVITY * _STEP
        slower = np.maximum(speed - brake * k, 0.0)
        rear = gap + np.vstack([np.zeros(len(points)), np.cumsum(slower[1:], axis=0)]) * _STEP
        still = np.zeros_like(rear)
        return Others(_STEP, rear, slower, still, still, still)
    offset = np.minimum(points.lateral * _STEP * (k + 1), _ASIDE)
    standing = gap + _BEHIND + points.distance
    rear = gap + speed * _STEP * (k + 1)
    struck = (offset < WIDTH) & (np.abs(rear - standing) < LENGTH)
    stuck = np.logical_or.accumulate(struck, axis=0)
    first = np.argmax(stuck, axis=0)
    rear = np.where(stuck, np.take_along_axis(rear, first[None], 0), rear)
    moving = np.where(stuck, 0.0, speed)
    return Others(_STEP, rear, moving, offset, np.where(offset < _ASIDE, points.lateral, 0.0), offset,
                  standing, stuck, begun=1.0)  # fmt: skip


def stated(points: Points, step: float, until: float) -> Others:
    """As the regulation has it: from the start everybody drives as the parameters say, in continuous time.

    The cut-in starts at ``distance`` and at its lateral speed, from the middle of the lane beside, and ends
    in the middle of the ego's. The lead of a cut-out goes to the middle of the lane beside; where it would
    run into who stands ahead, it stops there. The gap is a headway of 2 s.

    Parameters
    ----------
    step : float
        Between samples [s].
    until : float
        The last one [s].
    """
    speed = points.other * KMH
    t = np.arange(round(until / step) + 1)[:, None] * step
    across = np.minimum(points.lateral * t, LANE)
    lateral = np.where(across < LANE, points.lateral, 0.0)
    if points.cut_in:
        rear = points.distance + speed * t
        return Others(step, rear, np.broadcast_to(speed, rear.shape), LANE - across, lateral, across)
    gap = HEADWAY * points.ego * KMH
    if points.case == "deceleration":
        brake = points.deceleration * GRAVITY
        still, run = np.zeros((len(t), len(points))), np.minimum(t, speed / brake)
        rear = gap + speed * run - 0.5 * brake * run**2
        return Others(step, rear, speed - brake * run, still, still, still)
    standing = gap + LENGTH + points.distance
    met = points.distance / speed  # when its front is there
    out = np.divide(WIDTH, points.lateral, out=np.full(len(points), np.inf), where=points.lateral > 0.0)
    stuck = (met < out) & (t >= met)
    rear = gap + speed * np.where(met < out, np.minimum(t, met), t)
    across = np.where(stuck, np.minimum(across, points.lateral * met), across)
    return Others(step, rear, np.where(stuck, 0.0, speed), across, np.where(stuck, 0.0, lateral), across,
                  standing, stuck)  # fmt: skip


def sight(points: Points) -> Array:
    """When it is to be seen [s], as the regulation has it: somebody is 0.375 m off the middle of his lane.

    In the cut-out, the lead is, or has run into who stands ahead. The deceleration is seen at once; who never
    leaves his lane is never seen to.
    """
    if points.case == "deceleration":
        return np.zeros(len(points))
    seen = np.divide(ASIDE, points.lateral, out=np.full(len(points), np.inf), where=points.lateral > 0.0)
    return np.asarray(seen if points.cut_in else np.minimum(seen, points.distance / (points.other * KMH)))
