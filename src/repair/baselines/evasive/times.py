"""TTR from fixed evasive manoeuvres: the latest moment at which full braking, kick-down or steering helps.

TTB, TTK and TTS (Hillenbrand et al., *A multilevel collision mitigation approach*, T-ITS 2006; the
names and the conventions of :attr:`EvasiveResult.ttr` and its parts are those of CommonRoad-CriMe:
-inf where no such manoeuvre helps, inf without a conflict). Every manoeuvre is a trajectory along the
reference's own path, on a point mass or within the steering limits of a kinematic single-track model;
it stands when it has come to a stop, where a simulation at constant acceleration would reverse.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING

from repair.baselines.evasive.maneuvers import EvasiveCurve, EvasiveManeuver, Path, maneuvers_at, path_of
from repair.baselines.evasive.settings import EvasiveConfig
from repair.curves.base import SplicedCurve
from repair.deadline import in_time
from repair.timegrid import INSTANT, intervals
from repair.world.occupancy import first_entry

if TYPE_CHECKING:
    from repair.situation import Situation

__all__ = ["EvasiveResult", "EvasiveStatus", "brakes_free", "evasive_ttr"]


class EvasiveStatus(str, Enum):
    """Why a Time-To-X has its value."""

    FOUND = "found"
    NO_CONFLICT = "no_conflict"
    NEVER = "never"
    ALREADY_COLLIDING = "already_colliding"

    @property
    def value_without(self) -> float:
        """The value [s] that stands for the status where it is not ``found``."""
        return float("inf") if self is EvasiveStatus.NO_CONFLICT else -float("inf")


@dataclass(frozen=True)
class EvasiveResult:
    """Times by CommonRoad-CriMe's conventions [s]: -inf for "no such manoeuvre", inf for "no conflict".

    Attributes
    ----------
    ttb, ttk, tts_left, tts_right : float
        Latest start of full braking, kick-down, and steering to either side.
    ttr : float
        The latest of them.
    maneuver : EvasiveManeuver or None
        Which one that is.
    status : dict
        Why each of the four has its value.
    curves : dict
        The manoeuvre from its Time-To-X on, for those that exist.
    """

    ttb: float
    ttk: float
    tts_left: float
    tts_right: float
    ttr: float
    maneuver: EvasiveManeuver | None
    status: dict[EvasiveManeuver, EvasiveStatus]
    curves: dict[EvasiveManeuver, EvasiveCurve] = field(default_factory=dict)

    @property
    def tts(self) -> float:
        """The later of steering left and right [s]."""
        return max(self.tts_left, self.tts_right)

    @property
    def curve(self) -> EvasiveCurve | None:
        """The manoeuvre behind ``ttr``."""
        return None if self.maneuver is None else self.curves.get(self.maneuver)


def evasive_ttr(situation: Situation, settings: EvasiveConfig) -> EvasiveResult:
    """TTB, TTK, TTS and TTR of a reference.

    Parameters
    ----------
    situation : Situation
    settings : EvasiveConfig

    Returns
    -------
    EvasiveResult
        Each time is the last scenario step before the TTC from which the manoeuvre avoids every
        collision until the end of the repairs (``situation.t_end``).

    Raises
    ------
    repair.deadline.OutOfTime
        If the deadline passes before.
    """
    ttc = situation.conflict.time
    if ttc == float("inf"):
        return _uniform(EvasiveStatus.NO_CONFLICT)
    if situation.conflict.contact_time <= 0.0:
        return _uniform(EvasiveStatus.ALREADY_COLLIDING)
    path = path_of(situation.reference, situation.t_end)
    latest = max(intervals(ttc, situation.scene.dt) - 1, 0)
    times: dict[EvasiveManeuver, float] = {}
    curves: dict[EvasiveManeuver, EvasiveCurve] = {}
    for maneuver in EvasiveManeuver:
        times[maneuver] = -float("inf")
        for step in range(latest, -1, -1):
            in_time()
            curve = _escape(situation, settings, maneuver, step * situation.scene.dt, path)
            if curve is not None:
                times[maneuver], curves[maneuver] = curve.t_start, curve
                break
    status = {m: EvasiveStatus.FOUND if m in curves else EvasiveStatus.NEVER for m in EvasiveManeuver}
    best = max(curves, key=lambda m: times[m], default=None)
    brake, kick, left, right = (times[m] for m in EvasiveManeuver)
    return EvasiveResult(brake, kick, left, right, max(times.values()), best, status, curves)


def brakes_free(situation: Situation, settings: EvasiveConfig, t: float) -> bool:
    """Whether full braking along the path from ``t`` on avoids every collision: whether TTB is not before.

    Parameters
    ----------
    situation : Situation
    settings : EvasiveConfig
    t : float
        [s].
    """
    path = path_of(situation.reference, situation.t_end)
    return _escape(situation, settings, EvasiveManeuver.BRAKE, t, path) is not None


def _uniform(status: EvasiveStatus) -> EvasiveResult:
    value = status.value_without
    return EvasiveResult(value, value, value, value, value, None, dict.fromkeys(EvasiveManeuver, status))


def _escape(
    situation: Situation, settings: EvasiveConfig, maneuver: EvasiveManeuver, t: float, path: Path
) -> EvasiveCurve | None:
    """The first variant of a manoeuvre from ``t`` on that is free until the end of the repairs."""
    steering = maneuver in (EvasiveManeuver.STEER_LEFT, EvasiveManeuver.STEER_RIGHT)
    road = steering or situation.conflict.kind == "off_road"
    for curve in maneuvers_at(
        situation.reference, t, situation.t_end, maneuver, settings, situation.scene.vehicle, path
    ):
        if _is_free(situation, curve, settings.collision, road):
            return curve
    return None


def _is_free(situation: Situation, curve: EvasiveCurve, collision: str, road: bool) -> bool:
    checker, t_end = situation.checker, situation.t_end
    if collision != "boxes":
        before = situation.conflict.contact_time < curve.t_start - INSTANT  # it is too late then
        return not before and checker.is_free(situation.reference, curve, t_end, road=road)
    driven, times = SplicedCurve(situation.reference, curve, curve.t_start), checker.times(t_end)
    after = driven.sample(times[times >= curve.t_start - INSTANT])
    if first_entry(situation.occupancy, after) is not None:
        return False
    if not road or checker.road is None:
        return True
    states = checker.drive(driven, t_end)
    late = states.t >= curve.t_start - INSTANT
    return checker.road.first_off_road(states.x[late], states.y[late], states.orientation[late]) is None
