"""A driver model driven through all points of a case at once."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.r157.cases import KMH, LENGTH, WIDTH, Flags, Points
from repair.r157.models import Careful, DriverModel, Seen, ttc
from repair.r157.motion import ASIDE, published, sight, stated
from repair.timegrid import INSTANT
from repair.vehicle.parameters import load_vehicle

__all__ = ["STEP", "UNTIL", "Driven", "drive", "keep", "unavoidable"]

STEP = 0.025  # of the stated reading [s]: all delays are whole multiples, and the bound looks no closer
UNTIL = 35.0  # [s]
_TOGETHER = 1000  # points


@dataclass(frozen=True)
class Driven:
    """What became of each point; arrays (N,).

    Attributes
    ----------
    contact : array
        Whether the ego and another touch.
    time : array
        When [s]; NaN without contact, as the next three.
    impact : array
        Own speed then less that of the other [m/s].
    speed : array
        Own speed then [m/s].
    sideways : array
        Whether the other drove into the ego's side: they were beside each other before their lanes met.
        Without it, the ego drove into the other.
    ahead : array
        Whether the ego's middle was ahead of the other's then.
    peak : array
        Largest deceleration [m/s²].
    first : array
        When something had to be done for the first time [s]; NaN if never.
    dismissed : array
        Whether the published careful driver looked away for good.
    lead_struck : array
        Whether the lead of a cut-out ran into who stands there.
    """

    contact: Flags
    time: Array
    impact: Array
    speed: Array
    sideways: Flags
    ahead: Flags
    peak: Array
    first: Array
    dismissed: Flags
    lead_struck: Flags


def drive(points: Points, model: DriverModel) -> Driven:
    """What becomes of the points with a driver model.

    Parameters
    ----------
    points : Points
        Of a case that the model says something about (``model.cases``).
    model : DriverModel
        ``model.stated`` says by which reading of the case, and how it is integrated.
    """
    return _in_parts(points, model)


def keep(points: Points) -> Driven:
    """What becomes of the points where nobody reacts, as the regulation has the case."""
    return _in_parts(points, None)


def unavoidable(points: Points, most: float) -> Flags:
    """Where no speed along the lane avoids a contact, from when it is to be seen on.

    Whoever keeps to his path is at no time behind who brakes fully from the sight on, nor ahead of who
    accelerates fully. Where the one is in contact, and the other has not passed by then, nobody between them
    is out of it.

    Parameters
    ----------
    points : Points
    most : float
        Largest deceleration [m/s²]; accelerating, the engine of CommonRoad's vehicle 1 is a limit as well,
        that at the first speed: none is stronger at a higher one.
    """
    return np.concatenate([_unavoidable(points.at(rows), most) for rows in _parts(points)])


def _parts(points: Points) -> list[npt.NDArray[np.int64]]:
    """Rows that are driven together: all at once would take gigabytes."""
    return [np.arange(k, min(k + _TOGETHER, len(points))) for k in range(0, len(points), _TOGETHER)]


def _in_parts(points: Points, model: DriverModel | None) -> Driven:
    made = [_Run(points.at(rows), model).driven() for rows in _parts(points)]
    return Driven(*(np.concatenate([getattr(one, field.name) for one in made]) for field in fields(Driven)))


def _unavoidable(points: Points, most: float) -> Flags:
    others, seen, own = stated(points, STEP, UNTIL), sight(points), points.ego * KMH
    t = np.arange(len(others.rear))[:, None] * STEP
    since = np.maximum(t - seen, 0.0)
    braked = np.minimum(since, own / most)
    back = own * (np.minimum(t, seen) + braked) - 0.5 * most * braked**2
    engine = np.minimum(load_vehicle(1).engine_acceleration(own), most)
    front = own * t + 0.5 * engine * since**2
    rear = others.rear
    if others.standing is not None and others.stuck is not None:
        rear = np.where(others.stuck, others.rear, others.standing)
    beside = others.offset < WIDTH - INSTANT if points.cut_in else np.ones_like(rear, dtype=bool)
    meets = beside & (back > rear) & (front < rear + 2.0 * LENGTH)
    return np.asarray(meets.any(axis=0))


class _Run:
    """State of all points while they are driven."""

    def __init__(self, points: Points, model: DriverModel | None) -> None:
        n = len(points)
        self.points, self.model = points, model
        self.own = points.ego * KMH  # nominal speed
        self.loose = model is not None and not model.stated
        if model is not None and self.loose:
            self.others = published(points, model.following(self.own))
            self.delay = math.ceil(model.delay / self.others.step - INSTANT)
        else:
            self.others = stated(points, STEP, UNTIL)
            self.delay = 0 if model is None else round(model.delay / STEP)
        self.step = self.others.step
        self.front = self.others.begun * self.own * self.step
        self.speed, self.braking = self.own.copy(), np.zeros(n)
        self.count, self.latched = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=bool)
        self.known, self.over = np.full(n, np.nan), np.zeros(n, dtype=bool)
        self.overlap = np.zeros(n, dtype=bool)  # sideways, at the sample before
        nothing = np.full(n, np.nan)
        no = np.zeros(n, dtype=bool)
        self.made = Driven(no.copy(), nothing.copy(), nothing.copy(), nothing.copy(), no.copy(), no.copy(),
                           np.zeros(n), nothing.copy(), no.copy(), no.copy())  # fmt: skip

    def driven(self) -> Driven:
        """To the end, or until everything is decided."""
        last = len(self.others.rear) - 1
        self._meets(0)
        for k in range(last):
            self._goes(k)
            self._meets(k + 1)
            if self.over.all():
                break
        if self.others.stuck is not None:
            self.made.lead_struck[:] = self.others.stuck[-1]
        return self.made

    def _target(self, k: int) -> tuple[Array, Array]:
        """Rear and speed of who may be driven into."""
        others = self.others
        if others.standing is None or others.stuck is None:
            return others.rear[k], others.speed[k]
        return np.where(others.stuck[k], others.rear[k], others.standing), np.zeros_like(self.speed)

    def _meets(self, k: int) -> None:
        """Contact at a sample."""
        others, made = self.others, self.made
        rear, ahead = self._target(k)
        beside = others.offset[k] < WIDTH - (0.0 if self.loose else INSTANT)
        overlap = beside if self.points.cut_in else np.ones_like(self.over)
        gap = rear - self.front
        new = (gap < 0.0) & (gap > -2.0 * LENGTH) & overlap & ~self.over
        made.contact[new], made.time[new] = True, k * self.step
        made.impact[new], made.speed[new] = (self.speed - ahead)[new], self.speed[new]
        made.sideways[new] = (~self.overlap & self.points.cut_in)[new]
        made.ahead[new] = (gap < -LENGTH)[new]
        self.over |= new | (gap <= -2.0 * LENGTH)
        self.overlap = overlap

    def _goes(self, k: int) -> None:
        """One step of everybody who is not done."""
        wanted = np.zeros_like(self.speed) if self.model is None else self._wants(k, self.model)
        if self.loose:
            speed = np.maximum(self.speed - wanted * self.step, 0.0)
            way = speed * self.step
        else:
            run = np.minimum(self.step, np.divide(self.speed, wanted, out=np.full_like(wanted, np.inf),
                                                  where=wanted > 0.0))  # fmt: skip
            speed = np.maximum(self.speed - wanted * run, 0.0)
            way = 0.5 * (self.speed + speed) * run
            way = np.where(wanted > 0.0, way, self.speed * self.step)
        live = ~self.over
        self.made.peak[:] = np.where(live, np.maximum(self.made.peak, wanted), self.made.peak)
        self.speed = np.where(live, speed, self.speed)
        self.front = np.where(live, self.front + way, self.front)

    def _sees(self, k: int) -> Seen:
        others, points = self.others, self.points
        rear, ahead = self._target(k)
        if points.case == "deceleration":
            exposed = np.ones_like(self.over)
        else:
            exposed = others.moved[k] > ASIDE
            if others.stuck is not None:
                exposed = exposed | others.stuck[k]
        self.known = np.where(exposed & np.isnan(self.known), k * self.step, self.known)
        since = np.where(np.isnan(self.known), -1.0, k * self.step - self.known)
        clearance = others.offset[k] - WIDTH if points.cut_in else np.full_like(self.speed, -WIDTH)
        return Seen(k * self.step, points.cut_in, self.speed, ahead, rear - self.front, clearance,
                    others.lateral[k], since, self.braking)  # fmt: skip

    def _wants(self, k: int, model: DriverModel) -> Array:
        """Deceleration over the next step."""
        seen = self._sees(k)
        danger = model.dangerous(seen) & ~self.over
        if self.points.cut_in:
            danger &= seen.gap > -LENGTH  # nobody brakes for whom he has passed
        if self.loose and isinstance(model, Careful) and self.points.cut_in:
            danger &= ~self._dismissed(seen, danger)
        if model.stated and model.latched:
            self.latched = (self.latched | danger) & (seen.speed > seen.ahead) & (seen.gap > -2.0 * LENGTH)
            danger = self.latched
        self.made.first[:] = np.where(danger & np.isnan(self.made.first), k * self.step, self.made.first)
        self.count = np.where(danger, self.count + 1, self.count if self.loose else 0)
        acts = danger & (self.count > self.delay)
        wanted = np.where(acts, model.brake(seen, self.step), 0.0)
        if self.loose and isinstance(model, Careful):
            wanted = np.where(danger & ~acts, model.coasting, wanted)
        self.braking = np.where(~acts & model.keeps, self.braking, wanted) if self.loose else wanted
        return wanted

    def _dismissed(self, seen: Seen, danger: Flags) -> Flags:
        """Whose first overlap came with a TTC above the limit; they are not looked at any more."""
        first = danger & np.isnan(self.made.first) & ~self.made.dismissed
        closing = seen.speed > seen.ahead
        away = first & ~(closing & (ttc(seen) <= Careful.limit))
        self.made.dismissed[:] |= away
        self.over |= away
        return self.made.dismissed
