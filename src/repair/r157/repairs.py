"""Repairs at the points, and where it is proven that nothing avoids a collision."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from repair.arrays import Array
from repair.progress import counted
from repair.r157.cases import Flags, Points
from repair.r157.drive import drive, keep
from repair.r157.models import FULL, Seen
from repair.r157.motion import HEADWAY, sight
from repair.r157.results import AT_SIGHT, Fate, Results, by_models
from repair.timegrid import INSTANT, steps_until

if TYPE_CHECKING:
    from repair.backend.base import RepairBackend
    from repair.preparation import Prepared

__all__ = ["MANNERS", "Asked", "with_repairs"]

_AFTER = 4.0  # how long after the contact of who keeps on the others' motions are known [s]
_NEAR = 0.2  # a proof is looked for where nobody begins later than this after the sight [s],
_EVERY = 20  # and at every so many of the other points with a conflict
_SAMPLES = 0.02  # of a repair's deceleration [s]
_CHUNK = 12  # points for one call of a worker

#: What a repair may do, in words, and the settings for it.
MANNERS: dict[str, tuple[str, ...]] = {
    "0.774 g": ("repair.lateral=none", f"limits.a_total={FULL:.6g}"),
    "brake": ("repair.lateral=none",),
    "swerve": (),
}
_ALWAYS = (
    "reference.source=constant", "search.delta_t=0.1", "search.rule=guided", "fallback=[]",
    "checker.clearance=0.0",
)  # fmt: skip


class Asked(NamedTuple):
    """What is looked at.

    Attributes
    ----------
    backends : tuple of str
    jobs : int
        Processes.
    """

    backends: tuple[str, ...]
    jobs: int = 1


class _Repair(NamedTuple):
    """Of one point, backend and manner: latest start, its peak deceleration, that of the start at sight.

    NaN where there is none.
    """

    f_ttr: float
    peak: float
    at_once: float


@dataclass(frozen=True)
class _Task:
    points: Points
    rows: tuple[int, ...]
    until: tuple[float, ...]  # horizon [s]
    seen: tuple[float, ...]  # [s]
    backends: tuple[str, ...]


@dataclass(frozen=True)
class FullBraking:
    """Braking as hard as possible from the sight on: what is left where nothing avoids it."""

    most: float
    stated: bool = True
    name: ClassVar[str] = "full braking"
    cases: ClassVar[tuple[str, ...]] = ("cut_in", "cut_out", "deceleration")
    delay: ClassVar[float] = 0.0
    keeps: ClassVar[bool] = False
    latched: ClassVar[bool] = False

    def following(self, speed: Array) -> Array:
        """2 s."""
        return HEADWAY * speed

    def dangerous(self, seen: Seen) -> Flags:
        """From when there is somebody to react to."""
        return seen.exposed

    def brake(self, seen: Seen, step: float) -> Array:
        """All there is."""
        return np.full_like(seen.speed, self.most)


def with_repairs(points: Points, asked: Asked, *, quiet: bool = False) -> Results:
    """Models, repairs, and proofs.

    Repairs know what the others will do, and begin when it is to be seen or later. ``swerve`` is asked where
    ``brake`` finds nothing.

    Parameters
    ----------
    points : Points
    asked : Asked
    quiet : bool
        No progress on stderr.
    """
    never = keep(points)
    conflict = np.flatnonzero(never.contact)
    found: dict[int, dict[tuple[str, str], _Repair]] = {}
    seen = sight(points)

    def tasks_for(rows: Any, backends: tuple[str, ...]) -> list[_Task]:
        until = never.time + _AFTER
        return [
            _Task(
                points,
                tuple(part.tolist()),
                tuple(until[part].tolist()),
                tuple(seen[part].tolist()),
                backends,
            )
            for part in _parts(rows)
        ]

    tasks = tasks_for(conflict, asked.backends)
    shown = False if quiet else None
    for made in counted(_run(_repaired, tasks, asked.jobs), len(tasks), f"parts of {points.case}", shown):
        found.update(made)
    models = by_models(points)
    fates = dict(models.fates)
    for backend in asked.backends:
        fates.update(_fates(points, backend, found, never.contact, seen))
    wanted = _worth_proving(fates, never.contact, seen)
    tasks = tasks_for(np.flatnonzero(wanted), ())
    proven = np.zeros(len(points), dtype=bool)
    words = f"parts of {points.case}, proofs"
    for rows in counted(_run(_proofs, tasks, asked.jobs), len(tasks), words, shown):
        proven[list(rows)] = True
    return Results(points, fates, models.proven, proven, wanted)


def _parts(rows: Any) -> list[Any]:
    # every so many-th row, so that each part has near and far ones and all take about as long
    count = max(1, -(-len(rows) // _CHUNK))
    return [rows[k::count] for k in range(count)] if len(rows) else []


def _run(work: Any, tasks: Sequence[_Task], jobs: int) -> Iterable[Any]:
    if jobs == 1:
        return map(work, tasks)
    from joblib import Parallel, delayed

    made: Iterable[Any] = Parallel(n_jobs=jobs, return_as="generator_unordered")(
        delayed(work)(task) for task in tasks
    )
    return made


def _worth_proving(fates: dict[str, Fate], conflict: Flags, seen: Array) -> Flags:
    """Where nobody avoids it, where it is close, and a sample of the rest: a proof there would be wrong."""
    avoided, latest = np.zeros_like(conflict), np.full(len(conflict), -np.inf)
    for fate in fates.values():
        avoided |= fate.asked & ~fate.struck & ~(fate.begun < seen)
        latest = np.fmax(latest, np.nan_to_num(fate.begun - seen, nan=-np.inf))
    close = latest <= _NEAR
    sample = np.zeros_like(conflict)
    sample[np.flatnonzero(conflict)[::_EVERY]] = True
    return np.asarray(conflict & (~avoided | close | sample))


def _fates(
    points: Points,
    backend: str,
    found: dict[int, dict[tuple[str, str], _Repair]],
    conflict: Flags,
    seen: Array,
) -> dict[str, Fate]:
    """Of one backend: at the F-TTR, and at sight. Who finds nothing brakes fully from the sight on."""
    from repair.problem.limits import resolve_limits
    from repair.problem.settings import LimitsConfig
    from repair.r157.scenario import DT
    from repair.vehicle.parameters import load_vehicle

    own = resolve_limits(LimitsConfig(), load_vehicle(1), 10.0, DT).a_total
    fates = {}
    for manner in MANNERS:
        hard = drive(points, FullBraking(FULL if manner == "0.774 g" else own))
        late, peak, at_once = (np.full(len(points), np.nan) for _ in range(3))
        for row, by in found.items():
            late[row], peak[row], at_once[row] = by[backend, manner]
        everywhere = np.ones(len(points), dtype=bool)
        for words, known, begun in (
            ("", peak, late),
            (AT_SIGHT, at_once, np.where(np.isnan(at_once), np.nan, seen)),
        ):
            struck = conflict & np.isnan(known)
            fates[f"{backend} {manner}{words}"] = Fate(
                everywhere, struck, struck & hard.sideways, np.where(struck, hard.time, np.nan),
                np.where(struck, hard.impact, np.nan), np.where(struck, hard.peak, known), begun,
                manner == "swerve",
            )  # fmt: skip
    return fates


# ---------------------------------------------------------------------- in a worker


@lru_cache(maxsize=32)
def _config(backend: str, manner: str) -> Any:
    from repair.config import load_config

    return load_config(backend=backend, overrides=[*_ALWAYS, *MANNERS[manner]])


@lru_cache(maxsize=8)
def _backend(name: str) -> RepairBackend:
    from repair.api import make

    return make(_config(name, "swerve"))


def _prepared(
    points: Points, row: int, until: float, backend: str, manner: str, scene: Any = None
) -> Prepared:
    from repair.preparation import prepare
    from repair.r157.scenario import scene_at

    return prepare(scene or scene_at(points, row, until), _config(backend, manner))


def _repaired(task: _Task) -> dict[int, dict[tuple[str, str], _Repair]]:
    from repair.r157.scenario import scene_at

    made: dict[int, dict[tuple[str, str], _Repair]] = {}
    for row, until, seen in zip(task.rows, task.until, task.seen, strict=True):
        scene = scene_at(task.points, row, until)
        by: dict[tuple[str, str], _Repair] = {}
        for backend in task.backends:
            for manner in MANNERS:
                if manner == "swerve" and not np.isnan(by[backend, "brake"].at_once):
                    # braking is one of the things that it may do
                    by[backend, manner] = by[backend, "brake"]
                    continue
                prepared = _prepared(task.points, row, until, backend, manner, scene)
                by[backend, manner] = _search(prepared, _backend(backend), seen)
        made[row] = by
    return made


def _search(prepared: Prepared, backend: RepairBackend, seen: float) -> _Repair:
    """The F-TTR where it comes after the sight, and a repair at the first point of the grid after it."""
    from repair.api import find

    step = prepared.config.search.delta_t
    begin = steps_until(seen + step, step) * step if seen > 0.0 else 0.0
    latest = find(prepared, backend)
    late, peak, at_once = np.nan, np.nan, np.nan
    if latest.best is not None and latest.f_ttr is not None and latest.f_ttr >= seen - INSTANT:
        late, peak = latest.f_ttr, _peak(latest.best.solve.curve)
    first = next((probe for probe in latest.probes if abs(probe.t_rep - begin) < INSTANT), None)
    if first is None and begin < prepared.conflict.time:
        probes = find(prepared, backend, visits=[begin]).probes
        first = probes[0] if probes else None
    if first is not None and first.feasible:
        at_once = _peak(first.solve.curve)
        if np.isnan(late):  # a search may end before it comes here
            late, peak = begin, at_once
    return _Repair(late, peak, at_once)


def _peak(curve: Any) -> float:
    """Largest deceleration along the road [m/s²]."""
    t = np.arange(curve.t_start, curve.t_end, _SAMPLES)
    return float(max(0.0, -curve.sample(t).acceleration[:, 0].min()))


def _proofs(task: _Task) -> list[int]:
    """The rows at which it is proven that no motion of the vehicle avoids it from the sight on."""
    from repair.bounds.latest import proof_at
    from repair.bounds.settings import BoundConfig

    settings, proven = BoundConfig(after=_AFTER - 1.0), []
    for row, until, seen in zip(task.rows, task.until, task.seen, strict=True):
        prepared = _prepared(task.points, row, until, "ego", "swerve")
        if proof_at(prepared, seen, settings, "vehicle") is not None:
            proven.append(row)
    return proven


def unexplained(results: Results, policy: str, models: Sequence[str]) -> Flags:
    """Where a policy is struck, and one of the models is not, which does not begin before the sight."""
    fate, seen = results.fates[policy], sight(results.points)
    avoided = np.zeros(len(results.points), dtype=bool)
    for name in models:
        if name in results.fates:
            one = results.fates[name]
            avoided |= ~one.struck & ~(one.begun < seen)
    return np.asarray(fate.asked & fate.struck & avoided)
