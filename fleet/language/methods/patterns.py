"""Phrases of tasks: `set|lay the table [for {n: number} [people]]` as rows of words and slots."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import NamedTuple

from fleet.language.methods.model import SLOT
from fleet.language.words.wordbook import phrase_of

ARTICLES = frozenset({"the", "a", "an", "some"})
"""Words that may be said or left out between others of a phrase."""
MOST = 64
"""Rows that one phrase may stand for."""
_PART = re.compile(r"\s*([][()|]|\{[^{}]*\}|[^][(){}|\s]+)")
_CLOSES = {"[": "]", "(": ")"}


class Slot(NamedTuple):
    """Where a parameter stands; `type` as a file writes it."""

    name: str
    type: str


Row = tuple[str | Slot, ...]


class BadPhrase(Exception):
    """A phrase cannot be read; the message goes on behind it."""


def rows_of(phrase: str) -> tuple[Row, ...]:
    """All that a phrase stands for: `[…]` may be left out, `a|b` is one of them.

    Inside of brackets, `(…)` or `[…]`, `|` stands between rows of words, else between words.

    Raises:
        BadPhrase: brackets do not match, it begins with no word, or it stands for too much.
    """
    parts = _PART.findall(phrase)
    found, rest = _sequence(parts, 0, inside=False)
    if rest < len(parts):
        raise BadPhrase(f"has a {parts[rest]!r} that closes nothing")
    rows = tuple(dict.fromkeys(tuple(p for p in row if p not in ARTICLES) for row in found))
    if any(not row or isinstance(row[0], Slot) for row in rows):
        raise BadPhrase("must begin with a word, such as a verb")
    neighbours = (pair for row in rows for pair in pairwise(row))
    if any(isinstance(one, Slot) and isinstance(other, Slot) for one, other in neighbours):
        raise BadPhrase("has two parameters with no word between them")
    return rows


def slots_of(phrase: str) -> dict[str, str]:
    """The parameters of a phrase and their types."""
    return {name: (of or "").strip() for name, of in SLOT.findall(phrase)}


def _sequence(parts: list[str], at: int, *, inside: bool) -> tuple[list[Row], int]:
    """The rows of a sequence, and where it ends: at what closes it, or at the end."""
    ended: list[Row] = []
    rows: list[Row] = [()]
    while at < len(parts) and parts[at] not in "])":
        part = parts[at]
        if part == "|" and inside:
            ended, rows, at = [*ended, *rows], [()], at + 1
            continue
        if part == "|":
            raise BadPhrase("has a '|' with nothing on one side")
        if part in _CLOSES:
            choices, at = _sequence(parts, at + 1, inside=True)
            if parts[at : at + 1] != [_CLOSES[part]]:
                raise BadPhrase(f"has a {part!r} that is never closed")
            choices, at = [*([()] if part == "[" else []), *choices], at + 1
        else:
            choices, at = [_atom(part)], at + 1
            while not inside and parts[at : at + 1] == ["|"]:
                if at + 1 >= len(parts) or parts[at + 1] in "[]()|":
                    raise BadPhrase("has a '|' with nothing on one side")
                choices.append(_atom(parts[at + 1]))
                at += 2
        rows = [(*row, *choice) for row in rows for choice in choices]
        if len(rows) + len(ended) > MOST:
            raise BadPhrase(f"stands for more than {MOST} phrases: write several")
    return [*ended, *rows], at


def _atom(part: str) -> Row:
    if (slot := SLOT.fullmatch(part)) is not None:
        return (Slot(slot[1], (slot[2] or "").strip()),)
    if part.startswith("{"):
        raise BadPhrase(f"names no parameter with {part!r}: write it like {{n: number}}")
    return phrase_of(part)
