"""A small round of the mutation fuzzer; docs/fuzzing.md has the large one."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.fuzz.run import BUG, Settings, fuzz, make_case, scenario_files, table


@pytest.fixture(scope="module")
def files(scenarios: Path) -> tuple[Path, ...]:
    return scenario_files(scenarios)


def test_nothing_breaks(files: tuple[Path, ...], tmp_path: Path) -> None:
    settings = Settings(files[:14], seed=7, keep=tmp_path / "broken")
    outcomes = fuzz(range(40), settings)
    assert len(outcomes) == 40
    broken = [f"{o.index} {o.family} {o.name}: {o.detail}" for o in outcomes if o.word == BUG]
    assert not broken, f"{table(outcomes)}\n" + "\n".join(broken)
    assert sum(o.word == "found" for o in outcomes) > 2  # some get all the way


def test_same_seed_same_files(files: tuple[Path, ...], tmp_path: Path) -> None:
    settings = Settings(files[:14], seed=7)
    for index in (0, 20, 36, 40, 45):
        made = []
        for name in ("first", "second"):
            (tmp_path / f"{index}{name}").mkdir()
            case = make_case(index, settings, tmp_path / f"{index}{name}")
            made.append((case.config or case.scenario).read_bytes())
        assert made[0] == made[1]
