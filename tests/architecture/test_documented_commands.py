"""Every robotctl line that the documentation tells a reader to type is one that robotctl takes."""

from __future__ import annotations

import importlib
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer.core
import typer.main

from cli.main import COMMANDS

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
LINE = re.compile(r"^(?:\$ | {4,})robotctl (.*)$")


def documented() -> Iterator[tuple[str, str]]:
    """Page and arguments of every line in a block of code; a synopsis (with brackets) is none."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8").replace("\\\n", " ")
        for line in text.splitlines():
            found = LINE.match(line)
            if found and not re.search(r"[\[…|]", found[1]):
                yield str(page.relative_to(ROOT)), found[1]


def parse(arguments: list[str]) -> None:
    """Parse a command line as robotctl would, and do not run it.

    Raises:
        UsageError: robotctl would not take it.
    """
    module, _, attribute = COMMANDS[arguments[0]][0].partition(":")
    command = typer.main.get_command(getattr(importlib.import_module(module), attribute))
    rest = arguments[1:]
    while isinstance(command, typer.core.TyperGroup):
        command, rest = command.commands[rest[0]], rest[1:]
    command.make_context("robotctl", rest)


@pytest.mark.parametrize(("page", "line"), list(documented()))
def test_a_documented_line_is_taken(page: str, line: str) -> None:
    parse(shlex.split(line, comments=True))


def test_lines_were_found() -> None:
    pages = {page for page, _ in documented()}
    assert {"README.md", "docs/cli.md", "docs/timeline.md", "docs/workers.md"} <= pages
