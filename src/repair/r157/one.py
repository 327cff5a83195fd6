"""One point at a time, in plain Python: the readable form of :mod:`repair.r157.drive`, and slower.

A test holds the two together, point by point.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from repair.r157.cases import GRAVITY, KMH, LANE, LENGTH, WIDTH

__all__ = ["Struck", "drive_one"]

_FULL, _JERK = 0.774 * GRAVITY, 12.65


@dataclass(frozen=True)
class Struck:
    """What became of a point: contact, when [s], impact speed [m/s] and largest deceleration [m/s²]."""

    contact: bool
    time: float
    impact: float
    sideways: bool
    peak: float


def drive_one(
    case: str,
    ego: float,
    other: float,
    distance: float,
    lateral: float,
    g: float,
    model: str,
    *,
    stated: bool,
) -> Struck:
    """One point, by one model.

    Parameters
    ----------
    case : str
        One of :data:`repair.r157.cases.CASES`.
    ego, other : float
        [km/h].
    distance, lateral, g : float
        Distance [m], lateral speed [m/s], and the lead's deceleration [g].
    model : str
        One of :data:`repair.r157.models.MODELS`.
    stated : bool
        As the regulation has it, or as the published implementation does.
    """
    dt = 0.025 if stated else 0.1
    u = ego * KMH
    delay = {"CC": 0.75, "RSS": 0.75, "FSM": 0.75, "Reg157": 0.35}[model]
    wait = round(delay / dt) if stated else math.ceil(delay / dt - 1e-9)
    x = 0.0 if stated or case != "cut_out" else u * dt
    count, peak, since, latched, seen_before, kept, beside_before = 0, 0.0, math.nan, False, False, 0.0, False
    for k in range(round(35.0 / dt) + 1):
        if stated:
            rear, uc, y, vy, moved, stuck = _stated(case, ego, other, distance, lateral, g, k * dt)
        else:
            rear, uc, y, vy, moved, stuck = _published(case, ego, other, distance, lateral, g, k, model)
        gap = rear - x
        cut_in = case.startswith("cut_in")
        beside = not cut_in or y < WIDTH - (1e-9 if stated else 0.0)
        if -2.0 * LENGTH < gap < 0.0 and beside:
            return Struck(True, k * dt, u - uc, cut_in and not beside_before, peak)
        if gap <= -2.0 * LENGTH:
            break
        beside_before = beside
        exposed = case == "deceleration" or moved > 0.375 or stuck
        if exposed and math.isnan(since):
            since = k * dt
        exposed_for = -1.0 if math.isnan(since) else k * dt - since
        danger = _dangerous(model, stated, cut_in, u, uc, gap, y - WIDTH, vy, exposed_for, kept, k * dt)
        danger = danger and not (cut_in and gap <= -LENGTH)
        if model == "CC" and cut_in and not stated and danger and not seen_before:
            seen_before = True
            if not (u > uc and gap / (u - uc) <= 2.0):
                break  # dismissed
        if stated and model in ("CC", "Reg157"):
            danger = latched = (latched or danger) and u > uc
        count = count + 1 if danger else (0 if stated else count)
        acts = danger and count > wait
        a = _brake(model, stated, cut_in, u, uc, gap, vy, kept, dt) if acts else 0.0
        if model == "CC" and not stated and danger and not acts:
            a = 0.4
        kept = kept if model == "RSS" and not stated and not acts else a
        peak = max(peak, a)
        if stated:
            run = min(dt, u / a) if a > 0.0 else dt
            x += u * run - 0.5 * a * run**2
            u = max(u - a * run, 0.0)
        else:
            u = max(u - a * dt, 0.0)
            x += u * dt
    return Struck(False, math.nan, math.nan, False, peak)


_Place = tuple[float, float, float, float, float, bool]


def _stated(
    case: str, ego: float, other: float, distance: float, lateral: float, g: float, t: float
) -> _Place:
    """Rear, speed, offset, lateral speed, how far it has moved aside, and whether the lead is stuck."""
    u, across = other * KMH, min(lateral * t, LANE)
    vy = lateral if across < LANE else 0.0
    if case.startswith("cut_in"):
        return distance + u * t, u, LANE - across, vy, across, False
    gap = 2.0 * ego * KMH
    if case == "deceleration":
        run = min(t, u / (g * GRAVITY))
        return gap + u * run - 0.5 * g * GRAVITY * run**2, u - g * GRAVITY * run, 0.0, 0.0, 0.0, False
    met = distance / u
    stuck = met < WIDTH / lateral and t >= met
    moved = lateral * met if stuck else across
    return gap + (distance if stuck else LENGTH + distance), 0.0, moved, 0.0 if stuck else vy, moved, stuck


def _published(
    case: str, ego: float, other: float, distance: float, lateral: float, g: float, k: int, model: str
) -> _Place:
    """The same at a step of 0.1 s."""
    dt, v, u = 0.1, ego * KMH, other * KMH
    if case.startswith("cut_in"):
        ramp = math.ceil(lateral / 1.5 / dt)
        speeds = [min(1.5 * dt * i, lateral) if i < ramp else lateral for i in range(max(k, ramp) + 1)]
        y = max(sum(speeds[:ramp]) * dt - sum(speeds[:k]) * dt + WIDTH + (LANE - WIDTH), 0.0)
        rear = distance + (v - u) * ramp * dt + u * dt * k
        return rear, u, y, speeds[k] if y > 0.0 else 0.0, sum(speeds[:k]) * dt, False
    gap = {
        "CC": 2.0 * v,
        "FSM": 0.75 * v + v**2 / 8.0 - v**2 / 14.0 + 4.0,
        "RSS": _rss(v, max(v - 4.5, 0.0)) + 3.0 * 0.75**2,
    }[model]
    if case == "deceleration":
        slower = [max(u - g * GRAVITY * dt * i, 0.0) for i in range(1, k + 1)]
        return gap + sum(slower) * dt, slower[-1] if k else u, 0.0, 0.0, 0.0, False
    standing = gap + 3.95 + distance
    for i in range(k + 1):
        rear, moved = gap + u * dt * (i + 1), min(lateral * dt * (i + 1), 4.0)
        if moved < WIDTH and abs(rear - standing) < LENGTH:
            return rear, 0.0, moved, 0.0, moved, True
    return standing, 0.0, moved, lateral, moved, False


def _rss(v: float, ahead: float) -> float:
    return v * 0.75 + 1.5 * 0.75**2 + (v + 2.25) ** 2 / 12.0 - ahead**2 / 12.0


def _fuzzy(u: float, uc: float, gap: float, braking: float, stated: bool) -> tuple[float, float, bool]:
    """PFS, CFS, and whether the distance is below the safe one."""
    safe = u * 0.75 + u**2 / 8.0 - uc**2 / 14.0 + 2.0
    unsafe = u * 0.75 + u**2 / 12.0 - uc**2 / 14.0
    pfs = _between(gap - 2.0, unsafe, safe)
    below = gap - 2.0 < safe + (0.0 if stated else 1e-9)
    if u <= uc:
        return pfs, 0.0, below
    held = max(-braking, -4.0)
    then = u + held * 0.75
    if then <= uc:
        far = near = (u - uc) ** 2 / abs(2.0 * (held if stated else braking))
    else:
        further = ((u + then) / 2.0 - uc) * 0.75
        far, near = further + (then - uc) ** 2 / 8.0, further + (then - uc) ** 2 / 12.0
    return pfs, _between(gap, near, far), below


def _between(x: float, unsafe: float, safe: float) -> float:
    if x < unsafe:
        return 1.0
    return 0.0 if x > safe or safe == unsafe else (safe - x) / (safe - unsafe)


def _dangerous(
    model: str, stated: bool, cut_in: bool, u: float, uc: float, gap: float, clear: float, vy: float,
    exposed_for: float, braking: float, t: float,
) -> bool:  # fmt: skip
    """Whether something has to be done."""
    closing = u - uc
    ttc = gap / closing if closing > 0.0 else math.inf
    exposed = exposed_for >= 0.0
    if model == "CC":
        if stated:
            return exposed_for >= 0.4 - 1e-9 and (not cut_in or ttc <= 2.0)
        return clear <= 0.0 if cut_in else exposed
    if model == "Reg157":
        inside = clear <= 0.5 and closing > 0.0
        return inside and (t >= 0.72 if stated else abs(ttc) <= closing / 12.0 + 0.45)
    if model == "RSS":
        late = vy + 0.75
        near = gap < _rss(u, uc)
        return near and (clear < 0.3 + (vy + late) * 0.375 + late**2 / 2.0 if cut_in else exposed)
    _, cfs, below = _fuzzy(u, uc, gap, braking, stated)
    near = below or cfs > 0.0
    if not cut_in:
        return near and exposed
    beside = max(clear, 0.0) / vy if vy > 0.0 else math.inf
    return near and (clear <= 0.0 or (closing > 0.0 and beside < (gap + 2.0 * LENGTH) / closing + 0.1))


def _brake(
    model: str, stated: bool, cut_in: bool, u: float, uc: float, gap: float, vy: float, braking: float,
    dt: float,
) -> float:  # fmt: skip
    """Deceleration over the next step [m/s²]."""
    if model == "Reg157":
        return 6.0
    most = _FULL
    if model == "CC" and stated and cut_in and vy == 0.0:
        most = 0.85 * GRAVITY
    if model == "FSM":
        pfs, cfs, _ = _fuzzy(u, uc, gap, braking, stated)
        most = cfs * 2.0 + 4.0 if cfs > 0.0 else pfs * 4.0
    return min(most, braking + _JERK * dt)
