"""What the pages say is typed, line by line, and shows what they say: for an operator's day, and
for the README's fleet that stays."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.demo_process import left_behind
from tests.support.transcripts import Bash, Typed, differs, not_typed, typed

pytestmark = [pytest.mark.e2e, pytest.mark.slow]

ROOT = Path(__file__).parents[2]


@pytest.fixture
def bash(tmp_path: Path) -> Iterator[Bash]:
    """In an empty folder, and with no fleet left behind."""
    shell = Bash(tmp_path)
    try:
        yield shell
        assert left_behind(tmp_path) == []
    finally:
        shell.run("robotctl down")
        shell.close()


def type_all(commands: list[Typed], bash: Bash) -> None:
    """Type each, and hold what it prints and how it ends against the page."""
    for each in commands:
        code, printed = bash.run(each.command, until_ctrl_c=each.until_ctrl_c)
        where = f"line {each.line}: $ {each.command}\n{printed}"
        assert code == each.code, where
        missing = differs(each.shown, printed) if each.shown else None
        assert missing is None, f"{where}\nthe page shows: {missing}"


def test_an_operators_day(bash: Bash) -> None:
    """Every command of the page, and there is none that is not typed."""
    page = (ROOT / "docs" / "operations.md").read_text(encoding="utf-8")
    commands = typed(page)
    assert not_typed(page) == []
    assert len(commands) == len(re.findall(r"^\$ ", page, re.MULTILINE)) > 50
    type_all(commands, bash)


def test_the_fleet_that_stays_of_the_readme(bash: Bash, tmp_path: Path) -> None:
    (tmp_path / ".venv").symlink_to(sys.prefix)
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    section = page.split("## A fleet that stays\n")[1].split("\n## ")[0]
    type_all(typed(section), bash)
