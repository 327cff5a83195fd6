"""Says at the end how many code blocks of the pages were run."""

from __future__ import annotations

import pytest

RUN: set[str] = set()


@pytest.fixture
def count():
    """Return what is called with each block that was run."""
    return lambda block: RUN.add(str(block))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """One line, where any was run."""
    if RUN:
        from tests.docs.pages import PAGES, blocks

        every = [block for page in PAGES for block in blocks(page)]
        of = {how: sum(block.how == how for block in every) for how in ("run", "slow", "not run")}
        terminalreporter.write_line(
            f"code blocks of the pages: {len(RUN)} run, of {of['run']} and {of['slow']} slow ones; "
            f"{of['not run']} are marked as not run"
        )
