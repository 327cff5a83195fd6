"""What docs/evaluation.md says of a study is counted from its rows."""

from __future__ import annotations

from pathlib import Path

import pytest
from benchmarks import evaluation
from tests import roads

from repair.errors import RepairError
from repair.study.plan import Study, tasks_of
from repair.study.rows import COLUMNS, failed_row, strict
from repair.study.store import Store

JUDGED = dict.fromkeys(evaluation._JUDGED, True)


def row(file, backend, status, f_ttr=None, **more):
    made = dict.fromkeys(COLUMNS) | {"file": file, "backend": backend, "reference": "constant"}
    return made | {"status": status, "f_ttr_s": f_ttr, "ttb_s": 1.0} | more


ROWS = [
    row("a", "ego", "found", 1.0, certificate="ok", decided_by="prediction_end", **JUDGED),
    row("a", "casadi", "found", 1.2, certificate="contact", **JUDGED | {"official_connected": False}),
    row("b", "ego", "found", 0.5, by_fallback=True, ttb_s="-inf", **JUDGED),
    row("b", "casadi", "none_feasible", ttb_s="-inf"),
    row("c", "ego", "no_conflict", ttb_s="inf"),
    row("c", "casadi", "no_conflict", ttb_s="inf"),
]


def test_lines_by_hand():
    lines = "\n".join(evaluation.said(ROWS)).splitlines()
    assert lines[0] == "- 6 searches, 3 trajectories to follow, 0 rows that could not be run."
    assert lines[1].endswith(
        "3 trajectories judged by all that `valid_solution` asks for but the goal: 1 rejected."
    )
    assert "2 certificates recomputed from the written files, 1 with a violated margin" in lines[2]
    assert lines[3].startswith("- Of 2 conflicts, 1 of which braking")
    assert lines[4] == (
        "  with `ego` chosen 2 (100.0 %) are repaired, by itself 1 (50.0 %), and 1 (100.0 %) of those that "
        "braking avoids."
    )
    assert lines[5].startswith("  with `casadi` chosen 1 (50.0 %) are repaired, by itself 1 (50.0 %)")
    assert lines[6].startswith(
        "- In 1 searches a backend finds nothing where another's repair is verified; each by"
    )
    assert lines[6].endswith("would in 2, and the table below says why.")
    assert lines[7] == "- `casadi`'s F-TTR is not below `ego`'s in 2 of 3 cases, and above it in 1."
    assert lines[8].startswith("- 1 answers hang on the end of a prediction")


def test_the_pages_are_written_from_the_store(tmp_path, capsys):
    file = tmp_path / "ZAM_Test-1_1_T-1.xml"
    file.write_text(roads.scenario(), encoding="utf-8")
    tasks = tasks_of(Study((file,), ("ego", "casadi"), ("constant",), official=False))
    docs = tmp_path / "docs"
    docs.mkdir()
    page = Path(evaluation.__file__).parents[1] / "docs" / "evaluation.md"
    (docs / "evaluation.md").write_text(page.read_text("utf-8"), encoding="utf-8")
    with Store(tmp_path / "out") as store:
        store.plan(tasks)
        first = failed_row(file.name, "ego", "constant", "none_feasible", "")
        store.add(tasks[0], strict(first | {"probes": "0:-limits", "variation": ""}), None)
    argv = [str(tmp_path / "out"), "--docs", str(docs)]
    with pytest.raises(RepairError, match="1 rows of the study"):
        evaluation.main(argv)
    with Store(tmp_path / "out") as store:
        second = failed_row(file.name, "casadi", "constant", "found", "")
        store.add(tasks[1], strict(second | {"f_ttr_s": 0.4, "probes": "0:+", "variation": ""}), None)
    assert evaluation.main(argv) == 0
    text = (docs / "evaluation.md").read_text("utf-8")
    assert "- 2 searches, 1 trajectories to follow" in text
    assert text.count("<!-- figures of the study -->") == 1
    assert evaluation.COMMAND in (docs / "sweep.md").read_text("utf-8")
    assert evaluation.main(argv) == 0  # once more into the page that it wrote itself
    assert (docs / "evaluation.md").read_text("utf-8") == text
