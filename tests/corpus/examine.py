"""One file: through every reference and backend, and again when moved, turned and mirrored."""

from __future__ import annotations

import tempfile
import traceback
from pathlib import Path
from typing import Any

import numpy as np
from tests.corpus.judging import Judge
from tests.corpus.moving import CHANGES, changed
from tests.corpus.records import Examined, Row, Settings

import repair

__all__ = ["examine", "lost"]

_SENTENCE = 600  # characters


def lost(path: Path, why: str, settings: Settings) -> Examined:
    """What is known of a file whose process ended or hung."""
    found = Examined(_name(path, settings))
    found.says("traceback", why)
    return found


def _name(path: Path, settings: Settings) -> str:
    try:
        return str(path.relative_to(settings.base))
    except ValueError:
        return path.name


def examine(path: Path, settings: Settings) -> Examined:
    """Everything that is asked of one file."""
    found = Examined(_name(path, settings))
    try:
        for row in _searched(path, settings, found):
            found.rows.append(row)
        _agree(found)
        if settings.invariance and found.rows:
            _unchanged(path, settings, found)
    except Exception as error:
        found.says("traceback", _where(error))
    return found


def _where(error: Exception) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    last = ([f for f in frames if "/repair/" in f.filename.replace("\\", "/")] or frames)[-1]
    words = " ".join(str(error).split())[:200]
    return f"{type(error).__name__} in {Path(last.filename).name}:{last.lineno} {last.name}: {words}"


# -- searches --------------------------------------------------------------------------------------


def _searched(path: Path, settings: Settings, found: Examined, judged: bool = True):
    """Rows of all references and backends, each result judged on the way."""
    from repair.api import search
    from repair.preparation import prepare
    from repair.solvers.registry import make_backend

    try:
        scene = repair.load_scene(path, repair.load_config(overrides=settings.overrides))
    except repair.RepairError as error:
        found.refused = str(error)
        _sentence(error, found, path.name)
        return
    judge = Judge(path, scene, found) if judged else None
    for reference in settings.references:
        for number, backend in enumerate(settings.backends):
            keys = [*settings.overrides, f"reference.source={reference}"]
            config = repair.load_config(backend=backend, overrides=keys)
            try:
                prepared = prepare(scene, config)
                if judge is not None and number == 0:
                    judge.reference(prepared, reference)
                result = search(prepared, make_backend(backend, config))
                result.to_dict()
            except repair.RepairError as error:
                _sentence(error, found, None, backend, reference)
                yield Row(backend, reference, "refused", np.inf, np.inf, None, why=str(error))
                continue
            except Exception as error:
                found.says("traceback", _where(error), backend, reference)
                yield Row(backend, reference, "traceback", np.inf, np.inf, None)
                continue
            clean = judge is not None and judge.result(result, backend, reference)
            verified = clean and result.status.value == "found"
            if result.search.best is not None and result.search.best.fallback:
                found.counts[f"by a fallback of {backend}"] += 1
            yield Row(
                backend,
                reference,
                result.status.value,
                result.ttc,
                result.search.conflict.contact_time,
                result.f_ttr,
                verified,
                _why(result),
            )


def _sentence(
    error: Exception, found: Examined, name: str | None, backend: str = "", reference: str = ""
) -> None:
    """A refusal is one line that can be read, and names the file that it is about."""
    words = str(error)
    if not words.strip() or "\n" in words or len(words) > _SENTENCE:
        found.says("refusal", f"{type(error).__name__} is no sentence: {words[:200]!r}", backend, reference)
    elif name is not None and name not in words:
        found.says("refusal", f"does not name the file: {words}", backend, reference)


def _why(result: Any) -> str:
    """Why the first time-to-repair that was looked at has no repair."""
    if not result.search.probes or result.status.value == "found":
        return ""
    probe = min(result.search.probes, key=lambda p: p.t_rep)
    details = "; ".join(f"{v.reason.value} at {v.time:.2f} s: {v.detail}" for v in probe.verdict.violations)
    return f"{'; '.join(probe.tried) or probe.solve.status.value}" + (f" | {details}" if details else "")


# -- comparing -------------------------------------------------------------------------------------


def _agree(found: Examined) -> None:
    """Where one backend's repair is verified, no other finds nothing: or it is listed with the reason."""
    verified = {(row.reference, row.backend) for row in found.rows if row.verified}
    for row in found.rows:
        others = sorted(b for r, b in verified if r == row.reference)
        if others:
            found.counts["repairable"] += 1
        if others and row.status in ("none_feasible", "budget_exhausted"):
            reason = f"{row.status}, and {' and '.join(others)} repairs it: {row.why}"
            found.says("agreement", reason, row.backend, row.reference, told=True)


def _unchanged(path: Path, settings: Settings, found: Examined) -> None:
    """The same situation moved, turned and mirrored has the same answers."""
    data = path.read_bytes()
    for name, change in CHANGES.items():
        text = changed(data, change)
        if text is None:
            found.counts[f"not {name}"] += 1
            continue
        other = Examined(found.file)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / path.name
            file.write_bytes(text)
            rows = list(_searched(file, settings, other, judged=False))
        for deviation in other.deviations:
            found.says(deviation.kind, f"{name}: {deviation.reason}", deviation.backend, deviation.reference)
        if other.refused:
            found.says(name, f"refused: {other.refused}")
        for here, there in zip(found.rows, rows, strict=False):
            found.counts["compared after a change"] += 1
            if differs := _differences(here, there):
                found.says(name, differs, here.backend, here.reference, told=True)


def _differences(here: Row, there: Row) -> str:
    parts = []
    if here.status != there.status:
        parts.append(f"status {here.status} -> {there.status}")
    for name, most in (("ttc", 1e-6), ("contact", 5e-3), ("f_ttr", 1e-6)):
        a, b = getattr(here, name), getattr(there, name)
        a, b = (np.nan if v is None else float(v) for v in (a, b))
        if not (a == b or abs(a - b) <= most or (np.isnan(a) and np.isnan(b))):
            parts.append(f"{name} {a:.3f} -> {b:.3f}")
    return ", ".join(parts)
