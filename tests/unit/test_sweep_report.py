"""The report of a sweep counts what the rows say."""

from __future__ import annotations

from repair.report.sweep import sweep_report
from repair.study.rows import COLUMNS


def row(file, backend, status, **values):
    made = dict.fromkeys(COLUMNS)
    made.update(file=file, backend=backend, reference="constant", status=status, detail="", conflict="margin")
    made.update(ttc_s=2.0, ttb_s=1.0, ttr_s=1.0, probes="0:+", search_time_s=0.01)
    return made | values


def judged(ok=True):
    return {"official_feasible": True, "official_collision_free": ok, "official_on_road": True}


ROWS = [
    row("a.xml", "ego", "found", f_ttr_s=0.8, maneuver="yield", peak_deceleration_mps2=-4.0, **judged()),
    row(
        "a.xml", "casadi", "found", f_ttr_s=1.2, maneuver="left", peak_deceleration_mps2=-4.0, **judged(False)
    ),
    row("b.xml", "ego", "none_feasible", detail="yield: collision"),
    row("b.xml", "casadi", "found", f_ttr_s=0.0, ttb_s="-inf", ttr_s="-inf", maneuver="right", **judged()),
    row("c.xml", "ego", "crash", detail="a | b", ttb_s=None),
]


def section(text, title):
    return text.split(f"## {title}\n")[1].split("\n## ")[0]


def test_counts_rejections_and_reasons():
    text = sweep_report(ROWS, "repair sweep dev")
    official = section(text, "What CommonRoad's own checker says")
    assert "3 trajectories" in official
    assert "1 were rejected" in official
    assert "| a.xml | casadi |" in official
    assert "not below in 2 of 2 cases" in section(text, "Backends compared")
    assert "| a.xml | constant | casadi | 1.2 | 1 | left |" in section(text, "F-TTR above the TTR")
    assert "| b.xml | constant | casadi |" in section(text, "Repaired although braking does not help")
    reasons = section(text, "Not repaired, and why")
    assert "| b.xml | constant | ego | none_feasible |" in reasons
    assert "a / b" in reasons  # a pipe would break the table
    assert "| constant | ego | 3 | 0 | 1 | 0 | 1 | 0 | 1 | 1 of 2 |" in section(text, "How many")
    assert "### Reference: constant" in section(text, "Every file")


def test_certificates_are_counted_where_they_were_made():
    rows = [ROWS[0] | {"certificate": "ok"}, ROWS[1] | {"certificate": "friction circle"}]
    official = section(sweep_report(rows, "x"), "What CommonRoad's own checker says")
    assert "2 certificates" in official
    assert "1 have a violated margin" in official
    assert "| a.xml | casadi | constant | friction circle |" in official
