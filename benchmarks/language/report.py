"""Tables and the page of how the sentences were read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from benchmarks.language.entries import KINDS, PARTS, Sentence
from benchmarks.language.reader import Answer, Read
from benchmarks.language.verdict import Verdict, as_it_should_be
from benchmarks.tables import as_markdown, machine

HEAD = ("kind", "sentences", *(verdict.value for verdict in Verdict), "as it should be")
TIME_HEAD = ("words", "sentences", "median", "worst")
TARGET_HEAD = ("to reach", "at least, or at most", "is")
LENGTHS = (5, 10, 15, 20, 30)
"""Upper ends of the classes of length [words]."""
Row = tuple[str, ...]


@dataclass(frozen=True)
class Result:
    """What came of a sentence, and the time of the processor that it took."""

    sentence: Sentence
    answer: Answer
    verdict: Verdict
    took_s: float

    @property
    def good(self) -> bool:
        """Whether nothing better could be expected."""
        return as_it_should_be(self.sentence.entry, self.verdict)

    @property
    def told(self) -> str:
        """What it was taken for, or what was said instead."""
        return str(self.answer.meaning if isinstance(self.answer, Read) else self.answer.sentence)

    @property
    def words(self) -> int:
        """How long the sentence is."""
        return len(self.sentence.entry.say.split())


def rows_of(results: Sequence[Result]) -> list[Row]:
    """A row for each kind that there is something of, one for all, and one for all that skills,
    world and goals can express."""
    groups = [(kind, [r for r in results if r.sentence.kind == kind]) for kind in KINDS]
    groups.append(("all", list(results)))
    groups.append(
        ("all that can be expressed", [r for r in results if not r.sentence.entry.beyond])
    )
    return [_row(name, some) for name, some in groups if some]


def _row(name: str, results: Sequence[Result]) -> Row:
    counts = [sum(r.verdict is verdict for r in results) for verdict in Verdict]
    return (name, str(len(results)), *map(str, counts), _share(results))


def target_rows(results: Sequence[Result]) -> list[Row]:
    """What there is to reach, and what is reached: counts and shares."""
    plain = [r for r in results if r.sentence.kind in ("simple", "compound")]
    expressible = [r for r in results if not r.sentence.entry.beyond]
    refusals = [r for r in results if r.sentence.entry.refused]
    wrong = sum(r.verdict is Verdict.WRONG for r in results)
    return [
        ("taken for something else", "0", str(wrong)),
        ("simple and compound ones as they should be", "90 %", _share(plain)),
        ("all that can be expressed as they should be", "80 %", _share(expressible)),
        ("refusals that name what is wrong", "95 %", _share(refusals)),
    ]


def _share(results: Sequence[Result]) -> str:
    if not results:
        return "-"
    return f"{100 * sum(r.good for r in results) / len(results):.0f} %"


def time_rows(results: Sequence[Result]) -> list[Row]:
    """Milliseconds of the processor's time by length of the sentence."""
    rows: list[Row] = []
    for low, high in zip((0, *LENGTHS), (*LENGTHS, 10_000), strict=True):
        took = [1000 * r.took_s for r in results if low < r.words <= high]
        if took:
            name = f"{low + 1} to {high}" if high in LENGTHS else f"more than {low}"
            rows.append((name, str(len(took)), f"{median(took):.1f} ms", f"{max(took):.1f} ms"))
    return rows


def write_page(path: Path, results: Sequence[Result], with_model: str = "") -> None:
    """The page under docs/benchmarks; `with_model` is a part of it, where a model was asked."""

    def of(some: Callable[[Result], bool]) -> str:
        return as_markdown(HEAD, rows_of([r for r in results if some(r)]))

    shown, hidden = PARTS
    wrong = [r for r in results if r.verdict is Verdict.WRONG and r.sentence.part == shown]
    path.write_text(
        f"""# What people say, and how much of it is understood

Written by `python -m benchmarks.language.run`; do not edit. {machine()}.

{len(results)} sentences in {len({r.sentence.entry.world for r in results})} worlds, each with what
a sensible person means by it there; the conventions stand in
[benchmarks/language/README.md](../../benchmarks/language/README.md). A third of them, chosen by
chance, is held out: whoever writes grammar does not look at it. Beside these stand
sentences that the writers of the grammar made up, and mended it by (`*-own.yaml`): where these
count, the numbers flatter, so only the last of the tables by kind says what to expect of others.

- *right*: taken for what it means. *asked back*: it can mean several things and was asked about, or
  a question or a hint offered the right meaning.
- *well refused*: it means nothing here, and the first words that the refusal quotes are those at
  fault. *refused*: it does mean something. *misleading*: the refusal names other words or gives a
  hint that leads elsewhere, or a question does not offer what was meant.
- *wrong*: it was taken for something else. Nothing is worse.

*As it should be*: right where it has a meaning, asked back where it has several, well refused
where it has none (or, in the sentences that are left out of the last row, none that goals, facts
and skills can express).

{as_markdown(TARGET_HEAD, target_rows(results))}

## By kind

{of(lambda _: True)}

### Open to those who write grammar

{of(lambda r: r.sentence.part == shown)}

### Held out

{of(lambda r: r.sentence.part == hidden)}

{with_model}## Time

Of the processor, to read one sentence, everything known of the world in hand.

{as_markdown(TIME_HEAD, time_rows(results))}

## Taken for something else

{_listed(wrong)}
""",
        encoding="utf-8",
    )


def _listed(wrong: Sequence[Result]) -> str:
    if not wrong:
        return "None of those that are not held out."
    rows = [
        (r.sentence.entry.world, r.sentence.entry.say, f"`{r.told}`".replace("|", "\\|"))
        for r in wrong[:20]
    ]
    return f"{len(wrong)} of those that are not held out, such as:\n\n" + as_markdown(
        ("world", "said", "taken for"), rows
    )
