"""What a command line says of what is no number, or none of the words that are meant."""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator
from typing import Any

import pytest
import typer.core
import typer.main
from typer.testing import CliRunner

from cli.arguments import plan_and_task
from cli.main import COMMANDS, app
from tests.support.command_lines import parse


def every_command() -> Iterator[tuple[str, Any]]:
    """Each command, by the words that call it."""
    for name, (where, _) in COMMANDS.items():
        module, _, attribute = where.partition(":")
        command = typer.main.get_command(getattr(importlib.import_module(module), attribute))
        found = {name: command}
        for inner, below in getattr(command, "commands", {}).items():
            found[f"{name} {inner}"] = below
        yield from found.items()


def takes_numbers() -> Iterator[tuple[str, str]]:
    """Command and name of each option that takes a number."""
    for words, each in every_command():
        for param in each.params:
            if param.type_descriptor.annotation in (int, float):
                yield words, param.opts[0]


def said_of(line: list[str]) -> str:
    with pytest.raises(typer.BadParameter) as refused:
        parse(line)
    return refused.value.format_message()


@pytest.mark.parametrize(("words", "option"), list(takes_numbers()))
def test_what_is_no_number_is_told_in_one_sentence_that_says_what_would_be_one(
    words: str, option: str
) -> None:
    for written in ("many", "nan", "inf"):
        said = said_of([*words.split(), option, written])
        assert said.startswith(f"Invalid value for '{option}'")
        assert f": '{written}' is not a " in said
        assert "number" in said and "Input" not in said


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("goal add x --priority 1.5", "'--priority': '1.5' is not a whole number such as 5"),
        (f"goal set g --priority {10**30}", f"'--priority': '{10**30}' is too large"),
        (f"goal set g --priority -{10**400}", f"'--priority': '-{10**400}' is too large"),
        ("goal add x --within-s -3", "'--within-s': '-3' is not a number of seconds, 0 or more"),
        ("router --journal-mb 0", "'--journal-mb': '0' is not a number of MB, 0.01 or more"),
        ("history --last 0", "'--last': '0' is not a whole number, 1 or more"),
        ("certs robot a --days 9999", "'--days': '9999' is not a whole number from 1 to 3650"),
        ("sim two-cups --failing 2", "'--failing': '2' is not a number from 0 to 1"),
        ("goal add x --missed maybe", "'--missed': 'maybe' is none of once, skip, all"),
    ],
)
def test_which_numbers_and_words_are_meant(line: str, said: str) -> None:
    assert said_of(line.split()).endswith(said)


def test_numbers_are_taken() -> None:
    assert ("goal add", "--within-s") in list(takes_numbers())
    for line in (
        "goal add x --priority -2 --within-s 1e3 --missed all",
        "history --last 5",
        "schedule next -n 1000",
    ):
        parse(line.split())


@pytest.mark.parametrize("line", ["goal add Bring the cup", "ask where is it"])
def test_a_sentence_without_quotes_is_told_that_it_needs_them(line: str) -> None:
    with pytest.raises(Exception, match=r"extra argument.*; a sentence stands in quotes: \""):
        parse(line.split())


@pytest.mark.parametrize(
    ("line", "takes"), [("ps all", "takes none$"), ("status hsr", "takes none, but --robot NAME$")]
)
def test_who_names_something_where_nothing_is_taken_is_told(line: str, takes: str) -> None:
    with pytest.raises(Exception, match=rf"extra argument.*\); `robotctl` {takes}"):
        parse(line.split())


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("goal cancel g1", "No such command 'cancel'. Did you mean 'delete'?"),
        ("certs show", "No such command 'show'. Did you mean 'list'?"),
        ("approve plan-1", "No such command 'approve'. Did you mean 'plan approve'?"),
        ("list", "'list'. Did you mean 'goal list', 'schedule list', 'plan list', 'task list', "),
        ("robtos", "No such command 'robtos'. Did you mean 'robots'?"),
        ("goal fly", "No such command 'fly'; there are add, answer, list, show, retry, set, "),
        ("fly", "No such command 'fly'; there are status, health, watch, why, goal, "),
    ],
)
def test_of_a_command_that_there_is_not_what_may_be_meant_is_told(line: str, says: str) -> None:
    said = CliRunner().invoke(app, line.split())
    assert said.exit_code == 2
    assert says in said.output


def test_help_names_what_is_taken_in_words() -> None:
    for words, command in every_command():
        shown = command.get_help(typer.Context(command, info_name=words))
        assert not re.search(r"<(int|float)( range)?>|\[\[|…\]|\]…", shown), shown


def test_a_task_is_named_as_status_and_why_write_it() -> None:
    assert plan_and_task("plan-1", "t3") == plan_and_task("plan-1/t3", None) == ("plan-1", "t3")
    for nothing in ("plan-1", "plan-1/"):
        with pytest.raises(typer.BadParameter, match="say which task, such as plan-1 t1"):
            plan_and_task(nothing, None)
