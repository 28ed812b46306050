"""The page robotctl prints on."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from typing import TextIO

PIPED_WIDTH = 200
"""Columns where nobody's terminal sets a limit: wide enough for `grep` to find whole lines."""


def console(file: TextIO | None = None) -> Console:
    """A console on `file` (stdout at the time of the call); piped output is wide.

    Text is never markup: a person's sentence may have brackets in it.
    """
    target = file or sys.stdout
    return Console(
        file=target,
        width=None if target.isatty() else PIPED_WIDTH,
        highlight=False,
        markup=False,
        emoji=False,
        soft_wrap=False,
    )


def table(columns: Sequence[str], rows: Iterable[Sequence[object]], title: str = "") -> Table:
    """A plain table; `None` shows as nothing."""
    drawn = Table(
        title=title or None, title_justify="left", box=None, pad_edge=False, header_style="bold"
    )
    for column in columns:
        drawn.add_column(column, overflow="fold")
    for row in rows:
        drawn.add_row(*("" if cell is None else str(cell) for cell in row))
    return drawn
