"""The closed loop of ``repair simulate``."""

from __future__ import annotations

from dataclasses import dataclass

from repair.settings import setting

__all__ = ["SimulateConfig"]


@dataclass
class SimulateConfig:
    """The closed loop: what the ego knows, and when it acts."""

    period: float | None = setting(
        None, "from cycle to cycle [s], whole steps; null: the scenario's step", low=1e-3, high=10.0
    )
    lookahead: float | None = setting(
        None,
        "how far ahead conflicts are looked for [s]; null: 5 s, and with the prediction recorded to the "
        "record's end",
        low=0.5,
        high=60.0,
    )
    trigger: str = setting(
        "contact",
        "what of a predicted conflict counts: contact, or the margin (checker.clearance) entered; once off "
        "its plan, contact alone",
        choices=("contact", "margin"),
    )
    clear_for: float = setting(
        0.5, "the plan has to be clear so long before the ego returns to it [s]", low=0.0, high=60.0
    )
    back: float = setting(
        1.5, "speeding up or slowing down on the way back to the plan [m/s²]", low=0.1, high=10.0
    )
    ttc: float = setting(2.0, "policy ttc: repairs below this time to collision [s]", low=0.0, high=60.0)
    delay: float = setting(0.5, "prediction delayed: how late the record is known [s]", low=0.0, high=60.0)
    gentle: list[float] = setting(
        factory=lambda: [4.0],
        says="policy graded: friction limits of its repairs [m/s²], tried in this order before the hard one",
    )
    error: float = setting(
        0.5,
        "policy graded: a gentle repair keeps clear of everybody being half of this times t² ahead or behind "
        "[m/s²]",
        low=0.0,
        high=20.0,
    )
    doubt: float = setting(
        0.5,
        "policy graded: a gentle repair begins where contact is met with everybody half of this times t² "
        "ahead, and behind [m/s²]; 0: wherever it is met",
        low=0.0,
        high=20.0,
    )
    solves: int | None = setting(
        3,
        "after so many solves the search of a cycle is carried on in the next one, once there is a repair "
        "that can be waited for; null: never",
        low=1,
        high=1000,
    )
    deadline: float | None = setting(
        None, "the search of a cycle ends by then [s]; null: when it is done", low=1e-3, high=1e3
    )
