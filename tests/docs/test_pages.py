"""What the pages show runs, and prints what they say."""

from __future__ import annotations

import warnings
from pathlib import Path

import pytest
from tests.docs.pages import PAGES, blocks, masked, says, shell_lines
from tests.registries import nothing_left

from repair.cli import main
from repair.cli.command import parser
from repair.config import load_config
from repair.paper.bundled import find_scenario

SHOWN = [page for page in PAGES if blocks(page)]
SLOW = [page for page in SHOWN if any(block.how == "slow" for block in blocks(page))]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return a folder with what the pages name as files: the bundled scenario."""
    monkeypatch.chdir(tmp_path)
    with find_scenario("scenario_1") as bundled:
        for name in ("SCENARIO.xml", "scenarios/DEU_Flensburg-6_1_T-1.xml"):
            file = tmp_path / name
            file.parent.mkdir(exist_ok=True)
            file.write_bytes(Path(bundled).read_bytes())
    return tmp_path


def follow(page, slow, count, capsys):
    """Run the blocks of a page in its order."""
    names: dict[str, object] = {}
    for block in blocks(page):
        if block.how == "not run" or (block.how == "slow" and not slow):
            continue
        if block.language == "python":
            exec(compile("\n" * block.line + block.text, str(page), "exec"), names)
        else:
            for command, said in block.commands():
                assert command[0] == "repair", f"{block}: only `repair` is run; mark it as not run"
                capsys.readouterr()
                assert main(command[1:]) == 0, f"{block}: {command}"
                printed = iter([masked(line) for line in capsys.readouterr().out.splitlines()])
                for line in said:
                    assert any(says(other, line) for other in printed), (
                        f"{block}: {' '.join(command)} does not print, in this order: {line}"
                    )
        count(block)


@pytest.mark.parametrize("page", SHOWN, ids=lambda page: page.stem)
def test_the_code_of_a_page_runs(page, folder, monkeypatch, count, capsys):
    monkeypatch.delenv("COMMONROAD_SCENARIOS", raising=False)
    with nothing_left(), warnings.catch_warnings():
        follow(page, False, count, capsys)


@pytest.mark.exhaustive
@pytest.mark.parametrize("page", SLOW, ids=lambda page: page.stem)
def test_the_slow_code_of_a_page_runs(page, folder, scenarios, count, capsys):
    with nothing_left(), warnings.catch_warnings():
        follow(page, True, count, capsys)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_commands_of_a_page_exist(page):
    """Verbs, options and keys of what is not run: misspelt ones are an error."""
    for line, arguments in shell_lines(page):
        found = parser().parse_args(arguments)
        keys = [key for key in getattr(found, "overrides", []) if "KEY=VALUE" not in key]
        assert load_config(overrides=keys), line


def test_a_page_that_lies_is_noticed(tmp_path, folder, count, capsys):
    page = tmp_path / "page.md"
    for text, error in (
        ("```python\nassert 1 == 2\n```\n", AssertionError),
        ("```console\n$ repair backends\nno such line\n```\n", AssertionError),
        ("```console\n$ rm\n```\n", AssertionError),
    ):
        page.write_text(text, encoding="utf-8")
        with pytest.raises(error):
            follow(page, False, count, capsys)
    page.write_text("<!-- not run: why -->\n```python\nassert False\n```\n", encoding="utf-8")
    follow(page, False, count, capsys)
