"""The sentences of the suite, and what a sensible person would mean by each."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Literal

from benchmarks.language.meanings import (
    Asked,
    BadMeaning,
    Meaning,
    WantedMeaning,
    conditions,
    wanted,
)
from sim.errors import BadFile
from sim.files.yaml_file import FileEntry, read_entries

HERE = Path(__file__).parent / "suite"
KINDS = (
    "simple",
    "compound",
    "complex",
    "vague",
    "question",
    "statement",
    "refusal",
    "ambiguous",
)
PARTS = ("dev", "held-out")
Of = Literal["where", "how many", "which", "whether", "what doing", "what able", "who"]


class GoalEntry(FileEntry, frozen=True, kw_only=True):
    """A goal as it is written down: `goal` are its conditions, `;` between those of a stage and
    `>` between stages."""

    goal: str = ""
    always: str = ""
    never: str = ""
    when: str = ""
    whenever: str = ""
    before: tuple[tuple[str, str], ...] = ()
    priority: int = 0
    due_s: float | None = None
    not_before_s: float | None = None
    every: str | None = None
    by: str = ""

    def wanted_meaning(self) -> WantedMeaning | None:
        """The goal, or `None` if nothing is asked for."""
        found = WantedMeaning(
            stages=tuple(conditions(stage) for stage in self.goal.split(">") if stage.strip()),
            always=conditions(self.always),
            never=conditions(self.never),
            when=conditions(self.when),
            whenever=conditions(self.whenever),
            before=frozenset((wanted(first), wanted(then)) for first, then in self.before),
            priority=self.priority,
            due_s=self.due_s,
            not_before_s=self.not_before_s,
            every=self.every,
            by=frozenset(filter(None, self.by.split("|"))),
        ).canonical()
        asks = found.stages or found.always or found.never or found.before
        return found if asks else None


class QuestionEntry(FileEntry, frozen=True, kw_only=True):
    """`subjects` (`a|b`) are those asked about, none: anything; `?` in a condition is each of
    them."""

    of: Of
    subjects: str = ""
    holds: str = ""


class MeaningEntry(GoalEntry, frozen=True, kw_only=True):
    """Something that a text may mean: a goal or several, facts, a question."""

    goals: tuple[GoalEntry, ...] = ()
    facts: str = ""
    question: QuestionEntry | None = None

    def meaning(self) -> Meaning:
        """The same, so that it can be compared."""
        goals = [goal.wanted_meaning() for goal in (self, *self.goals)]
        question = self.question
        return Meaning(
            frozenset(goal for goal in goals if goal is not None),
            conditions(self.facts),
            None
            if question is None
            else Asked(
                question.of,
                frozenset(filter(None, question.subjects.split("|"))),
                conditions(question.holds),
            ).canonical(),
        )


class Entry(MeaningEntry, frozen=True, kw_only=True):
    """A sentence, the world that it is said in, and what it means there.

    `asks`: what it could mean, all of which a question back must offer. `refused`: words that the
    refusal must name (`a|b`: one of them). `also`: other meanings that are right as well. `beyond`
    says what goals, facts and skills cannot express of it: a refusal is right then. `typo`: a word
    is misspelt, so that a hint at the right one is as good as the meaning.
    """

    id: str
    world: str
    say: str
    asks: tuple[MeaningEntry, ...] = ()
    refused: tuple[str, ...] = ()
    also: tuple[MeaningEntry, ...] = ()
    beyond: str = ""
    typo: bool = False

    def meanings(self) -> tuple[Meaning, ...]:
        """What it may be taken for; nothing if it is to be asked about or refused."""
        first = self.meaning()
        return () if first == Meaning() else (first, *(other.meaning() for other in self.also))

    def candidates(self) -> tuple[Meaning, ...]:
        """What a question back must offer."""
        return tuple(candidate.meaning() for candidate in self.asks)


class _File(FileEntry, frozen=True, kw_only=True):
    entries: tuple[Entry, ...]


class Sentence(FileEntry, frozen=True, kw_only=True):
    """An entry, of which part and kind it is."""

    part: str
    kind: str
    entry: Entry


def load_suite(part: str | None = None, kind: str | None = None) -> tuple[Sentence, ...]:
    """The sentences of a part and kind, or of all, in the order of the files.

    Raises:
        BadFile: one sentence that names the file and what is wrong in it.
    """
    found = []
    for of_part in PARTS:
        for of_kind in KINDS:
            if part not in (None, of_part) or kind not in (None, of_kind):
                continue
            more = sorted((HERE / of_part).glob(f"{of_kind}-*.yaml"))
            for path in (HERE / of_part / f"{of_kind}.yaml", *more):
                entries = read_entries(path, _File, "file of sentences")[0].entries
                found += [Sentence(part=of_part, kind=of_kind, entry=entry) for entry in entries]
    _check(found)
    return tuple(found)


def _check(sentences: list[Sentence]) -> None:
    for sentence in sentences:
        entry, where = sentence.entry, f"{sentence.part}/{sentence.kind}.yaml: {sentence.entry.id}"
        try:
            expected = [bool(entry.meanings()), bool(entry.candidates()), bool(entry.refused)]
        except BadMeaning as wrong:
            raise BadFile(f"{where}: {wrong}") from None
        if sum(expected) != 1:
            raise BadFile(
                f"{where}: it must have one of a meaning (goal, goals, facts, question), "
                "`asks` and `refused`"
            )
    for what, names in (
        ("the id", [s.entry.id for s in sentences]),
        ("the sentence", [f"{s.entry.world}: {plain(s.entry.say)}" for s in sentences]),
    ):
        twice = [name for name, count in Counter(names).items() if count > 1]
        if twice:
            raise BadFile(f"{what} {twice[0]!r} comes twice")


def plain(text: str) -> str:
    """A text without case, punctuation and spacing: two that are the same but for these are one."""
    return " ".join("".join(c if c.isalnum() else " " for c in text.casefold()).split())
