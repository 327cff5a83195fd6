"""The tutorial notebook runs from its first cell to its last."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

from tests.registries import nothing_left

NOTEBOOK = Path(__file__).parents[2] / "docs" / "tutorial.ipynb"


def test_the_notebook_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("COMMONROAD_SCENARIOS", raising=False)
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    names: dict[str, object] = {}
    code = [(k, "".join(cell["source"])) for k, cell in enumerate(cells) if cell["cell_type"] == "code"]
    assert code
    with nothing_left(), warnings.catch_warnings():
        for k, source in code:
            exec(compile(source, f"{NOTEBOOK.name}, cell {k}", "exec"), names)
    assert "feasible" in capsys.readouterr().out
    stored = [cell for cell in cells if cell.get("outputs") or cell.get("execution_count")]
    assert not stored, "a notebook is kept without outputs"
