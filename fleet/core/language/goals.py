"""Reads goals: clauses one after the other, until every word of the text has been used."""

from __future__ import annotations

from dataclasses import dataclass

from fleet.core.language.locations import PLACES
from fleet.core.language.sentences import Sentences
from fleet.core.language.subjects import THINGS, Fact, Subject
from fleet.core.language.tokens import SENTENCE_ENDS
from fleet.core.language.verbs import EXAMPLE, verb_next
from fleet.core.language.vocabulary import Vocabulary
from fleet.core.language.wordlists import (
    ASKING_WHERE,
    CLOSERS,
    ENSURING,
    NEXT,
    OPENERS,
    TELLING,
    WANTING,
)
from fleet.errors import NotUnderstood
from keyexpr_schema.goals import Condition

_PREPOSED = frozenset({"to", "into", "onto", "in", "on", "at", "inside", "back", "there"})


@dataclass(frozen=True)
class Reading:
    """What a goal sentence asks for.

    `stages` come one after the other; all conditions of a stage hold together at its end.
    `presumed` are facts that the sentence takes for granted, as (relation, subject, value): "bring
    the first cup from the kitchen …" presumes `at(cup_1) = kitchen`. They are no part of the goal.
    """

    text: str
    stages: tuple[tuple[Condition, ...], ...]
    presumed: tuple[Fact, ...] = ()


def read_goal(text: str, words: Vocabulary) -> Reading:
    """What a text asks for, by grammar and the names that exist.

    Raises:
        NotUnderstood: a word was not understood, or the text contradicts itself; one sentence.
    """
    return _Goals(text, words).read()


def goal_conditions(text: str, words: Vocabulary) -> tuple[Condition, ...]:
    """The conditions of the first stage of a goal.

    Raises:
        NotUnderstood: as `read_goal`.
    """
    return read_goal(text, words).stages[0]


class _Goals(Sentences):
    """Joins clauses, and tells them apart."""

    def read(self) -> Reading:
        cursor = self.cursor
        if not any(token.word[0].isalnum() for token in cursor.tokens):
            raise NotUnderstood("the sentence is empty: say what you want")
        while True:
            joined = self._join()
            if cursor.ended:
                if joined or all(not stage for stage in self.draft.stages):
                    raise NotUnderstood(
                        f"{cursor.line!r} ends before it says what to do: {EXAMPLE}"
                    )
                break
            self.began = cursor.at
            self._clause()
            while cursor.take_of(CLOSERS) or cursor.take(",", "please"):
                pass
            if not (cursor.at_border() or cursor.word() == "and" or cursor.next_of(NEXT)):
                raise self._left_over()
        presumed = tuple(dict.fromkeys(self.subjects.presumed))
        return Reading(self.cursor.line, self.draft.conditions(), presumed)

    def _join(self) -> bool:
        """Go past what joins clauses; whether something must follow."""
        cursor, must = self.cursor, False
        while True:
            if cursor.take_word(SENTENCE_ENDS):
                must = False
                self.elliptic = ""
                self.told = []
            elif cursor.take_of(NEXT):
                self.draft.next_stage()
                must = True
            elif cursor.take(","):
                pass
            elif cursor.take("and"):
                must = True
            elif cursor.word() == "1st" and (cursor.word(1) == "," or self._verb_after_first()):
                cursor.at += 1
                must = True
            elif self.polite():
                pass
            else:
                return must

    def _verb_after_first(self) -> bool:
        cursor, start = self.cursor, self.cursor.at
        if self.nouns.starts((*THINGS, "place")):
            return False
        cursor.at += 1
        polite = bool(cursor.take_of(OPENERS))
        found = polite or verb_next(cursor)
        cursor.at = start
        return found

    def _clause(self) -> None:
        cursor = self.cursor
        if self.elliptic and self.moved and cursor.word() in _PREPOSED | {"home"}:
            parts, home = self.parts()
            self.to_target(self._same(), self.where(parts), home)
        elif cursor.take_of(ASKING_WHERE):
            self.find()
            cursor.take_word(("is", "are"))
        elif cursor.take("there"):
            self.there_should_be()
        elif cursor.take_of(ENSURING):
            if cursor.take("there"):
                self.there_should_be()
            else:
                self.declarative(states=True)
        elif wanting := cursor.take_of(WANTING):
            self.declarative(wanted=wanting is not None)
        elif cursor.next_of(TELLING) and not verb_next(cursor):
            cursor.take_of(TELLING)
            self.declarative(told=True)
        elif verb_next(cursor):
            self.imperative()
        elif cursor.word() in ("can", "could", "would", "will", "should", "may"):
            cursor.at += 1
            self.declarative(told=True)
        elif self.nouns.starts((*THINGS, *PLACES)) or cursor.word() in ("it", "they", "them"):
            self.declarative()
        else:
            raise self.no_clause()

    def _same(self) -> list[Subject]:
        """Those that were moved last, as they were settled then."""
        return list(self.subjects.recent[:1]) or self.moved

    def _left_over(self) -> NotUnderstood:
        cursor = self.cursor
        shown = cursor.said(*cursor.phrase())
        before = cursor.said(self.began, cursor.at)
        return cursor.refusal(f"{shown!r} is not understood after {before!r}")
