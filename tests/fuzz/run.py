"""Runs damaged input through the pipeline in worker processes and counts what comes out.

Right outcomes are a result (whatever its status) or a :class:`repair.errors.RepairError` that names the
input. Anything else is a bug: another exception, an end of the process, no answer within the hard limit,
a file written half, a result that is no strict JSON.
"""

from __future__ import annotations

import errno
import json
import os
import random
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any
from unittest import mock

from tests.fuzz import configs, mutate
from tests.workers import answers

__all__ = ["Case", "Outcome", "Settings", "fuzz", "run_case", "scenario_files", "table"]

BUG = "BUG"
CONFIGS = ("extremes", "types", "garbage")
SOLUTIONS = ("generic", "jitter", "scale_number", "bytes", "foreign")
_SLOTS = (
    *(("scenario: XML", name) for name in sorted(mutate.XML_MUTATIONS)),
    *(("scenario: bytes", name) for name in sorted(mutate.BYTE_MUTATIONS)),
    *(("configuration", name) for name in CONFIGS),
    *(("solution file", name) for name in SOLUTIONS),
)


@dataclass(frozen=True)
class Settings:
    """``files`` ordered by size; ``limit``: hard limit for one input [s]; ``keep``: folder for what broke."""

    files: tuple[Path, ...]
    seed: int = 0
    limit: float = 30.0
    keep: Path | None = None
    jobs: int = 1


@dataclass(frozen=True)
class Case:
    """One damaged input: written into ``folder`` by :func:`make_case`."""

    family: str
    name: str
    scenario: Path
    overrides: tuple[str, ...]
    config: Path | None


@dataclass(frozen=True)
class Outcome:
    """What an input came to; ``word`` is a status, the name of a RepairError, or BUG."""

    index: int
    family: str
    name: str
    word: str
    detail: str = ""


def scenario_files(folder: Path) -> tuple[Path, ...]:
    """All scenario files of the folder and of its sibling ``traps``, small ones first."""
    found = [*folder.glob("*.xml"), *folder.parent.glob("traps/*.xml")]
    return tuple(sorted(found, key=lambda p: (p.stat().st_size, str(p))))


# -- one input -------------------------------------------------------------------------------------


def make_case(index: int, settings: Settings, folder: Path) -> Case:
    """Damage something; all of it follows from the seed and the index."""
    rng = random.Random(f"{settings.seed}:{index}")
    family, name = _SLOTS[index % len(_SLOTS)]
    # Mostly small files: half of the inputs come from the smallest sixth.
    base = settings.files[int(len(settings.files) * rng.random() ** 4)]
    small = rng.choice(settings.files[:6])
    overrides = ["search.time_limit=1.0"]
    if family == "configuration":
        config = folder / "settings.yaml"
        config.write_bytes(configs.config_text(rng, name))
        return Case(family, name, small, tuple(overrides), config)
    if family == "solution file":
        path, (scenario, data) = folder / "solution.xml", _solution(settings.files)
        if name == "foreign":
            data = data.replace(b"benchmark_id=", b'benchmark_id="KS1:JB1:DEU_Other-1_1_T-1:2020a" x=', 1)
        elif name == "bytes":
            data, name = mutate.damage_bytes(rng, data, rng.choice(sorted(mutate.BYTE_MUTATIONS)))
        else:
            data, name = mutate.damage_xml(rng, data, name, stack=name == "generic")
        path.write_bytes(data)
        overrides += ["reference.source=file", f"reference.file='{path}'"]
        return Case(family, name, scenario, tuple(overrides), None)
    damage = mutate.damage_xml if family == "scenario: XML" else mutate.damage_bytes
    data, name = damage(rng, base.read_bytes(), name)
    path = folder / base.name
    path.write_bytes(data)
    if rng.random() < 0.3:
        overrides.append(f"reference.source={rng.choice(['constant', 'accelerate', 'recorded'])}")
    if rng.random() < 0.1:
        overrides.append(f"scene.after_prediction={rng.choice(['hold', 'constant_velocity'])}")
    return Case(family, name, path, tuple(overrides), None)


@lru_cache(maxsize=1)
def _solution(files: tuple[Path, ...]) -> tuple[Path, bytes]:
    """A solution file of the first file that has one, and that file."""
    from commonroad.common.solution import CommonRoadSolutionWriter

    from repair.api import repair

    for file in files:
        result = repair(file)
        if result.search.curve is not None:
            return file, CommonRoadSolutionWriter(result.to_solution()).dump().encode()
    raise LookupError("no file has a repair")


def run_case(case: Case, rng: random.Random, folder: Path) -> tuple[str, str]:
    """Whole pipeline on one input; returns the outcome's word and its detail."""
    from repair.api import search
    from repair.config import load_config
    from repair.errors import ConfigError, RepairError
    from repair.io.result_json import to_json
    from repair.preparation import prepare
    from repair.scene.commonroad import load_scene
    from repair.solvers.registry import make_backend

    try:
        config = load_config(file=case.config, overrides=case.overrides)
        backend = make_backend("ego", config)
    except RepairError as error:
        return _judged(error, None)
    try:
        scene = load_scene(case.scenario, config)
    except ConfigError as error:
        return _judged(error, None)
    except RepairError as error:
        return _judged(error, case.scenario.name)
    try:
        result = search(prepare(scene, config), backend)
    except RepairError as error:
        return _judged(error, None)
    to_json(result.to_dict())  # strict: a NaN in it is a ValueError
    if rng.random() < 0.25:
        problem = _saved(result, rng, folder / "out" / "here")
        if problem:
            return BUG, problem
    return result.status.value, ""


def _judged(error: Exception, name: str | None) -> tuple[str, str]:
    """A RepairError has to be one sentence, and to name the file that it is about."""
    text = str(error)
    if not text or len(text) > 5000:
        return BUG, f"{type(error).__name__} with a message of {len(text)} characters"
    if name is not None and name not in text:
        return BUG, f"{type(error).__name__} does not name the file: {text}"
    return type(error).__name__, text


def _saved(result: Any, rng: random.Random, folder: Path) -> str:
    """Save; sometimes with a disk that fills up. Returns what is wrong with what is there then."""
    from repair import load_result
    from repair.errors import OutputError

    figure, full = rng.random() < 0.05, rng.random() < 0.4
    left = rng.randrange(1, 4)

    def fsync(_: int) -> None:
        nonlocal left
        left -= 1
        if full and left <= 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    try:
        with mock.patch("os.fsync", fsync):
            written = result.save(folder, figure=figure)
    except OutputError as error:
        if not full:
            raise
        if folder.parent.exists():
            return f"left behind after {error}: {sorted(p.name for p in folder.parent.rglob('*'))}"
        return ""
    there = sorted(folder.iterdir())
    if there != sorted(written):
        return f"written {written}, but there is {there}"
    content = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    if load_result(folder).record != content:
        return "what is read back is not what is in result.json"
    return ""


def _outcome(index: int, settings: Settings) -> Outcome:
    family, name = _SLOTS[index % len(_SLOTS)]
    with tempfile.TemporaryDirectory(prefix="repair-fuzz-") as aside:
        folder = Path(aside)
        try:
            case = make_case(index, settings, folder)
            name = case.name
            word, detail = run_case(case, random.Random(f"{settings.seed}:{index}:run"), folder)
        except Exception as error:
            word, detail = BUG, _where(error)
        if word == BUG and settings.keep is not None:
            _keep(folder, settings.keep, index)
    return Outcome(index, family, name, word, detail)


def _where(error: Exception) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if f"{os.sep}repair{os.sep}" in f.filename] or frames
    last = own[-1]
    text = " ".join(str(error).split())[:200]
    return f"{type(error).__name__} in {Path(last.filename).name}:{last.lineno} {last.name}: {text}"


def _keep(folder: Path, keep: Path, index: int) -> None:
    keep.mkdir(parents=True, exist_ok=True)
    for path in folder.iterdir():
        if path.is_file():
            (keep / f"{index}-{path.name}").write_bytes(path.read_bytes())


# -- many inputs ------------------------------------------------------------------------------------


def fuzz(
    indices: Sequence[int], settings: Settings, on_outcome: Callable[[Outcome], None] = lambda _: None
) -> list[Outcome]:
    """Run the inputs of the given indices; outcomes in the order of the indices."""

    def lost(index: int, why: str) -> Outcome:
        family, name = _SLOTS[index % len(_SLOTS)]
        return Outcome(index, family, name, BUG, why)

    found: list[Outcome] = []
    work = partial(_outcome, settings=settings)
    for outcome in answers(indices, work, lost, jobs=settings.jobs, limit=settings.limit):
        found.append(outcome)
        on_outcome(outcome)
    return sorted(found, key=lambda o: o.index)


def table(outcomes: Sequence[Outcome]) -> str:
    """Counts by family and outcome, as a Markdown table."""
    words = ("found", "no_conflict", "none_feasible", "already_colliding", "budget_exhausted")
    others = sorted({o.word for o in outcomes} - {*words, BUG})
    columns = [*words, *others, BUG]
    rows = [["damaged", "inputs", *columns]]
    families = list(dict.fromkeys(family for family, _ in _SLOTS))
    for family in [*families, "all"]:
        own = [o for o in outcomes if family in (o.family, "all")]
        counts = Counter(o.word for o in own)
        rows.append([family, str(len(own)), *(str(counts[c]) for c in columns)])
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    lines.insert(1, "| --- |" + " ---: |" * (len(columns) + 1))
    return "\n".join(lines)


def report(outcomes: Sequence[Outcome], stream: Any = sys.stdout) -> None:
    """Print the table and every bug."""
    print(table(outcomes), file=stream)
    for outcome in outcomes:
        if outcome.word == BUG:
            print(f"BUG {outcome.index} [{outcome.family}: {outcome.name}] {outcome.detail}", file=stream)
