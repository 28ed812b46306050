"""A page of sections that is no longer than a screen: what does not fit is counted."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rich.cells import cell_len
from rich.console import Console
from rich.text import Text

GAP = 2
"""Blanks between columns."""
NARROWEST = 8
"""No column is cut to less, where there is not room for all [characters]."""


@dataclass(frozen=True)
class Section:
    """A title and items, each of some lines; `least` lines are shown of it before any other gets
    more. What is left out is counted, with `more` as where to see it."""

    title: str
    items: Sequence[Sequence[Text]]
    least: int = 3
    more: str = ""
    style: str = "bold"

    @property
    def lines(self) -> int:
        """How many lines all items have."""
        return sum(map(len, self.items))


def aligned(rows: Sequence[Sequence[Text | str]], width: int) -> list[list[Text]]:
    """Rows as lines of their own: cells one below the other, and none longer than `width`."""
    cells = [[each if isinstance(each, Text) else Text(each) for each in row] for row in rows]
    wide = _widths(cells, width)
    lines = []
    for row in cells:
        line = Text(no_wrap=True, overflow="ellipsis")
        for at, cell in enumerate(row):
            shown = cell.copy()
            last = at == len(row) - 1
            shown.truncate(wide[at], overflow="ellipsis", pad=not last)
            line.append_text(shown).append("" if last else " " * GAP)
        line.rstrip()
        line.truncate(width, overflow="ellipsis")
        lines.append([line])
    return lines


def _widths(cells: Sequence[Sequence[Text]], width: int) -> list[int]:
    """How wide columns are: the widest ones give way until all fit."""
    columns = max((len(row) for row in cells), default=0)
    wide = [max(cell_len(row[at].plain) for row in cells if at < len(row)) for at in range(columns)]
    while sum(wide) + GAP * (columns - 1) > width and max(wide) > NARROWEST:
        wide[wide.index(max(wide))] -= 1
    return wide


def wrapped(
    sentences: Iterable[tuple[Text, Text]], console: Console, width: int, most: int
) -> list[list[Text]]:
    """Sentences over as many lines as they need, `most` at most; all but the first are indented.
    What stands behind a sentence is shown whole, or not at all where it leaves little of that."""
    found = []
    for sentence, behind in sentences:
        room = most * (width - 2 * GAP) - cell_len(behind.plain)
        if room < min(cell_len(sentence.plain), width // 2):
            room, behind = most * (width - 2 * GAP), Text()
        shown = sentence.copy()
        shown.truncate(room, overflow="ellipsis")
        lines = list(shown.append_text(behind).wrap(console, max(20, width - GAP)))
        found.append([*lines[:1], *(Text(" " * GAP).append_text(line) for line in lines[1:])])
    return found


def fitted(sections: Sequence[Section], height: int | None) -> list[Text]:
    """All lines of the sections, in no more than `height` lines where there is one.

    Each section gets its title and its least; what is left goes to the first ones first.
    """
    sections = [section for section in sections if section.items]
    given = [section.lines for section in sections]
    titles = sum(bool(section.title) for section in sections)
    if height is not None and sum(given) + titles > height:
        given = _shared(sections, height - titles)
    blank = height is None
    found: list[Text] = []
    for section, lines in zip(sections, given, strict=True):
        if blank:
            found.append(Text())
        if section.title:
            found.append(Text(section.title, section.style))
        found += _cut(section, lines)
    for line in found:
        line.no_wrap, line.overflow = True, "ellipsis"
    return found if height is None else found[:height]


def _shared(sections: Sequence[Section], room: int) -> list[int]:
    """How many lines each gets: one where it has to have some, then what it has at least, then
    all; the first ones first. One line alone would only count what is left out."""
    given = [0] * len(sections)
    rounds = ([min(1, each.least) for each in sections], [each.least for each in sections],
              [each.lines for each in sections])  # fmt: skip
    for wanted in rounds:
        for at, section in enumerate(sections):
            more = min(room, max(0, min(section.lines, wanted[at]) - given[at]))
            if given[at] + more == 1 < section.lines and not section.least:
                continue
            given[at] += more
            room -= more
    return given


def _cut(section: Section, lines: int) -> list[Text]:
    if section.lines <= lines:
        return [line for item in section.items for line in item]
    found: list[Text] = []
    shown = 0
    for item in section.items:
        if len(found) + len(item) > lines - 1:
            break
        found += item
        shown += 1
    left = len(section.items) - shown
    where = f" (`{section.more}`)" if section.more else ""
    return [*found, Text(f"… and {left} more{where}", "dim")] if lines else []
