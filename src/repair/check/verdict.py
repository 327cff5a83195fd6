"""What the checker says of a trajectory, and where a reference stops being drivable."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from repair.world.contact import Contact

__all__ = ["Conflict", "Later", "Reason", "Verdict", "Violation", "entered", "met"]


class Reason(str, Enum):
    """Why a trajectory is not feasible.

    Attributes
    ----------
    COLLISION
        An obstacle's true shape comes closer than ``checker.clearance``.
    OFF_ROAD
        The ego's rectangle leaves the road.
    KINEMATICS
        The kinematic single-track model cannot follow from one step to the next.
    LIMITS
        A limit of speed or acceleration is broken.
    MARGIN
        An inflated box is entered, where that is asked for (``checker.margin``).
    CHECKER_ERROR
        CommonRoad's own check failed on it.
    NOT_SOLVED, NO_CORRIDOR, NO_PASSAGE
        There is no trajectory: the solver gave none, no corridor leads on, no way past the obstacles is open.
    UNSAFE_END
        No stop follows its end (``checker.terminal: require``).
    EXTRA
        A registered check refuses it; the particulars say which.
    """

    COLLISION = "collision"
    OFF_ROAD = "off_road"
    KINEMATICS = "kinematics"
    LIMITS = "limits"
    MARGIN = "margin"
    CHECKER_ERROR = "checker_error"
    NOT_SOLVED = "not_solved"
    NO_CORRIDOR = "no_corridor"
    NO_PASSAGE = "no_passage"
    UNSAFE_END = "unsafe_end"
    EXTRA = "extra"


@dataclass(frozen=True)
class Violation:
    """One reason, when it first holds [s], the particulars in words; obstacle or place [m] if it has one."""

    reason: Reason
    time: float
    detail: str = ""
    obstacle_id: int | None = None
    place: tuple[float, float] | None = None


class Later(Violation):
    """A violation whose particulars are worked out when somebody reads them: most are never read.

    Parameters
    ----------
    reason : Reason
    told : callable
        Gives the violation.
    obstacle_id : int, optional
        Its obstacle, which is known already.
    """

    def __init__(self, reason: Reason, told: Callable[[], Violation], obstacle_id: int | None = None) -> None:
        for name, value in (("reason", reason), ("obstacle_id", obstacle_id), ("_tell", told)):
            object.__setattr__(self, name, value)

    @cached_property
    def _told(self) -> Violation:
        tell: Callable[[], Violation] = self.__dict__["_tell"]
        return tell()

    @property
    def time(self) -> float:
        """When it first holds [s]."""
        return self._told.time

    @property
    def detail(self) -> str:
        """The particulars in words."""
        return self._told.detail

    @property
    def place(self) -> tuple[float, float] | None:
        """Where it is [m], if it has a place."""
        return self._told.place

    def __eq__(self, other: object) -> bool:
        return self._told == (other._told if isinstance(other, Later) else other)

    def __hash__(self) -> int:
        return hash(self._told)

    def __reduce__(self) -> tuple[Any, ...]:
        return _same, (self._told,)


def _same(violation: Violation) -> Violation:
    return violation


@dataclass(frozen=True)
class Verdict:
    """The checker's answer.

    Attributes
    ----------
    violations : tuple of Violation
        What is wrong, in the order of checking; empty where it is feasible.
    """

    violations: tuple[Violation, ...] = ()

    @property
    def ok(self) -> bool:
        """No violation of any kind."""
        return not self.violations

    @property
    def reasons(self) -> tuple[str, ...]:
        """The reasons' words, in the order of checking."""
        return tuple(v.reason.value for v in self.violations)

    @property
    def first_time(self) -> float:
        """Time of the earliest violation [s], inf where there is none."""
        return min((v.time for v in self.violations), default=float("inf"))


@dataclass(frozen=True)
class Conflict:
    """Where the reference stops being drivable.

    Attributes
    ----------
    time : float
        TTC [s]: first scenario step at which the reference violates something; inf if never.
    kind : str
        ``margin`` (a safety margin is entered), ``collision``, ``off_road``, ``limits``, ``kinematics``
        or ``none``.
    obstacle_id : int or None
    contact_time : float
        First contact of the true rectangles [s], inf if never.
    contact_id : int or None
    from_behind : bool
        The obstacle strikes the ego from behind.
    detail : str
        What is violated, in words: where the road is left and by how much, which limit is exceeded.
    exact_time : float
        When the violation begins between the scenario's steps [s]: contact and margins in continuous time,
        early by 1 ms at most, the rest at the samples; ``time`` for boxes, which are looked at in steps.
    place : (float, float) or None
        Where the road is left [m].
    """

    time: float
    kind: str = "none"
    obstacle_id: int | None = None
    contact_time: float = float("inf")
    contact_id: int | None = None
    from_behind: bool = False
    detail: str = ""
    exact_time: float = float("inf")
    place: tuple[float, float] | None = None


def entered(near: Contact, margin: float, contact: Callable[[], Contact | None]) -> Violation:
    """A margin that is entered before anything is touched; whether it is then, is for who reads it.

    Parameters
    ----------
    near : Contact
        First contact of the ego enlarged by the margin.
    margin : float
        [m].
    contact : callable
        Gives the first contact of the ego itself, which is later, or None.
    """
    return Later(Reason.MARGIN, lambda: _margin(near, contact(), margin), near.obstacle_id)


def _margin(near: Contact, contact: Contact | None, margin: float) -> Violation:
    detail = f"obstacle {near.obstacle_id} within {margin:g} m"
    if contact is not None:
        detail += f", contact with obstacle {contact.obstacle_id} at {contact.time:.2f} s"
    return Violation(Reason.MARGIN, near.time, detail, near.obstacle_id)


def met(near: Contact | None, contact: Contact | None, margin: float) -> Violation | None:
    """An obstacle that is touched, or whose margin is entered: the first of both.

    Parameters
    ----------
    near : Contact or None
        First contact of the ego enlarged by a margin.
    contact : Contact or None
        First contact of the ego itself.
    margin : float
        [m].
    """
    if contact is not None and (near is None or contact.time <= near.time):
        behind = " from behind" if contact.from_behind else ""
        detail = f"obstacle {contact.obstacle_id}{behind}"
        return Violation(Reason.COLLISION, contact.time, detail, contact.obstacle_id)
    return None if near is None else _margin(near, contact, margin)
