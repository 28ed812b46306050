"""Phrases of tasks in tagged texts: each becomes one lexeme that says which task is meant."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from fleet.language.methods.model import NUMBER, PERSON, CompoundTask
from fleet.language.methods.patterns import ARTICLES, Row, Slot, rows_of
from fleet.language.tagging.tagger import Lexeme, Tagger
from fleet.language.vocabulary import Vocabulary
from fleet.language.words.latest import Latest
from fleet.language.words.morphology import gerund
from fleet.language.words.tokens import Phrase, Token, number_of

_BEGINS = frozenset(
    {
        "AND",
        "COMMA",
        "THEN",
        "POLITE",
        "TIME",
        "URGENT",
        "LATER",
        "BEFORE",
        "AFTER",
        "ORD",
        "END",
        "MODAL",
    }
)
_ENDS = (_BEGINS - {"ORD", "MODAL"}) | {"IF", "WHEN", "UNLESS"}
_LONGEST_NAME = 8
"""Words that a parameter may have."""
_LATEST: Latest[tuple[CompoundTask, ...], TaskPhrases] = Latest()


@dataclass(frozen=True, eq=False)
class TaskLexeme(Lexeme):
    """A whole clause that calls a task by its name, with parameters; `parts` are its words."""

    task: CompoundTask | None = None
    given: tuple[tuple[str, str], ...] = ()
    parts: tuple[Lexeme, ...] = ()


@dataclass(frozen=True)
class TaskCall:
    """A task that a text calls, and the robots that it tells to do it."""

    lexeme: TaskLexeme
    task: CompoundTask
    by: tuple[str, ...] = ()


class TaskPhrases:
    """Finds tasks' phrases where a clause consists of nothing else."""

    def __init__(self, tasks: Sequence[CompoundTask]) -> None:
        self._rows: dict[str, list[tuple[CompoundTask, Row]]] = defaultdict(list)
        for task in tasks:
            for row in dict.fromkeys(row for phrase in task.says for row in rows_of(phrase)):
                self._rows[str(row[0])].append((task, row))
        self._gerunds = {gerund(word): word for word in self._rows}

    def marked(
        self, lexemes: Sequence[Lexeme], tokens: Sequence[Token], text: str, names: _Names
    ) -> list[Lexeme]:
        """The lexemes, with those of each phrase made one; of several that begin at a word the
        longest."""
        found: list[Lexeme] = []
        at = 0
        while at < len(lexemes):
            begins = not found or bool(found[-1].tags & _BEGINS)
            lexeme = self._at(lexemes, at, tokens, text, names) if begins else None
            found.append(lexeme or lexemes[at])
            at += len(lexeme.parts) if lexeme is not None else 1
        return found

    def begun(
        self, lexemes: Sequence[Lexeme], tokens: Sequence[Token], text: str, names: _Names
    ) -> TaskLexeme | None:
        """The phrase with which a clause begins, and goes on."""
        return self._at(lexemes, 0, tokens, text, names, whole=False) if lexemes else None

    def _at(
        self,
        lexemes: Sequence[Lexeme],
        at: int,
        tokens: Sequence[Token],
        text: str,
        names: _Names,
        whole: bool = True,
    ) -> TaskLexeme | None:
        first = lexemes[at].first
        word = tokens[first].word
        doing = word not in self._rows and word in self._gerunds
        rows = self._rows.get(self._gerunds[word] if doing else word, ())
        best: tuple[int, CompoundTask, dict[str, str]] | None = None
        for can_be in (names.can_be, names.are_unheard_of):
            for task, row in rows if best is None else ():
                for end, given in _matches(row[1:], tokens, first + 1, text, can_be):
                    if (best is None or end > best[0]) and self._ends(lexemes, end, whole):
                        best = end, task, given
        if best is None:
            return None
        last, task, given = best
        parts = tuple(each for each in lexemes[at:] if each.last <= last)
        shown = " ".join(text[tokens[first].start : tokens[last - 1].end].split())
        words = tuple(token.word for token in tokens[first:last])
        tags = frozenset({"TASK", "VERB", *(["GER"] if doing else [])})
        return TaskLexeme(
            words,
            tags,
            first,
            last,
            shown,
            task=task,
            given=tuple({**task.defaults, **given}.items()),
            parts=parts,
        )

    @staticmethod
    def _ends(lexemes: Sequence[Lexeme], last: int, whole: bool) -> bool:
        after = next((each for each in lexemes if each.last > last), None)
        if after is None or after.first < last:
            return after is None
        return bool(after.tags & _ENDS) or not whole


def marked(
    lexemes: list[Lexeme],
    tokens: Sequence[Token],
    text: str,
    vocabulary: Vocabulary,
    tagger: Tagger,
) -> list[Lexeme]:
    """The lexemes of a text, with the words of each clause that calls a task made one."""
    if not vocabulary.tasks:
        return lexemes
    names = _Names(vocabulary, tagger)
    return _phrases_of(vocabulary.tasks).marked(lexemes, tokens, text, names)


def begun(
    lexemes: Sequence[Lexeme],
    tokens: Sequence[Token],
    text: str,
    vocabulary: Vocabulary,
    tagger: Tagger,
) -> TaskLexeme | None:
    """The task's phrase with which a clause begins, and goes on."""
    names = _Names(vocabulary, tagger)
    return _phrases_of(vocabulary.tasks).begun(lexemes, tokens, text, names)


def called(words: Sequence[Lexeme], tagger: Tagger) -> TaskCall | None:
    """The task that a clause calls, by itself or of a robot: "hsr, …", "hsr should …"."""
    if not words or not isinstance(words[-1], TaskLexeme) or words[-1].task is None:
        return None
    call, before = words[-1], words[:-1]
    if not before:
        return TaskCall(call, words[-1].task)
    robots = [e.id for e in tagger.entities(before[0].words) if e.type == "robot"]
    if len(before) == 2 and before[1].tags & {"COMMA", "MODAL"} and len(robots) == 1:
        return TaskCall(call, words[-1].task, tuple(robots))
    return None


def _phrases_of(tasks: tuple[CompoundTask, ...]) -> TaskPhrases:
    """The phrases of tasks: made once for the very same tasks."""
    return _LATEST.of(tasks, lambda: TaskPhrases(tasks))


def spoken_out(words: Sequence[Lexeme]) -> tuple[Lexeme, ...]:
    """The words as they were before phrases of tasks were made one."""
    return tuple(part for w in words for part in (w.parts if isinstance(w, TaskLexeme) else (w,)))


class _Names:
    """What may stand for a parameter."""

    def __init__(self, vocabulary: Vocabulary, tagger: Tagger) -> None:
        self._vocabulary, self._tagger = vocabulary, tagger

    def can_be(self, words: Phrase, of: str) -> bool:
        """Whether the words can mean something of that type."""
        if of == NUMBER:
            return len(words) == 1 and (number_of(words[0]) or 0) > 0
        if of == PERSON and "ME" in self._tagger.book.phrases.get(words, ()):
            return True
        things = self._vocabulary.of_type(of)
        return any(e.id in things for e in self._tagger.entities(self._bare(words)))

    def are_unheard_of(self, words: Phrase, of: str) -> bool:
        """Whether they can, or one of them is known to nobody: the method's sentences then are
        refused by its name."""
        if self.can_be(words, of):
            return True
        words, phrases = self._bare(words), self._tagger.book.phrases
        plain = (phrases.get((word,), frozenset()) <= {"EVERYDAY"} for word in words)
        known = all(self._tagger.entities((word,)) for word in words)
        return of != NUMBER and not known and all(plain)

    def _bare(self, words: Phrase) -> Phrase:
        """Without articles before them."""
        phrases = self._tagger.book.phrases
        while words and phrases.get(words[:1], frozenset()) & {"DET", "INDEF"}:
            words = words[1:]
        return words


def _matches(
    row: Row, tokens: Sequence[Token], at: int, text: str, can_be: Callable[[Phrase, str], bool]
) -> Iterator[tuple[int, dict[str, str]]]:
    """Where a row that goes on at a token can end, and what its parameters are then."""
    if not row:
        yield at, {}
        return
    if at >= len(tokens):
        return
    part = row[0]
    if isinstance(part, Slot):
        for end in range(at + 1, min(at + _LONGEST_NAME, len(tokens)) + 1):
            words = tuple(token.word for token in tokens[at:end])
            if not words[-1][0].isalnum():
                return
            if can_be(words, part.type):
                said = " ".join(text[tokens[at].start : tokens[end - 1].end].split())
                said = words[0] if part.type == NUMBER else said
                for last, given in _matches(row[1:], tokens, end, text, can_be):
                    yield last, {part.name: said, **given}
        return
    if tokens[at].word == part:
        yield from _matches(row[1:], tokens, at + 1, text, can_be)
    elif tokens[at].word in ARTICLES:
        yield from _matches(row, tokens, at + 1, text, can_be)
