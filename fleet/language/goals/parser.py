"""Reads goals: clauses one after the other, until every word of the text has been used."""

from __future__ import annotations

from dataclasses import dataclass

from fleet.errors import NotUnderstood
from fleet.language.goals.sentences import Sentences
from fleet.language.phrases.locations import PLACES
from fleet.language.phrases.subjects import THINGS, Subject
from fleet.language.vocabulary import Vocabulary
from fleet.language.words.tokens import SENTENCE_ENDS
from fleet.language.words.verb_senses import EXAMPLE
from fleet.language.words.wordlists import (
    ASKING_WHERE,
    CAUSATIVES,
    CLOSERS,
    ENOUGH,
    ENSURING,
    NEXT,
    OPENERS,
    REMARKS,
    WANTING,
)
from keyexpr_schema.facts import Literal
from keyexpr_schema.payloads.goals import Condition

_PREPOSED = frozenset({"to", "into", "onto", "in", "on", "at", "inside", "back", "there"})


@dataclass(frozen=True)
class Reading:
    """What a goal sentence asks for.

    `stages` come one after the other; all conditions of a stage hold together at its end.
    `presumed` are facts that the sentence takes for granted: "bring the first cup from the
    kitchen …" presumes `at(cup_1) = kitchen`. They are no part of the goal.
    `remarks` are parts of the text that ask for nothing, as it was written: "I have a headache".
    """

    text: str
    stages: tuple[tuple[Condition, ...], ...]
    presumed: tuple[Literal, ...] = ()
    remarks: tuple[str, ...] = ()


def read_goal(text: str, vocabulary: Vocabulary) -> Reading:
    """What a text asks for, by grammar and the names that exist.

    Raises:
        NotUnderstood: a word was not understood, or the text contradicts itself; one sentence.
    """
    return _GoalParser(text, vocabulary).read()


class _GoalParser(Sentences):
    """Joins clauses, and tells them apart."""

    def __init__(self, text: str, vocabulary: Vocabulary) -> None:
        super().__init__(text, vocabulary)
        self.remarks: list[str] = []

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
            if self._remark():
                continue
            self._clause()
            while cursor.take_of(CLOSERS) or cursor.take(",", "please"):
                pass
            if not (cursor.at_border() or cursor.word() == "and" or cursor.next_of(NEXT)):
                raise self._left_over()
        presumed = tuple(dict.fromkeys(self.subjects.presumed))
        stages = self.draft.conditions()
        return Reading(self.cursor.line, stages, presumed, tuple(self.remarks))

    def _remark(self) -> bool:
        """Go past a sentence in which a person speaks of themselves, up to its end or a command.

        One that names something known, or has a word for which goals are refused, is none: what it
        says may matter.
        """
        cursor, start = self.cursor, self.cursor.at
        begins = start == 0 or cursor.tokens[start - 1].word in SENTENCE_ENDS
        opening = cursor.next_of(REMARKS) if begins else None
        if opening is None or cursor.word(len(opening)) == "to":
            return False
        cursor.at += len(opening)
        while not cursor.ended and cursor.word() not in SENTENCE_ENDS:
            if cursor.word() == "," and self._command_after(1):
                break
            if cursor.lexicon.starts_name(cursor.tokens, cursor.at) or str(cursor.refusal("")):
                shown = cursor.quote(start, cursor.phrase()[1])
                raise NotUnderstood(
                    f"{shown!r} is no goal, and may matter: leave it out, or tell it as a fact"
                )
            cursor.at += 1
        self.remarks.append(cursor.quote(start))
        return True

    def _command_after(self, words: int) -> bool:
        cursor, start = self.cursor, self.cursor.at
        cursor.at += words
        cursor.take_of(OPENERS)
        found = cursor.verb_next()
        cursor.at = start
        return found

    def _join(self) -> bool:
        """Go past what joins clauses; whether something must follow."""
        cursor, must = self.cursor, False
        while True:
            if cursor.take_word(SENTENCE_ENDS):
                must = False
                self.elliptic = ""
                self.addressees = []
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
        found = polite or cursor.verb_next()
        cursor.at = start
        return found

    def _clause(self) -> None:
        cursor = self.cursor
        if self.elliptic and self.moved and cursor.word() in _PREPOSED | {"home"}:
            locatives, home = self.locatives()
            self.to_target(self._same(), self.where(locatives), home)
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
        elif cursor.take_of(WANTING):
            self.declarative(wanted=True)
        elif cursor.next_of(CAUSATIVES) and not cursor.verb_next():
            cursor.take_of(CAUSATIVES)
            self.declarative(bare_infinitive=True)
        elif cursor.word() in ("clear", "empty") and self._table_next():
            self.clear()
        elif (phrase := self.skill_phrase()) is not None:
            self.done_to(phrase)
        elif self.parted_verb():
            pass
        elif cursor.verb_next():
            self.imperative()
        elif cursor.word() in ("can", "could", "would", "will", "should", "may"):
            cursor.at += 1
            self.declarative(bare_infinitive=True)
        elif self._enough():
            pass
        elif self.nouns.starts((*THINGS, *PLACES)) or cursor.word() in (
            "it",
            "they",
            "them",
        ):
            self.declarative()
        else:
            raise self.no_clause()

    def _table_next(self) -> bool:
        """Whether the next word is a verb, and a place or surface is what it is about; past it."""
        cursor, start = self.cursor, self.cursor.at
        cursor.at += 1
        cursor.take_word(("off", "up"))
        if self.nouns.starts(PLACES):
            return True
        cursor.at = start
        return False

    def _enough(self) -> bool:
        """`a bottle in the kitchen would do`: which of what was asked for before, and where to."""
        cursor, start = self.cursor, self.cursor.at
        try:
            noun = self.subjects.read("an object", ("object",), several=False)[0]
            locatives, home = self.locatives()
        except NotUnderstood:
            cursor.at = start
            return False
        if not cursor.take_of(ENOUGH):
            cursor.at = start
            return False
        will_do = self.subjects.resolve(self.subjects.movable(noun)).subjects
        asked = [m for m in self.subjects.recent if m.open and set(m.subjects) & set(will_do)]
        if len(asked) != 1:
            raise NotUnderstood(
                f"{cursor.quote(start)!r}: nothing was asked for before that it could do for"
            )
        meant = self.draft.narrow(asked[0], will_do)
        self.subjects.remember([meant])
        if locatives or home:
            self.to_target([meant], self.where(locatives), home)
        return True

    def _same(self) -> list[Subject]:
        """Those that were moved last, as they were resolved then."""
        return list(self.subjects.recent[:1]) or self.moved

    def _left_over(self) -> NotUnderstood:
        cursor = self.cursor
        shown = cursor.quote(*cursor.phrase())
        before = cursor.quote(self.began, cursor.at)
        return cursor.refusal(f"{shown!r} is not understood after {before!r}")
