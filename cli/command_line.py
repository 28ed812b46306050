"""How robotctl reads a command line: typer's way, without its cost where nothing needs converting.

typer converts the values of options with pydantic, those of options that were not given, too.
Importing that takes longer than all the rest of `robotctl COMMAND --help`, and most values are
words that stay as they are, the names of files and folders, or numbers. What is no number, or none
of the words that are meant, is told in words of ours, and not in pydantic's.
"""

from __future__ import annotations

import math
import os
from enum import Enum
from pathlib import Path
from typing import Any

import typer.core

_UNITS = {"SECONDS": "seconds", "DAYS": "days", "MB": "MB"}
"""What a number counts, by how help names it."""
_NUMBERS = (int, float, int | None, float | None)
_WRONG_LINE: Any = typer.BadParameter.__base__
"""What typer raises where a command line is wrong; it has no public name for it."""
_ALIKE = (("cancel", "delete", "remove"), ("list", "show"), ("add", "create", "new"))
"""What commands of different groups are called that do the same."""
_LARGEST = 2**63 - 1
"""The largest whole number that every reader of JSON takes in."""


class Group(typer.core.TyperGroup):
    """A group of commands that converts no options of its own where none are given."""

    def get_params(self, ctx: Any) -> list[Any]:
        """The group's own parameters, as a command's."""
        return _converted_lazily(super().get_params(ctx))

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Where a command comes first, no option of the group was given."""
        if args and args[0] in self.commands:
            self.params, self.add_help_option = [], False
        return super().parse_args(ctx, args)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that is named; of one that does not exist, what may have been meant."""
        try:
            return super().resolve_command(ctx, args)
        except _WRONG_LINE as error:
            if error.message.startswith(missing := f"No such command {args[0]!r}"):
                if meant := self._meant_by(args[0]):
                    error.message = f"{missing}. Did you mean {', '.join(map(repr, meant))}?"
                elif error.message == f"{missing}.":  # no name is nearly the same
                    error.message = f"{missing}; there are {', '.join(self.commands)}"
            raise

    def elsewhere(self, name: str) -> list[str]:
        """Commands of other groups that are called so."""
        return []

    def _meant_by(self, name: str) -> list[str]:
        """Commands that do what one of another group does that is called so, or else that one."""
        alike = {word for words in _ALIKE if name in words for word in words}
        return [each for each in self.commands if each in alike] or self.elsewhere(name)


class Command(typer.core.TyperCommand):
    """A command that has only those values converted that are more than words and paths."""

    def get_params(self, ctx: Any) -> list[Any]:
        """The parameters, each with a converter that does nothing as long as it can."""
        params = _converted_lazily(super().get_params(ctx))
        for param in params:
            if param.metavar is None and param.type_descriptor.annotation in _NUMBERS:
                param.metavar = "SECONDS" if _unit(param) == "seconds" else "N"
        return params

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """What is left over where a sentence is meant was to be part of it."""
        try:
            return super().parse_args(ctx, args)
        except _WRONG_LINE as error:
            sentence = any(each.metavar == "TEXT" for each in self.params)
            if sentence and "extra argument" in error.message:
                error.message += '; a sentence stands in quotes: "Bring the first cup to …"'
            elif "extra argument" in error.message and not _arguments(self.params):
                robot = any(each.name == "robot" for each in self.params)
                error.message += f"; `{ctx.command_path}` takes none"
                error.message += ", but --robot NAME" if robot else ""
            raise


class FactWords(Command):
    """A command whose `--fact` takes three words, or the same in one."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Make one word of the three: typer has no option that is both repeatable and a triple."""
        joined: list[str] = []
        rest = list(args)
        while rest:
            word = rest.pop(0)
            joined.append(word)
            if word == "--fact" and rest and " " not in rest[0] and "(" not in rest[0]:
                fact, rest = rest[:3], rest[3:]
                joined.append(" ".join(fact))
        return super().parse_args(ctx, joined)


def _converted_lazily(params: list[Any]) -> list[Any]:
    for param in params:
        if not isinstance(param.get_runtime_param, _Lazily):
            param.get_runtime_param = _Lazily(
                param.get_runtime_param, _of_words(param), _is_path(param)
            )
    return params


class _Lazily:
    """Stands for a parameter's converter, and makes the real one when a value needs it."""

    def __init__(self, make: Any, words: bool, path: bool) -> None:
        self._make, self._words, self._path = make, words, path

    def __call__(self) -> _Lazily:
        return self

    def coerce(self, value: Any, param: Any, ctx: Any) -> Any:
        """The value as the command takes it."""
        if value is None:
            return () if param.multiple or param.nargs == -1 else None
        if self._words or value is param.default:
            return value
        if self._path and isinstance(value, str) and _can_be_read(value):
            return Path(value)
        kind = param.type_descriptor.annotation
        if isinstance(value, str) and kind in (int, float):
            return _number(value, kind, param, ctx)
        if isinstance(value, str) and isinstance(kind, type) and issubclass(kind, Enum):
            return _choice(value, kind, param, ctx)
        return self._make().coerce(value, param=param, ctx=ctx)


def _arguments(params: list[Any]) -> list[Any]:
    return [param for param in params if param.param_type_name == "argument"]


def _of_words(param: Any) -> bool:
    return param.type_descriptor.annotation in (str, list[str])


def _is_path(param: Any) -> bool:
    """Whether it takes any path that can be read, or that is not there: as they do by default."""
    asks = param.type_descriptor.parameter_info
    special = asks.exists or asks.writable or asks.resolve_path or asks.allow_dash or asks.parser
    return param.type_descriptor.annotation is Path and not special and _is_of_any_kind(asks)


def _is_of_any_kind(asks: Any) -> bool:
    return bool(asks.file_okay and asks.dir_okay and asks.readable and asks.path_type is None)


def _can_be_read(path: str) -> bool:
    return not os.path.exists(path) or os.access(path, os.R_OK)  # noqa: PTH110


def _number(written: str, kind: type[int] | type[float], param: Any, ctx: Any) -> int | float:
    """What is written as a number.

    Raises:
        BadParameter: it is none, or not within what the parameter takes.
    """
    asks = param.type_descriptor.parameter_info
    low = -_LARGEST if asks.min is None else asks.min
    high = _LARGEST if asks.max is None else asks.max
    try:
        number = kind(written)
    except ValueError:
        number = math.nan
    if low <= number <= high:
        return number
    if _LARGEST < abs(number) < math.inf:
        said = f"{written!r} is too large"
    else:
        said = f"{written!r} is not {_wanted(kind, param)}"
    raise typer.BadParameter(said, ctx=ctx, param=param)


def _wanted(kind: type[int] | type[float], param: Any) -> str:
    """Which numbers the parameter takes."""
    asks = param.type_descriptor.parameter_info
    wanted = "a whole number" if kind is int else "a number"
    if unit := _unit(param):
        wanted += f" of {unit}"
    if asks.min is None:
        return f"{wanted} such as 5"
    if asks.max is None:
        return f"{wanted}, {asks.min:g} or more"
    return f"{wanted} from {asks.min:g} to {asks.max:g}"


def _unit(param: Any) -> str | None:
    """What the parameter's number counts, where help or its name says that."""
    in_name = any(name.endswith("-s") and name.startswith("--") for name in param.opts)
    return "seconds" if in_name else _UNITS.get(param.metavar or "")


def _choice(written: str, kind: type[Enum], param: Any, ctx: Any) -> Enum:
    """The one of a few that is written.

    Raises:
        BadParameter: it is none of them.
    """
    for each in kind:
        if each.value == written:
            return each
    listed = ", ".join(str(each.value) for each in kind)
    raise typer.BadParameter(f"{written!r} is none of {listed}", ctx=ctx, param=param)
