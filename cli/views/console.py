"""The page robotctl prints on."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

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


class _Table(Table):
    """A table that breaks no words: where they have no room side by side, each row is a record."""

    def __init__(self, columns: Sequence[str], rows: list[list[str]], title: str) -> None:
        super().__init__(
            title=title or None, title_justify="left", box=None, pad_edge=False, header_style="bold"
        )
        self._names, self._cells = list(columns), rows
        for column in columns:
            self.add_column(column, overflow="fold")
        for row in rows:
            self.add_row(*row)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        columns = [*zip(self._names, *self._cells, strict=True)]
        room = options.max_width - GAP * (len(columns) - 1)
        least = [max(map(_longest_word, column)) for column in columns]
        # What is broken in the last column is still read in one go.
        least[-1] = min(least[-1], NARROWEST)
        if self._cells and sum(least) > room:
            yield from self._records()
            return
        most = [max(map(_width, column)) for column in columns]
        if sum(most) > room:
            for column, width in zip(self.columns, _shared(least, most, room), strict=True):
                column.width = width
        yield from super().__rich_console__(console, options)

    def _records(self) -> RenderResult:
        if self.title:
            yield Text(str(self.title), style="italic")
        for first, *others in self._cells:
            yield Text(first, style="bold")
            fields = Table.grid(padding=(0, GAP, 0, 0))
            fields.add_column(no_wrap=True)
            fields.add_column(overflow="fold")
            for name, cell in zip(self._names[1:], others, strict=True):
                if cell:
                    fields.add_row(f"  {name}", cell)
            yield fields


GAP = 2
"""Columns between two of a table."""
NARROWEST = 20
LONGEST_WORD = 63
"""An id; what is longer is broken, and makes no records of a table."""


def _width(cell: str) -> int:
    return max(map(cell_len, cell.split("\n")))


def _longest_word(cell: str) -> int:
    return min(LONGEST_WORD, max(map(cell_len, cell.split()), default=0))


def _shared(least: list[int], most: list[int], room: int) -> list[int]:
    """Widths between what each column needs and what it would like, `room` in all."""
    widths, left = list(least), room - sum(least)
    order = sorted(range(len(least)), key=lambda n: most[n] - least[n])
    for rank, number in enumerate(order):
        more = min(max(0, most[number] - least[number]), left // (len(order) - rank))
        widths[number] += more
        left -= more
    return widths


def table(columns: Sequence[str], rows: Iterable[Sequence[object]], title: str = "") -> Table:
    """A plain table; `None` shows as nothing."""
    cells = [["" if cell is None else str(cell) for cell in row] for row in rows]
    return _Table(columns, cells, title)
