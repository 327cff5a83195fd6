"""Tables I and II: what they hold, how they are written, and that they say where numbers come from."""

from __future__ import annotations

import json
import re

import pytest

from repair.errors import ConfigError
from repair.paper.table1 import METHODS, table1
from repair.paper.table2 import machine, table2
from repair.report.tables import DASH, Section, Table, against, decimal

QUICK = tuple(m for m in METHODS if m.backend != "casadi")


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    return table1(tmp_path_factory.mktemp("empty"), methods=QUICK, scenarios=(1,))


@pytest.fixture(autouse=True, scope="module")
def _no_official_file():
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("COMMONROAD_SCENARIOS", raising=False)
        yield


def test_numbers_and_differences():
    assert against(1.6, 1.6) == {"paper": 1.6, "ours": 1.6, "difference": 0.0}
    assert against(1.6, None) == {"paper": 1.6, "ours": None, "difference": None}
    assert against(1.6, float("-inf"))["ours"] is None
    assert (decimal(-1.86, 2), decimal(0.2, 1, True), decimal(-0.001, 1), decimal(None, 1)) == (
        "−1.86",
        "+0.2",
        "0.0",
        DASH,
    )


def test_scenario_1_is_reconstructed_and_says_so(first):
    (section,) = first.sections
    assert "reconstruction" in section.heading
    assert "TTC 2.9 s in the paper" in section.heading
    assert any("not the paper's own file" in note for note in first.notes)


def test_rows_of_table_1(first):
    rows = {r["key"]: r for r in first.data["scenarios"][0]["rows"]}
    assert rows["qptr_at_ttr"]["ttr_s"]["paper"] == 2.6
    assert rows["qptr_at_ttr"]["ttr_s"]["difference"] == pytest.approx(0.0, abs=0.11)
    assert rows["qptr_at_ttr"]["paper_status"] == "not solvable"
    assert rows["qptr_at_ttr"]["status_text"] in ("no corridor", "no solution")
    assert rows["qptr_at_ttr"]["peak_mps2"]["ours"] is None
    assert rows["ego"]["peak_mps2"]["paper"] == -1.86
    assert rows["qptr"]["ttr_s"]["paper"] is None
    assert 1.6 <= rows["qptr"]["ttr_s"]["ours"] <= 2.4  # the QP repairs: it is the TTR that fails
    assert first.sections[0].rule_after == 2


def test_json_is_strict_and_complete(first):
    content = json.loads(first.to_json(), parse_constant=lambda c: pytest.fail(f"{c} in JSON"))
    (scenario,) = content["scenarios"]
    assert scenario["provenance"]["kind"] == "reconstruction"
    assert len(scenario["provenance"]["sha256"]) == 64
    assert [r["key"] for r in scenario["rows"]] == [m.key for m in QUICK]


def test_markdown_is_a_table(first):
    lines = [line for line in first.to_markdown().splitlines() if line.startswith("|")]
    assert len({len(re.findall(r"(?<!\\)\|", line)) for line in lines}) == 1
    assert "*not in the paper*" in first.to_markdown()


def test_latex_is_balanced_and_escaped():
    section = Section(
        "50% & more", ("", "a_b [m/s²]", "status"), (("x", "1 ± 2", "−1.0"), ("y", DASH, "{z}")), 1
    )
    text = Table("T_1", (section,), ("note #1",)).to_latex()
    assert text.count("\\begin{") == text.count("\\end{") == 2
    for wanted in (
        "50\\% \\& more",
        "a\\_b [m/s$^2$]",
        "1 $\\pm$ 2",
        "$-$1.0",
        "\\{z\\}",
        "note \\#1",
        "\\toprule",
    ):
        assert wanted in text
    assert text.count("\\midrule") == 2


def test_unknown_solver_becomes_a_row(tmp_path):
    table = table1(tmp_path, methods=QUICK[-1:], scenarios=(1,), overrides=["qptr.solver=nosuch"])
    (row,) = table.data["scenarios"][0]["rows"]
    assert row["status"] == "unavailable"
    assert "nosuch" in row["status_text"]


def test_missing_folder_is_an_error(tmp_path):
    with pytest.raises(ConfigError, match="does not exist"):
        table1(tmp_path / "nowhere")


def test_table_2_times_its_phases(tmp_path):
    table = table2(
        tmp_path, runs=3, backends=("ego",), scenarios=(1,), literal=lambda _: (2.0, 4), literal_runs=2
    )
    (row,) = table.data["scenarios"][0]["rows"]
    parts = sum(row[k]["mean"] for k in ("build_s", "solve_s", "check_s", "rest_s"))
    assert parts == pytest.approx(row["search_s"]["mean"])
    assert row["iteration_s"]["mean"] == pytest.approx(row["search_s"]["mean"] / row["iterations"])
    assert row["literal_ratio"] == pytest.approx(0.5 / row["iteration_s"]["mean"], abs=1e-3)
    assert table.data["machine"]["python"] == machine()["python"]
    assert "do not compare across machines" in table.to_markdown()
    json.loads(table.to_json())


def test_table_2_without_the_literal_search_says_so(tmp_path):
    table = table2(tmp_path, runs=1, backends=("ego",), scenarios=(1,))
    assert "not measured" in table.to_markdown()
    with pytest.raises(ConfigError, match="at least one run"):
        table2(tmp_path, runs=0)


def test_progress_is_silent_where_nobody_looks(tmp_path, capsys):
    table2(tmp_path, runs=1, backends=("ego",), scenarios=(1,))
    captured = capsys.readouterr()
    assert captured.out == captured.err == ""


def test_official_file_is_named_with_its_checksum(scenarios):
    table = table1(scenarios, methods=QUICK[1:2], scenarios=(1,))
    assert "official file DEU_Flensburg-6_1_T-1.xml, sha256 a9891d6e4080" in table.sections[0].heading
    (row,) = table.data["scenarios"][0]["rows"]
    assert row["ttr_s"]["ours"] == 1.6
