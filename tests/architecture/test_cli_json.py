"""Every command takes `--json`, and does something about it."""

from __future__ import annotations

import ast
import importlib
import inspect
import textwrap
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import typer.core
import typer.main

from cli.main import COMMANDS

WITHOUT = {
    "router": "runs until a signal; what it says are lines of a log",
    "planner": "the same",
    "worker": "the same",
    "sim": "the same",
    "record": "the same; what it makes is a file",
}
"""Commands that take the option, as all do, and have no data to print."""


def leaves() -> Iterator[tuple[str, Any]]:
    """Each command by all of its words; also a group's own, where that does something."""
    for name, (where, _) in COMMANDS.items():
        module, _, attribute = where.partition(":")
        command = typer.main.get_command(getattr(importlib.import_module(module), attribute))
        for inner, leaf in getattr(command, "commands", {}).items():
            yield f"{name} {inner}", leaf
        if getattr(command, "invoke_without_command", True):
            yield name, command


def minds_json(body: Callable[..., Any], seen: set[Any]) -> bool:
    """Whether it shows data by its `Call`, asks that for `json`, or hands it to what does."""
    if body in seen:
        return False
    seen.add(body)
    tree = ast.parse(textwrap.dedent(inspect.getsource(body)))
    names = inspect.getmodule(body).__dict__
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and ast.unparse(node) in ("call.show", "call.json"):
            return True
        if isinstance(node, ast.Call) and any(ast.unparse(arg) == "call" for arg in node.args):
            called = names.get(ast.unparse(node.func))
            if inspect.isfunction(called) and minds_json(inspect.unwrap(called), seen):
                return True
    return False


LEAVES = dict(leaves())


@pytest.mark.parametrize("name", LEAVES)
def test_a_command_takes_json_and_minds_it(name: str) -> None:
    leaf = LEAVES[name]
    flags = {flag for parameter in leaf.params for flag in parameter.opts}
    assert "--json" in flags
    assert minds_json(inspect.unwrap(leaf.callback), set()) is (name not in WITHOUT)


def test_the_list_of_those_without_names_commands() -> None:
    assert set(WITHOUT) <= set(LEAVES)
