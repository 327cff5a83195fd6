"""The same input gives the same result, byte for byte but for times: in one process, in two, in a sweep."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from repair.api import repair
from repair.study.rows import SweepSettings
from repair.study.run import sweep

FILES = ("DEU_Muc-4_1_T-1.xml", "C-DEU_B471-1_1_T-1.xml", "ZAM_Urban-3_3.xml", "BEL_Nivelles-16_3_T-1.xml")

PROGRAM = """
import sys
from repair.api import repair
for name in sys.argv[2:]:
    repair(name).save(f"{sys.argv[1]}/{name.rsplit('/', 1)[-1]}", figure=False)
"""


def without_times(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: without_times(v) for k, v in value.items() if not k.endswith("time_s")}
    return [without_times(v) for v in value] if isinstance(value, list) else value


def content(folder: Path) -> dict[str, str]:
    """Every file's text; of the results what is left without times."""
    found = {}
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        text = path.read_text(encoding="utf-8")
        if path.suffix == ".json":
            text = json.dumps(without_times(json.loads(text)), indent=1)
        found[str(path.relative_to(folder))] = text
    return found


@pytest.fixture(scope="module")
def files(scenarios: Path) -> list[Path]:
    missing = [name for name in FILES if not (scenarios / name).is_file()]
    if missing:
        pytest.skip(f"not in {scenarios}: {', '.join(missing)}")
    return [scenarios / name for name in FILES]


@pytest.fixture(scope="module")
def once(files: list[Path], tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("once")
    for path in files:
        repair(path).save(folder / path.name, figure=False)
    found = content(folder)
    assert sum(name.endswith("result.json") for name in found) == len(FILES)
    return found


@pytest.mark.exhaustive
def test_twice_in_one_process(files: list[Path], once: dict[str, str], tmp_path: Path) -> None:
    for path in reversed(files):  # in another order: nothing may be left over from the file before
        repair(path).save(tmp_path / path.name, figure=False)
    assert content(tmp_path) == once


def test_in_another_process(files: list[Path], once: dict[str, str], tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-c", PROGRAM, str(tmp_path), *map(str, files)], check=True, timeout=120,
                   capture_output=True)  # fmt: skip
    assert content(tmp_path) == once


@pytest.mark.exhaustive
def test_any_number_of_workers(files: list[Path], tmp_path: Path) -> None:
    for path in files:
        shutil.copy(path, tmp_path)
    rows = [
        sweep(
            tmp_path,
            SweepSettings(official=False, jobs=jobs, references=("planner", "constant")),
            progress=False,
        )
        for jobs in (1, 2)
    ]
    assert len(rows[0]) == 2 * len(FILES)
    assert without_times(rows[0]) == without_times(rows[1])
    assert {row["status"] for row in rows[0]} <= {
        "found",
        "no_conflict",
        "none_feasible",
        "already_colliding",
    }
