"""Reads statements: what is where, what is not known, what has been searched, who holds what."""

from __future__ import annotations

from collections.abc import Sequence

from fleet.errors import NotUnderstood
from fleet.language.phrases.locations import PLACES, SPOTS
from fleet.language.phrases.mentions import NounPhrase
from fleet.language.phrases.subjects import THINGS, Subject
from fleet.language.statements.claims import Claims
from fleet.language.vocabulary import Vocabulary
from fleet.language.words.statement_words import (
    CARRYING,
    GRIPPING,
    HOUSES,
    NOBODY,
    NOBODY_KNOWS,
    PEOPLE,
    PUT,
    SAID_CLOSERS,
    SAID_OPENERS,
    SEARCH_PARTICIPLES,
    UNKNOWN,
    WHEREABOUTS,
)
from fleet.language.words.tokens import SENTENCE_ENDS
from fleet.language.words.wordlists import ANYWHERE, COPULAR_VERBS, SITUATED, phrases
from keyexpr_schema.facts import Literal

_EXAMPLE = 'say it like "the first cup is in the kitchen" or "nobody knows where the book is"'


def statement_facts(text: str, vocabulary: Vocabulary) -> tuple[Literal, ...]:
    """The facts in a statement, where the value `None` is *unknown*.

    Raises:
        NotUnderstood: a word was not understood, or the text contradicts itself; one sentence.
    """
    return _StatementParser(text, vocabulary).read()


class _StatementParser(Claims):
    """Joins statements, and tells them apart."""

    def read(self) -> tuple[Literal, ...]:
        cursor = self.cursor
        if not any(token.word[0].isalnum() for token in cursor.tokens):
            raise NotUnderstood("the sentence is empty: say what holds")
        while True:
            joined = self._join()
            if cursor.ended:
                if joined or not self.facts:
                    raise NotUnderstood(f"{cursor.line!r} ends before it says anything: {_EXAMPLE}")
                break
            self.began = cursor.at
            self._statement()
            while cursor.take_of(SAID_CLOSERS):
                pass
            if not (cursor.at_border() or cursor.word() == "and"):
                raise self._unread()
        return tuple(Literal(key, value) for key, value in self.facts.items())

    def _join(self) -> bool:
        cursor, must = self.cursor, False
        while True:
            if cursor.take_word(SENTENCE_ENDS):
                must = False
            elif cursor.take("and"):
                must = True
            elif not cursor.take(","):
                opener = cursor.next_of(SAID_OPENERS)
                named = cursor.lexicon.exact(cursor.tokens, cursor.at, (*THINGS, *PLACES))[1]
                if opener is None or named:
                    return must
                cursor.at += len(opener)

    def _statement(self) -> None:
        cursor, start = self.cursor, self.cursor.at
        if cursor.take_of(NOBODY_KNOWS):
            things = self._things()
            cursor.take_word(("is", "are"))
            return self.lost(things)
        if cursor.take_of(WHEREABOUTS):
            things = self._things()
            if cursor.take_word(("is", "are")) and cursor.take_of(UNKNOWN):
                return self.lost(things)
            raise self._unread()
        if cursor.take_of(NOBODY):
            if (cursor.take("has") or cursor.take("have")) and cursor.take_of(SEARCH_PARTICIPLES):
                return self.looked_around(self.places(), False)
            cursor.at = start
            raise self._unread()
        if cursor.take("there"):
            if not cursor.take_word(("is", "are", "'s")):
                raise self._unread()
            return self._at(self._things())
        if cursor.take_of(PEOPLE):
            if cursor.take("have") | bool(cursor.take("already")) and cursor.take_of(
                SEARCH_PARTICIPLES
            ):
                return self.looked_around(self.places(), True)
            if cursor.take_of(SEARCH_PARTICIPLES):
                return self.looked_around(self.places(), True)
            if cursor.take_of(PUT):
                return self._at(self._things())
            raise self._unread()
        preposition = cursor.word() in ("in", "on", "at", "inside") and cursor.preposition()
        if preposition:
            return self._inverted(preposition)
        if self.nouns.starts(THINGS) or cursor.word() in ("it", "they"):
            return self._of_things()
        if self.nouns.starts(PLACES) or cursor.next_of(phrases("the house|everywhere")):
            return self._of_places()
        raise self._unread()

    def _things(self) -> list[Subject]:
        return self.subjects.read("an object or a robot", THINGS)

    def _inverted(self, preposition: str) -> None:
        """`In the kitchen there are two cups`."""
        cursor = self.cursor
        locatives = [self.locations.locative(preposition)]
        cursor.take(",")
        cursor.take("there")
        if not cursor.take_word(("is", "are", "stands", "lies", "stand", "lie", "'s")):
            raise self._unread()
        things = self._things()
        where = self.where(locatives)
        self.put(things, where.target, where.target_surface)

    def _of_things(self) -> None:
        cursor, start = self.cursor, self.cursor.at
        things = self._things()
        if cursor.take("'s") and cursor.take_word(("location", "position", "whereabouts", "hand")):
            hand = cursor.tokens[cursor.at - 1].word == "hand"
            if not cursor.take_word(("is", "are")):
                raise self._unread()
            if hand and cursor.take("empty"):
                return self.holding(things, None)
            if not hand and cursor.take_of(UNKNOWN):
                return self.lost(things)
            raise self._unread()
        standing = cursor.tokens[cursor.at - 1].word == "'s"
        if self._has(things):
            return None
        if all(s.type == "robot" for s in things):
            holding = cursor.take_of(GRIPPING)
            if holding or cursor.take_of(CARRYING):
                if cursor.take("nothing"):
                    if holding:
                        return self.holding(things, None)
                    raise NotUnderstood(
                        'what lies in a basket is said thing by thing, not "nothing"'
                    )
                held = self.subjects.read("an object", ("object",))
                return self.holding(things, held, in_hand=holding is not None)
        found = cursor.take("can", "be", "found") or cursor.take("could", "be", "found")
        could = cursor.take("could", "be") or cursor.take("may", "be") or cursor.take("might", "be")
        if could:
            if cursor.take_of(ANYWHERE):
                return self.lost(things)
            cursor.at -= 2
            raise self._unread()
        if cursor.take("has", "been") or cursor.take("have", "been"):
            if cursor.take_of(phrases("lost|misplaced|missing")):
                return self.lost(things)
        elif not (
            standing
            or found
            or cursor.take_word(COPULAR_VERBS)
            or cursor.take("has", "gone", "missing")
            or cursor.word() in ("in", "on", "at", "inside")
        ):
            raise self._unread(start if cursor.ended else None)
        if cursor.take_of(UNKNOWN):
            return self.lost(things)
        if all(s.type == "object" for s in things) and (made := self.state()) is not None:
            return self.are_so(things, made)
        return self._at(things)

    def _has(self, subjects: Sequence[Subject]) -> bool:
        """`Anna has the cup`, `the drawer contains the forks`, after the subject; past it."""
        cursor, start = self.cursor, self.cursor.at
        if len(subjects) != 1 or subjects[0].type != "object":
            return False
        one = subjects[0]
        names = one.names if isinstance(one, NounPhrase) else one.subjects
        person = all(map(self.vocabulary.is_person, names))
        verbs = (*CARRYING, *GRIPPING) if person else HOUSES
        known = person or all(name in self.vocabulary.good_for for name in names)
        if not known or not cursor.take_of(verbs) or not self.nouns.starts(("object",)):
            cursor.at = start
            return False
        by = self.subjects.resolve(one).subjects
        self.put(self.subjects.read("an object", ("object",)), by[0])
        return True

    def _at(self, things: Sequence[Subject]) -> None:
        """`… in PLACE`, after what stands there."""
        cursor = self.cursor
        while cursor.take_of(SITUATED):
            pass
        locatives, home = self.locatives()
        if home or not locatives:
            raise self._unread()
        where = self.where(locatives)
        if where.source is not None or where.target is None:
            raise NotUnderstood(f"{self.clause!r} does not say one place: {_EXAMPLE}")
        self.put(things, where.target, where.target_surface)

    def _of_places(self) -> None:
        """`The kitchen has been searched`, `the kitchen contains two cups`."""
        cursor = self.cursor
        places = self.places()
        negated = False
        if len(places) == 1 and cursor.take_of(HOUSES) and not cursor.next_of(phrases("been|not")):
            return self.put(self._things(), places[0])
        if cursor.tokens[cursor.at - 1].word in ("has", "have"):
            cursor.at -= 1
        if cursor.take_word(("has", "have")):
            negated = cursor.take("not")
            cursor.take("already")
            if not cursor.take("been"):
                raise self._unread()
        elif cursor.take_word(("is", "are", "was", "were")):
            negated = cursor.take("not")
        else:
            raise self._unread()
        cursor.take("already")
        if cursor.take("unsearched"):
            return self.looked_around(places, negated)
        if not cursor.take_of(SEARCH_PARTICIPLES):
            raise self._unread()
        if cursor.take("yet") and not negated:
            raise self._unread()
        return self.looked_around(places, not negated)

    def _unread(self, start: int | None = None) -> NotUnderstood:
        cursor = self.cursor
        if start is not None:
            cursor.at = start
        if cursor.word() == "not" or cursor.word() in ("isn", "aren"):
            return NotUnderstood(
                f"{cursor.line!r} says what is not so, which tells nobody where "
                'things are: say where it is, or "nobody knows where … is"'
            )
        if cursor.at == self.began and cursor.verb_next():
            shown = cursor.line
            return NotUnderstood(f"{shown!r} is a goal and not a fact: {_EXAMPLE}")
        if cursor.at == self.began and not (self.nouns.starts((*THINGS, *SPOTS))):
            return cursor.unknown("an object, robot or place", ("object", "robot", "place"))
        shown = cursor.quote(*cursor.phrase()) or self.clause
        return cursor.refusal(f"{shown!r} is not understood as a fact: {_EXAMPLE}")
