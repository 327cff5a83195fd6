"""What a record has to look like: an edited ``result.json`` is an error that names the key."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from repair.arrays import HUGE

__all__ = ["Damage", "require_record"]


class Damage(ValueError):
    """A record is not one that was written; the sentence names the key."""


Test = Callable[[Any], bool]


def _number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < HUGE


def _whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _text(value: Any) -> bool:
    return isinstance(value, str)


def _flag(value: Any) -> bool:
    return isinstance(value, bool)


def _maybe(test: Test) -> Test:
    return lambda value: value is None or test(value)


def _list_of(test: Test) -> Test:
    return lambda value: isinstance(value, list) and all(test(one) for one in value)


def _table_of(test: Test) -> Test:
    return lambda value: isinstance(value, dict) and all(test(one) for one in value.values())


def _all_of(tests: Mapping[str, Test], others: Mapping[str, Test] | None = None) -> Test:
    """A mapping that has all of the keys, and holds under these and others what it can."""
    return lambda value: (
        isinstance(value, dict)
        and not any((*_broken(value, tests), *_broken(value, others or {}, needed=False)))
    )


def _broken(record: Mapping[str, Any], tests: Mapping[str, Test], needed: bool = True) -> Iterator[str]:
    """Keys that are missing, or hold what they cannot hold."""
    for key, test in tests.items():
        if key not in record:
            if needed:
                yield key
        elif not test(record[key]):
            yield key


def _metric(value: Any) -> bool:
    values = [v for key, v in value.items() if key.startswith("value_")] if isinstance(value, dict) else []
    return len(values) == 1 and _text(value.get("status")) and (values[0] is None or _number(values[0]))


_PEAKS = {
    name: _maybe(_number)
    for name in (
        "peak_deceleration_mps2", "peak_lateral_acceleration_mps2", "peak_total_acceleration_mps2",
        "min_speed_mps", "max_speed_mps",
    )
}  # fmt: skip
_PROBE: dict[str, Test] = {
    "t_rep_s": _number,
    "feasible": _flag,
    "reasons": _list_of(_text),
    "details": _list_of(_all_of({"reason": _text, "t_s": _maybe(_number), "detail": _text})),
    "maneuver": _maybe(_text),
    "solver_status": _text,
    "solver_detail": _text,
    "iterations": _whole,
    "solve_time_s": _maybe(_number),
    "check_time_s": _maybe(_number),
    "residuals": _table_of(_maybe(_number)),
    **_PEAKS,
}
_LATER: dict[str, Test] = {
    "peak_acceleration_mps2": _maybe(_number),
    "margin_m": _maybe(_number),
    "backend": _text,
    "jump_mps2": _maybe(_number),
}
_TRAJECTORY: dict[str, Test] = {
    "initial_time_step": _whole,
    "dt_s": lambda value: _number(value) and value > 0.0,
    **{
        name: _list_of(_maybe(_number))
        for name in ("t_s", "x_m", "y_m", "orientation_rad", "steering_rad", "speed_mps", "s_m", "l_m")
    },
}
_DETAIL: Mapping[str, Test] = {
    "reason": _text, "t_s": _maybe(_number), "detail": _text, "obstacle_id": _maybe(_whole),
}  # fmt: skip
_RELAXATION: Mapping[str, Test] = {
    **dict.fromkeys(("kind", "status", "unit", "detail"), _text),
    **dict.fromkeys(("obstacle_id", "obstacle_index"), _maybe(_whole)),
    **dict.fromkeys(("amount", "not_with", "proven_too_little", "tried_up_to"), _maybe(_number)),
    "found_by": _maybe(_text),
}
_EXPLANATION: Mapping[str, Test] = {
    "t_rep_s": _number,
    "exists_by": _maybe(_text),
    **dict.fromkeys(("asked", "decides", "not_tried"), _list_of(_text)),
    **dict.fromkeys(("proven", "obstacles_minimal", "obstacles_proven", "road_in_proof", "complete"), _flag),
    "obstacles": _maybe(
        _list_of(_all_of({"obstacle_id": _whole, "from_s": _maybe(_number), "to_s": _maybe(_number)}))
    ),
    "relaxations": _list_of(_all_of(_RELAXATION)),
}
_TERMINAL: Mapping[str, Test] = {
    "ending": lambda value: value in ("safe", "safe_unless_extended", "unsafe"),
    "sentence": _text,
    "maneuver": _maybe(_text),
    **{
        key: _maybe(_number)
        for key in ("from_s", "stands_s", "checked_until_s", "offset_m", "peak_deceleration_mps2")
    },
    "extended": _table_of(_maybe(_all_of(_DETAIL))),
    "details": _list_of(_all_of(_DETAIL)),
    "tried": _whole,
    "trajectory": _maybe(_table_of(_list_of(_number))),
}
_HIT: Mapping[str, Test] = {
    **{key: _maybe(_text) for key in ("maneuver", "found_by", "ends")},
    **{key: _maybe(_number) for key in ("contact_t_s", "impact_speed_mps", "own_speed_mps", "overlap_m")},
    "obstacle_id": _maybe(_whole),
    "from_behind": _maybe(_flag),
    "place_m": _maybe(_list_of(_number)),
    "trajectory": _maybe(_all_of(_TRAJECTORY)),
}
#: What every result has had since there are results.
_NEEDED: dict[str, Test] = {
    "scenario": _text,
    "provenance": _all_of({
        "kind": lambda value: value in ("official", "reconstruction", "file", "memory"),
        "name": _maybe(_text), "sha256": _maybe(_text),
    }),
    "backend": _text,
    "status": _text,
    "status_sentence": _text,
    "complete": _flag,
    "ttc_s": _maybe(_number),
    "f_ttr_s": _maybe(_number),
    "conflict": _all_of(
        {"kind": _text, "obstacle_id": _maybe(_whole), "t_s": _maybe(_number)},
        {"contact_obstacle_id": _maybe(_whole), "from_behind": _maybe(_flag), "detail": _text},
    ),
    "maneuver": _maybe(_text),
    **_PEAKS,
    "probes": _list_of(_all_of(_PROBE, _LATER)),
    "curve": _maybe(lambda value: isinstance(value, dict)),
    "t_end_s": _number,
    "trajectory": _all_of(_TRAJECTORY),
    "limits": _all_of({"a_min_mps2": _number, "a_max_mps2": _number}),
    "notes": _list_of(_text),
    "time_s": _table_of(_maybe(_number)),
    "config": lambda value: isinstance(value, dict),
}  # fmt: skip
#: What came later, or is not always there.
_OTHERS: dict[str, Test] = {
    "schema": _whole,
    "contact_ttc_s": _maybe(_number),
    "peak_acceleration_mps2": _maybe(_number),
    "metrics": _table_of(_metric),
    "reference": _maybe(lambda value: isinstance(value, dict)),
    "capabilities": lambda value: isinstance(value, dict),
    "solution_file": _maybe(_text),
    "figure_files": _list_of(_text),
    "report_file": _maybe(_text),
    "report_file_problem": _text,
    "scenario_file": _maybe(_text),
    "drawing_file": _maybe(_text),
    "trace_file": _text,
    "verdict_file": _maybe(_text),
    "checks_off": _list_of(_text),
    "repaired_by": _maybe(_text),
    "by_fallback": _maybe(_flag),
    "checked_until_s": _maybe(_number),
    "prediction_end": _maybe(_table_of(_number)),
    "onward": _maybe(_all_of({"kind": _text, "reached": _flag, "sentence": _text, "tried": _whole})),
    "terminal": _maybe(_all_of(_TERMINAL)),
    "explanation": _maybe(_all_of(_EXPLANATION)),
    "mitigation": _maybe(_all_of({**_HIT, "full_braking": _maybe(_all_of(_HIT))}, {"proven": _maybe(_text)})),
    "limits": _table_of(_maybe(_number)),
    "versions": lambda value: isinstance(value, dict),
    "config_given": _list_of(_text),
}


def require_record(record: Mapping[str, Any]) -> None:
    """Refuse what no repair wrote.

    Raises
    ------
    Damage
        If a key is missing or of another type. Whether the figures are true is for a certificate to say.
    """
    for key in (*_broken(record, _NEEDED), *_broken(record, _OTHERS, needed=False)):
        raise Damage(f"{key!r} is {'not what a repair writes there' if key in record else 'missing'}")
    steps = {len(column) for column in record["trajectory"].values() if isinstance(column, list)}
    if len(steps) != 1 or 0 in steps:
        raise Damage("'trajectory' has columns of different lengths, or none")
    for section in ("scene", "search", "checker", "repair", "reference", "limits"):
        if section in record["config"] and not isinstance(record["config"][section], dict):
            raise Damage(f"'config' has a section {section!r} that is none")
    if (record["curve"] is None) != (record["f_ttr_s"] is None):
        raise Damage("'f_ttr_s' does not go with 'curve'")
