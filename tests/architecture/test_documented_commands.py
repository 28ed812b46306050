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
from tests.support.command_lines import leaf, parse

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


@pytest.mark.parametrize(("page", "line"), list(documented()))
def test_a_documented_line_is_taken(page: str, line: str) -> None:
    parse(shlex.split(line, comments=True))


def test_lines_were_found() -> None:
    pages = {page for page, _ in documented()}
    assert {"README.md", "docs/cli.md", "docs/timeline.md", "docs/workers.md"} <= pages


def synopses() -> Iterator[tuple[str, str]]:
    """Command and synopsis of each entry of the table of commands: ``goal list` · `show GOAL`."""
    text = (ROOT / "docs" / "cli.md").read_text(encoding="utf-8")
    for row in re.findall(r"^\| (`.*?) \| ", text.replace("\\|", "/"), re.MULTILINE):
        group = ""
        for synopsis in re.findall(r"`(.*?)`", row):
            words = synopsis.split()
            if words[0] in COMMANDS:
                group = words[0]
            else:
                words = [group, *words]
            lower = [word for word in words[:2] if re.fullmatch(r"[a-z]+(-[a-z]+)*", word)]
            yield " ".join(lower), synopsis


SYNOPSES = list(synopses())


@pytest.mark.parametrize(("command", "synopsis"), SYNOPSES)
def test_a_command_of_the_table_is_there_with_its_options(command: str, synopsis: str) -> None:
    found, _ = leaf(command.split())
    flags = {
        flag
        for parameter in found.params
        for flag in (*parameter.opts, *parameter.secondary_opts)  # --store, --no-store
    }
    assert set(re.findall(r"--[a-z-]+", synopsis)) <= flags


def test_the_table_has_every_command() -> None:
    leaves = set()
    for name, (where, _) in COMMANDS.items():
        module, _, attribute = where.partition(":")
        command = typer.main.get_command(getattr(importlib.import_module(module), attribute))
        leaves |= {f"{name} {inner}" for inner in getattr(command, "commands", ())}
        if getattr(command, "invoke_without_command", True):
            leaves.add(name)
    assert {command for command, _ in SYNOPSES} == leaves
