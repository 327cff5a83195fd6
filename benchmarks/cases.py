"""What is measured on: the paper's two scenarios, prepared for each backend."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from benchmarks import literal
from repair.config import load_config
from repair.paper.synthetic import write_scenario
from repair.preparation import Prepared, prepare
from repair.scene.commonroad import load_scene
from repair.scene.scene import Scene
from repair.search.result import SearchResult
from repair.search.search import search_f_ttr
from repair.solvers.registry import make_backend

OFFICIAL_FILE = "DEU_Flensburg-6_1_T-1.xml"
#: name in the tables -> (backend, what is set for it)
BACKENDS: dict[str, tuple[str, tuple[str, ...]]] = {
    "ego": ("ego", ()),
    "qptr": ("qptr", ()),
    "qptr osqp": ("qptr", ("qptr.solver=osqp",)),
    "casadi sqpmethod": ("casadi", ("casadi.solver=sqpmethod",)),
    "casadi ipopt": ("casadi", ("casadi.solver=ipopt",)),
}
#: The same with the rule that takes fewer plans; the others bisect, as the literal search does.
GUIDED: dict[str, tuple[str, tuple[str, ...]]] = {
    f"{name}, guided": (backend, (*own, "search.rule=guided")) for name, (backend, own) in BACKENDS.items()
}


@dataclass
class Context:
    """What all cases share."""

    quick: bool = False
    peers: str | None = None
    folder: Path = field(default_factory=lambda: Path(tempfile.mkdtemp(prefix="repair-benchmarks-")))

    @property
    def scenarios(self) -> Path | None:
        """The folder COMMONROAD_SCENARIOS, if there is one."""
        value = os.environ.get("COMMONROAD_SCENARIOS")
        return Path(value).resolve() if value and Path(value).is_dir() else None

    def path(self, number: int, *, bundled: bool = False) -> Path:
        """File of Scenario 1 or 2: the official one where it is there, else the reconstruction."""
        if number == 1 and self.scenarios is not None and not bundled:
            official = self.scenarios / OFFICIAL_FILE
            if official.is_file():
                return official
        return _written(self.folder, number)

    def title(self, number: int) -> str:
        """Name and provenance of a scenario."""
        official = self.path(number).name == OFFICIAL_FILE
        return f"Scenario {number} ({'official file' if official else 'reconstruction'})"

    def largest(self) -> Path:
        """The largest shared scenario: of COMMONROAD_SCENARIOS, else Scenario 1."""
        files = list(self.scenarios.glob("*.xml")) if self.scenarios else []
        return max(files, key=lambda f: f.stat().st_size) if files else self.path(1)

    def rounds(self, full: int, quick: int) -> int:
        return quick if self.quick else full


@lru_cache(maxsize=8)
def _written(folder: Path, number: int) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return Path(write_scenario(f"scenario_{number}", folder))


@lru_cache(maxsize=8)
def scene_of(path: Path) -> Scene:
    """The scene of a file, loaded once."""
    return load_scene(path)


@dataclass(frozen=True)
class Case:
    """One backend on one scenario, ready to search."""

    prepared: Prepared
    backend: Any
    config: Any

    def search(self) -> SearchResult:
        """The whole search, all checks included."""
        p = self.prepared
        return search_f_ttr(p.source, p.conflict, self.backend, p.checker, self.config.search)

    def literal_plans(self, t_reps: Sequence[float]) -> None:
        """The literal transcription on every open way past at ``t_reps``, whatever its verdicts are."""
        p = self.prepared
        for t_rep in t_reps:
            for problem in p.source.at(t_rep):
                literal.probe(problem, p.checker, self.config, "direct")

    def literal(self, check: str = "direct") -> literal.LiteralResult:
        """The same search by the literal transcription."""
        p = self.prepared
        return literal.literal_search(p.source, p.conflict, p.checker, self.config, check)

    def baseline(self) -> tuple[str, Callable[[], Any], str]:
        """What this case is compared with: name, call, and the literal transcription's own answer.

        It is the literal search, unless its verdicts (it only looks at inflated boxes) end that after fewer
        t_rep than the package visits; then the same work: a literal repair for every repair of the package.
        """
        slow, visited = self.literal(), [p.t_rep for p in self.search().probes]
        answer = f"F-TTR {slow.f_ttr:g} s, {len(slow.probes)} plans" if slow.f_ttr is not None else "no F-TTR"
        if len({p.t_rep for p in slow.probes}) >= len(visited):
            return "literal search", self.literal, answer
        note = f"at the {len(visited)} t_rep of ego; its own search: {answer}"
        return "literal plans", lambda: self.literal_plans(visited), note


def case(path: Path, number: int, backend: str, *overrides: str, scene: Scene | None = None) -> Case:
    """Prepare a scenario, with its preset, for a name of :data:`BACKENDS` or :data:`GUIDED`."""
    name, own = (BACKENDS | GUIDED)[backend]
    config = load_config(preset=f"scenario_{number}", backend=name, overrides=[*own, *overrides])
    return Case(prepare(scene or scene_of(path), config), make_backend(name, config), config)


def verdict(found: SearchResult) -> str:
    """F-TTR and the number of plans, for the table."""
    f_ttr = "none" if found.f_ttr is None else f"{found.f_ttr:g} s"
    return f"F-TTR {f_ttr}, {len(found.probes)} plans"


def chosen_problem(made: Case, t_rep: float = 0.0) -> Any:
    """The problem at ``t_rep`` whose repair is feasible; the first one where none is."""
    problems = made.prepared.source.at(t_rep)
    for problem in problems:
        solved = made.backend.solve(problem)
        if solved.curve is not None and made.prepared.checker.check(problem, solved.curve).ok:
            return problem
    return problems[0]
