"""Chains of reasons as indented sentences."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from rich.console import Group
from rich.padding import Padding
from rich.text import Text

from cli.views.text import STATE_STYLE

if TYPE_CHECKING:
    from cli.why.links import Explained

INDENT = 2


def why_page(found: Iterable[Explained]) -> Group:
    """One sentence a line, what lies behind it further in."""
    return Group(*(line for each in found for line in _lines(each, 0)))


def _lines(told: Explained, depth: int) -> Iterator[Padding]:
    text = Text(f"{'because ' if depth else ''}{told.sentence}")
    if told.state is not None:
        text.stylize(STATE_STYLE.get(told.state, ""))
    if told.hint is not None:
        text.append(f" (`{told.hint}`)", "cyan")
    yield Padding(text, (0, 0, 0, depth * INDENT), expand=False)
    for each in told.because:
        yield from _lines(each, depth + 1)
