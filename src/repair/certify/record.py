"""What ``result.json`` says, held against what it would say if the result were made again."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from repair.certify.certificate import CertificateRow, equal, said
from repair.curves.base import Curve
from repair.errors import RepairError

if TYPE_CHECKING:
    from repair.preparation import Prepared
    from repair.search.result import SearchResult

__all__ = ["Again", "differences", "other_versions", "record_rows", "searched_again"]

#: What a run is free to differ in: times of the clock, versions, names of files, iterations.
_FREE = frozenset(
    {"time_s", "versions", "solution_file", "figure_files", "scenario_file", "scenario_sha256",
     "scenario_file_problem", "report_file", "report_file_problem", "modes", "drawing_file", "provenance",
     "trace_file", "verdict_file",
     "config", "config_given", "build_time_s", "solve_time_s", "check_time_s", "iterations", "bound",
     "explanation"}
)  # fmt: skip
#: What follows from the scenario, the configuration and the curve alone. Not how it ends: a stop is driven on
#: from the curve's very end, and makes more of its last digits than they say.
_DIRECT = (
    "schema", "scenario", "backend", "ttc_s", "contact_ttc_s", "conflict", "reference", "t_end_s", "limits",
    "notes", "trajectory", "peak_deceleration_mps2", "peak_acceleration_mps2",
    "peak_lateral_acceleration_mps2", "peak_total_acceleration_mps2", "min_speed_mps", "max_speed_mps",
)  # fmt: skip
_EXACT, _SOLVED = 1e-6, 1e-4  # a solver on another machine ends a little elsewhere
_SHOWN = 8


@dataclass(frozen=True)
class Again:
    """The record made again.

    Attributes
    ----------
    record : dict or None
        By a search; None where it cannot be repeated here.
    direct : dict
        By the curve in the file, without a search.
    limited : bool
        The search had a time limit or was interrupted; what it visited has to come out the same.
    other : str
        Why the search may come out otherwise; empty where it may not.
    """

    record: dict[str, Any] | None
    direct: dict[str, Any]
    limited: bool
    other: str = ""


def other_versions(content: Mapping[str, Any]) -> str:
    """Which packages are installed in other versions than a result was made with, in words."""
    from importlib.metadata import PackageNotFoundError, version

    def here(name: str) -> str | None:
        try:
            return version(name)
        except PackageNotFoundError:
            return None

    told = content.get("versions") or {}
    names = sorted(n for n, v in told.items() if n != "python" and v != here(n))
    return f"made with other versions of {', '.join(names)}" if names else ""


def searched_again(content: Mapping[str, Any], prepared: Prepared, curve: Curve | None) -> Again:
    """Search again, and work out beside it what needs no search.

    Parameters
    ----------
    content : mapping
        What ``result.json`` holds.
    prepared : Prepared
        The scenario, loaded and laid out anew.
    curve : Curve or None
        The repaired curve in ``content``.
    """
    from repair.search.result import SearchResult, SearchStatus

    other = other_versions(content)
    status = SearchStatus.NO_CONFLICT if curve is None else SearchStatus.FOUND
    f_ttr = float("inf") if curve is None else float(content["f_ttr_s"])
    direct = _record(prepared, SearchResult(status, prepared.conflict, f_ttr, curve))
    limited = prepared.config.search.time_limit is not None or not content.get("complete", True)
    try:
        made = _record(prepared, None)
    except RepairError as error:  # a backend that is not here
        return Again(None, direct, limited, str(error))
    return Again(made, direct, limited, other)


def _record(prepared: Prepared, given: SearchResult | None) -> dict[str, Any]:
    """The record of a search, or of what is given as its answer."""
    from repair.backend.base import Capabilities
    from repair.baselines.evasive.at_ttr import AtTtr
    from repair.metrics.base import Asked
    from repair.metrics.registry import measure
    from repair.outcome.driven import what_is_driven
    from repair.outcome.record import record_of
    from repair.search.several import capabilities_of, search_with
    from repair.solvers.registry import make_backend

    config, asked = prepared.config, Asked(prepared, prepared.config.evasive)
    found, capabilities = given, Capabilities()
    wanted = list(config.metrics) if given is None else []
    if found is None:
        backend = make_backend(config.backend, config)
        at_ttr = config.driver == "at_ttr"
        around = AtTtr(prepared.source, asked.evasive) if at_ttr else None
        found = search_with(
            backend, config.backend, prepared, replace(config.search, time_limit=None), around=around,
            visits=around.visits if around else None, too_late=prepared.too_late,
            hopeless=None if around else prepared.hopeless,
        )  # fmt: skip
        capabilities = capabilities_of(backend, found)
        wanted += ["ttr"] if at_ttr and found.complete and "ttr" not in wanted else []
    driven = what_is_driven(prepared, found)
    metrics = measure(wanted, asked) if wanted else {}
    return record_of(
        prepared,
        found,
        driven.states,
        driven.peaks,
        {},
        metrics,
        capabilities,
        terminal=driven.terminal,
        onward=driven.onward,
    )


def differences(said: Any, made: Any, tolerance: float, path: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Where two plain values differ: the way there, and both; angles by what they are turned."""
    if isinstance(said, Mapping) and isinstance(made, Mapping):
        for key in [*made, *(k for k in said if k not in made)]:
            if key not in _FREE:
                inner = f"{path}.{key}" if path else str(key)
                yield from differences(said.get(key, _Missing), made.get(key, _Missing), tolerance, inner)
    elif isinstance(said, list) and isinstance(made, list):
        if len(said) != len(made):
            yield f"{path} (length)", len(said), len(made)
        for i, (a, b) in enumerate(zip(said, made, strict=False)):
            found = next(differences(a, b, tolerance, f"{path}[{i}]"), None)
            if found is not None:
                yield found
                if not isinstance(a, Mapping):
                    return  # one of a column is enough
    elif _number(said) and _number(made):
        off = abs(float(said) - float(made))
        if path.partition("[")[0].endswith("_rad"):
            off = abs((off + math.pi) % (2.0 * math.pi) - math.pi)
        if not off <= tolerance * max(1.0, abs(float(made))):
            yield path, said, made
    elif said != made or isinstance(said, bool) != isinstance(made, bool):
        yield path, said, made


class _Missing:
    """Stands for a key that is not there."""


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def record_rows(content: Mapping[str, Any], again: Again) -> list[CertificateRow]:
    """One row for the whole record, and one for the first difference in each of its keys."""
    direct = {key: again.direct[key] for key in _DIRECT if key in again.direct}
    found = list(differences({key: content.get(key, _Missing) for key in direct}, direct, _EXACT))
    if (content.get("provenance") or {}).get("kind") == "memory":  # only there is said who stands for whom
        found = [one for one in found if not one[0].startswith("notes")]
        gone = [note for note in direct.get("notes", ()) if note not in (content.get("notes") or ())]
        found += [("notes", _Missing, note) for note in gone]
    if again.other:  # another version may have said less
        found = [one for one in found if one[1] is not _Missing]
    found += _by_the_probes(content, again.direct)
    rest: list[tuple[str, Any, Any]] = []
    if again.record is not None and not again.limited:
        made = {key: value for key, value in again.record.items() if key not in direct}
        told = {key: value for key, value in content.items() if key not in direct}
        rest = list(differences(told, made, _SOLVED))
    elif again.record is not None:  # what had been found when it ended
        visited = {(p["t_rep_s"], p["backend"]): p for p in again.record["probes"]}
        for i, probe in enumerate(content.get("probes") or []):
            same = visited.get((probe.get("t_rep_s"), probe.get("backend")))
            if same is not None and probe.get("solver_status") != "time_limit":
                rest += differences(probe, same, _SOLVED, f"probes[{i}]")
    claim = not again.other
    rows = [_differs(*one) for one in _firsts([*found, *(rest if claim else [])])]
    count = len(found) + (len(rest) if claim else 0)
    rows.append(equal("record: differences", count, 0, "searched again" if claim else "recomputed"))
    if again.other:
        remark = f"{len(rest)} differences; {again.other}" if again.record is not None else again.other
        rows.append(said("search repeated", not rest, "searched again", remark, claim=False))
    return rows


def _firsts(found: list[tuple[str, Any, Any]]) -> list[tuple[str, Any, Any]]:
    """The first difference in each key of the record."""
    first: dict[str, tuple[str, Any, Any]] = {}
    for one in found:
        first.setdefault(one[0].partition(".")[0].partition("[")[0], one)
    return list(first.values())[:_SHOWN]


def _differs(path: str, said: Any, made: Any) -> CertificateRow:
    numbers = [float(v) if _number(v) else math.nan for v in (said, made)]
    words = "" if all(math.isfinite(v) for v in numbers) else f"says {_short(said)}, is {_short(made)}"
    return CertificateRow(
        f"record: {path}", numbers[0], numbers[1], numbers[1] - numbers[0], False, "recomputed", words
    )


def _short(value: Any) -> str:
    text = "nothing" if value is _Missing or value is None else str(value)
    return text if len(text) <= 40 else text[:37] + "..."


def _by_the_probes(content: Mapping[str, Any], made: Mapping[str, Any]) -> list[tuple[str, Any, Any]]:
    """Without a search: status, F-TTR and manoeuvre as the conflict and the visited times have them."""
    status = "no_conflict" if made["ttc_s"] is None else "found"
    found: list[tuple[str, Any, Any]] = []
    if content.get("status") != status:
        found.append(("status", content.get("status"), status))
    feasible = [p for p in content.get("probes") or [] if p.get("feasible")]
    last: Any = max(feasible, key=lambda p: p["t_rep_s"], default={})
    for key, inner in (("f_ttr_s", "t_rep_s"), ("maneuver", "maneuver")):
        if content.get(key) != last.get(inner):
            found.append((key, content.get(key), last.get(inner)))
    return found
