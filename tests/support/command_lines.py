"""Whether robotctl would take a command line, without running it."""

from __future__ import annotations

import importlib

import typer.core
import typer.main

from cli.main import COMMANDS


def leaf(words: list[str]) -> tuple[typer.core.TyperCommand, list[str]]:
    """The command that these words begin with, and the words after it."""
    module, _, attribute = COMMANDS[words[0]][0].partition(":")
    command = typer.main.get_command(getattr(importlib.import_module(module), attribute))
    rest = words[1:]
    while isinstance(command, typer.core.TyperGroup) and (
        (rest[:1] and rest[0] in command.commands) or not command.invoke_without_command
    ):
        command, rest = command.commands[rest[0]], rest[1:]  # type: ignore[assignment]
    return command, rest  # type: ignore[return-value]


def parse(arguments: list[str]) -> None:
    """Parse a command line as robotctl would, and do not run it.

    Raises:
        UsageError: robotctl would not take it.
    """
    command, rest = leaf(arguments)
    command.make_context("robotctl", rest)
