"""The rows of a certificate about why there is no repair, or no later one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from repair.certify.certificate import CertificateRow, said
from repair.search.result import SearchStatus
from repair.search.several import search_with
from repair.solvers.registry import make_backend
from repair.timegrid import INSTANT
from repair.why.kinds import KINDS, under

if TYPE_CHECKING:
    from repair.preparation import Prepared

__all__ = ["why_rows"]


def why_rows(content: Mapping[str, Any], prepared: Prepared, other: str) -> list[CertificateRow]:
    """Whether an explanation holds together, and whether what it says would help does, and half of it not.

    Parameters
    ----------
    content : mapping
        What ``result.json`` holds.
    prepared : Prepared
        The situation, laid out anew.
    other : str
        Why a search may come out otherwise here; empty where it may not.
    """
    told = content.get("explanation")
    if not told:
        return []
    rows = [
        said("explanation: about", _about(content) == told["t_rep_s"], "files"),
        said("explanation: holds together", _holds_together(content, prepared), "files"),
    ]
    for one in told["relaxations"]:
        if one["status"] == "sufficient":
            rows += _helps(told, one, prepared, other)
    return rows


def _about(content: Mapping[str, Any]) -> float | None:
    """The time-to-repair that there is something to explain about, by the visited ones [s]."""
    f_ttr = content.get("f_ttr_s")
    vain = [p["t_rep_s"] for p in content["probes"] if not p["feasible"]]
    if f_ttr is None:
        return float(min(vain, default=0.0))
    return min((float(t) for t in vain if t > f_ttr + INSTANT), default=None)


def _holds_together(content: Mapping[str, Any], prepared: Prepared) -> bool:
    """Obstacles that there are, amounts in order, and nothing called impossible that is there."""
    told, f_ttr = content["explanation"], content.get("f_ttr_s")
    known = {one.id for one in prepared.scene.obstacles}
    named = [one["obstacle_id"] for one in (*(told["obstacles"] or ()), *told["relaxations"])]
    ok = all(name is None or name in known for name in named)
    ok &= not (told["proven"] and (told["exists_by"] is not None or (f_ttr or 0.0) > told["t_rep_s"]))
    helping = set()
    for one in told["relaxations"]:
        if one["status"] != "sufficient":
            ok &= one["amount"] is None
            continue
        helping.add("obstacle" if KINDS[one["kind"]].of_obstacle else one["kind"])
        amount = one["amount"]
        for less in (one["not_with"], one["proven_too_little"]):
            ok &= less is None or less < amount
        ok &= one["not_with"] is None or one["not_with"] <= 0.5 * amount + INSTANT
    backend = {"backend"} if told["exists_by"] is not None else set()
    return bool(ok) and set(told["decides"]) == helping | backend


def _helps(
    told: Mapping[str, Any], one: Mapping[str, Any], prepared: Prepared, other: str
) -> list[CertificateRow]:
    """A repair with the amount, and none with half of it."""
    who = "" if one["obstacle_id"] is None else f" of {one['obstacle_id']}"
    amounts = [(one["amount"] or 0.0, True)]
    if one["not_with"]:
        amounts.append((one["not_with"], False))
    rows = []
    for amount, wanted in amounts:
        name = f"{one['kind']}{who}" + (f" {amount:g} {one['unit']}" if one["unit"] else "")
        there = _exists(told, one, amount, prepared)
        words = f"{name}: {'a repair' if wanted else 'none'}"
        rows.append(said(words, there == wanted, "searched again", other, claim=not other))
    return rows


def _exists(told: Mapping[str, Any], one: Mapping[str, Any], amount: float, prepared: Prepared) -> bool:
    """Whether one of those who were asked has a repair under an assumption."""
    try:
        situation = under(prepared, one["kind"], amount, one["obstacle_index"])
    except ValueError:
        return False
    if situation.conflict.time > situation.t_end - INSTANT:
        return True
    t_rep, config = float(told["t_rep_s"]), situation.config
    if situation.conflict.time <= t_rep - INSTANT:
        return False
    return any(
        search_with(
            make_backend(name, config), name, situation, config.search, visits=(t_rep,)
        ).status is SearchStatus.FOUND
        for name in told["asked"]
    )  # fmt: skip
