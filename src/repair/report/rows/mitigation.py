"""The motion that hits least hard, in words."""

from __future__ import annotations

from typing import Any

__all__ = ["mitigation_rows"]

_DOES = {
    "brake": "braking", "swerve_left": "swerving left", "swerve_right": "swerving right",
    "accelerate": "accelerating", "keep_speed": "keeping the speed",
}  # fmt: skip


def mitigation_rows(content: dict[str, Any]) -> list[tuple[str, str]]:
    """What is left to do where nothing was found, beside plain full braking.

    Parameters
    ----------
    content : dict
        What ``result.json`` holds.
    """
    told = content.get("mitigation")
    if not told:
        return []
    if told["ends"] is None:
        return [("Mitigate", "no motion that was tried can be driven until it hits something")]
    full = told["full_braking"]
    how = "full braking" if told["found_by"] == "full_braking" else _DOES[told["maneuver"]]
    rows = [("Mitigate", f"{how}: {_impact(told, told['looked_until_s'])}")]
    if full is None:
        rows.append(("", "plain full braking along the path cannot be driven"))
    elif told["found_by"] != "full_braking":
        rows.append(("", f"plain full braking: {_impact(full, told['looked_until_s'])}"))
    if not told["complete"]:
        rows.append(("", "the look for it was ended by mitigation.time_limit"))
    return rows


def _impact(one: dict[str, Any], until: float) -> str:
    if one["ends"] == "none":
        return f"nothing is touched until {until:.2f} s, and the road is kept (no margin is asked for)"
    speed, own = one["impact_speed_mps"], one["own_speed_mps"]
    at = f"at {one['contact_t_s']:.2f} s"
    if one["ends"] == "off_road":
        return f"leaves the road {at} with {speed:.2f} m/s"
    who = f"obstacle {one['obstacle_id']}"
    met = f"is struck from behind by {who}" if one["from_behind"] else f"hits {who}"
    return f"{met} {at} with {speed:.2f} m/s (own speed {own:.2f} m/s)"
