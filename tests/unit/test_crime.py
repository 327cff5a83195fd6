"""The table of ``python -m benchmarks.crime``; CriMe itself lives in another environment."""

from benchmarks.crime.__main__ import REQUIREMENTS, table


def test_a_row_has_ours_beside_theirs():
    record = {"contact_ttc_s": 2.5, "metrics": {"ttr": {"value_s": None}}, "f_ttr_s": 1.25}
    rows = [{"file": "folder/NAME.xml", "record": record}]
    theirs = [{"ttc": "2.6", "ttr": "-inf", "f_ttr": "1.25"}]
    assert table(rows, theirs).splitlines()[-1] == "| NAME | 2.50 | 2.60 | – | -∞ | 1.25 | 1.25 |"
    theirs[0]["ttr"] = "TypeError: what CriMe stopped with"
    assert "| TypeError: what CriMe stopped with |" in table(rows, theirs)


def test_every_version_is_pinned():
    lines = REQUIREMENTS.read_text(encoding="utf-8").splitlines()
    named = [line for line in lines if line and not line.startswith("#")]
    assert all("==" in line for line in named)
    assert any(line.startswith("commonroad-crime==") for line in named)
