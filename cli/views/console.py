"""The page robotctl prints on."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table

from cli.terminal import unguarded
from keyexpr_schema.control_characters import visible

if TYPE_CHECKING:
    from typing import TextIO

PIPED_WIDTH = 200
"""Columns where nobody's terminal sets a limit: wide enough for `grep` to find whole lines."""


class _Console(Console):
    """A console on which no text that is printed moves the cursor; rich's own codes do."""

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterator[Segment]:
        """As rich renders it, control characters in texts as escapes."""
        for segment in super().render(renderable, options):
            if segment.control:
                yield segment
            else:
                yield Segment(visible(segment.text, lines=True), segment.style)


def console(file: TextIO | None = None) -> Console:
    """A console on `file` (stdout at the time of the call); piped output is wide.

    Text is never markup: a person's sentence may have brackets in it.
    """
    target = file or sys.stdout
    return _Console(
        file=unguarded(target),
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
