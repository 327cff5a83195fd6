"""Why there is no repair, or no later one, in words."""

from __future__ import annotations

from typing import Any

__all__ = ["why_rows"]

_MORE = {
    "friction": "{} m/s² more friction",
    "road": "a road {} m wider on each side",
    "start": "a start {} m/s slower",
    "engine": "{} m/s² more from the engine",
    "steering": "{} % more steering angle and rate",
    "later": "{} s later",
    "earlier": "{} s earlier",
    "away": "{} m further away",
}
_NAMES = {"start": "a slower start", "road": "a wider road"}


def why_rows(content: dict[str, Any]) -> list[tuple[str, str]]:
    """What is in the way, what would help, and what would not; nothing where nobody asked.

    Parameters
    ----------
    content : dict
        What ``result.json`` holds.
    """
    why = content.get("explanation")
    if not why:
        asked = (content.get("config") or {}).get("explain") or {}
        return [("Why", _NOTHING)] if asked.get("wanted") else []
    rows = [("Why", _there(why))]
    if (blocked := _in_the_way(why)) is not None:
        rows.append(("", blocked))
    helps = _helping(why["relaxations"])
    if helps:
        rows.append(("", f"a repair would exist with {'; '.join(helps)}"))
    useless = [one for one in why["relaxations"] if one["status"] == "not_sufficient"]
    if useless:
        rows.append(("", "it would not with " + ", ".join(dict.fromkeys(_much(one) for one in useless))))
    if why["not_tried"]:
        rows.append(("", f"not tried, for want of time (explain.time_limit): {', '.join(why['not_tried'])}"))
    return rows


_NOTHING = "there is nothing to explain: no time-to-repair after the last repair was tried in vain"


def _there(why: dict[str, Any]) -> str:
    """Whether there is a repair, as far as that is known."""
    text = f"at t_rep = {why['t_rep_s']:.2f} s "
    if not why["asked"]:
        return text + f"{why['exists_by']} finds a repair when it is asked alone"
    text += f"{' and '.join(why['asked'])} find{'s' if len(why['asked']) == 1 else ''} no repair"
    if why["exists_by"] is not None:
        text += f", and {why['exists_by']} does: the backend decides; what follows is for {why['asked'][0]}"
    if why["proven"]:
        text += ", and it is proven that there is none"
    return text


def _in_the_way(why: dict[str, Any]) -> str | None:
    if why["obstacles"] is None or not why["asked"]:
        return None
    if not why["obstacles"]:
        return "in the way is no obstacle: without any there is none either"
    names = [f"obstacle {one['obstacle_id']}{_when(one)}" for one in why["obstacles"]]
    text = "in the way: " + " and ".join(names)
    if why["road_in_proof"]:
        text += ", and the edge of the road"
    if len(names) > 1 and why["obstacles_minimal"]:
        text += " (all of these together; no part of them suffices)"
    return text if why["obstacles_minimal"] else f"{text} (not narrowed down: the time was up)"


def _when(one: dict[str, Any]) -> str:
    if one["from_s"] is None:
        return ""
    if one["from_s"] == one["to_s"]:
        return f" at {one['from_s']:.2f} s"
    return f" from {one['from_s']:.2f} s to {one['to_s']:.2f} s"


def _helping(relaxations: list[dict[str, Any]]) -> list[str]:
    """Each sufficient amount with the half that is not; those of an obstacle together."""
    parts: list[str] = []
    of_obstacle: dict[int, list[str]] = {}
    for one in relaxations:
        if one["status"] != "sufficient":
            continue
        if one["kind"] == "removed":
            of_obstacle.setdefault(one["obstacle_id"], []).append("gone")
            continue
        words = _MORE[one["kind"]].format(f"{one['amount']:g}") + f" ({_less(one)})"
        if one["obstacle_id"] is not None:
            of_obstacle.setdefault(one["obstacle_id"], []).append(words)
        else:
            parts.append(words)
    return parts + [f"obstacle {name} {', or '.join(words)}" for name, words in of_obstacle.items()]


def _less(one: dict[str, Any]) -> str:
    """With how much less there is none."""
    half = one["not_with"]
    text = "less was not tried" if half is None else f"not with {half:g}" if half else "not without"
    if one["proven_too_little"]:
        text += f"; proven: not with {one['proven_too_little']:g}"
    return text


def _much(one: dict[str, Any]) -> str:
    if one["kind"] == "removed":
        return f"obstacle {one['obstacle_id']} gone"
    most = one["tried_up_to"]
    if not most:
        return _NAMES.get(one["kind"], f"more {one['kind']}")
    words = _MORE[one["kind"]].format(f"{most:g}")
    return words if one["obstacle_id"] is None else f"obstacle {one['obstacle_id']} {words}"
