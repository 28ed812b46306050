"""Reads noun phrases: "the second cup", "all cups", "one of the robots", "cups 1 and 2"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.phrases.cursor import Cursor
from fleet.language.phrases.heads import LAST, Heads
from fleet.language.phrases.mentions import Mention, NounPhrase, Quantity
from fleet.language.refusals import listed
from fleet.language.words.lexicon import EntityType
from fleet.language.words.tokens import Phrase, number_of, ordinal_of
from fleet.language.words.wordlists import (
    ANYTHING,
    COPULAR_VERBS,
    DEFINITE,
    EVERYONE,
    EVERYTHING,
    INDEFINITE,
    PREPOSITIONS,
    UNIVERSAL,
)

_GENERAL: tuple[tuple[EntityType, tuple[Phrase, ...], Quantity], ...] = (
    ("object", EVERYTHING, Quantity.ALL),
    ("object", ANYTHING, Quantity.ANY),
    ("robot", EVERYONE, Quantity.ALL),
)
_COMMON_USES = frozenset({"drink", "eat", "read", "play", "wear", "write", "sit"})
"""Verbs that speak of what a thing is good for, whether or not something is known to be."""


class NounPhrases(Heads):
    """Reads noun phrases from a cursor, and remembers whom was spoken of."""

    def __init__(self, cursor: Cursor) -> None:
        super().__init__(cursor)
        self._mentioned: list[Mention] = []

    def mentioned(self, mention: Mention) -> None:
        """Remember it for "the other cup"."""
        self._mentioned.append(mention)

    def starts(self, types: Sequence[EntityType]) -> bool:
        """Whether a noun phrase of one of these types comes next; nothing is gone past."""
        start = self.cursor.at
        try:
            self.noun("", types)
        except NotUnderstood:
            return False
        finally:
            self.cursor.at = start
        return True

    def noun(self, what: str, types: Sequence[EntityType]) -> NounPhrase:
        """The noun phrase that comes next.

        Raises:
            NotUnderstood: nothing known of these types comes next; the message lists what is.
        """
        cursor, start = self.cursor, self.cursor.at
        if (general := self._general(start, what, types)) is not None:
            return self._useful(general)
        another = not self.named(types)[1] and cursor.take("another")
        determiner = self._determiner(types)
        if another:
            determiner = replace(determiner, quantity=Quantity.ANY)
        other = another or bool(not self.named(types)[1] and cursor.take("other"))
        if other and determiner.count is None:
            determiner = replace(determiner, count=self._count(types))
        ordinal = None if other else self._ordinal(types)
        more = (
            self._more_ordinals(types) if ordinal is not None and determiner.count is None else []
        )
        if ordinal is not None and determiner.count is not None:
            raise self.unknown(start, what, types)  # "the two first cup"
        count = self._count(types) if ordinal is not None else determiner.count
        bare = (other or ordinal is not None) and self._nothing_follows()
        kin = tuple(e for e in self.kind if e.type in types) if bare else ()
        noun = self.noun_phrase(kin, start) if kin else self.head(start, what, types)
        noun = replace(
            noun,
            quantity=noun.quantity if noun.quantity is Quantity.ALL else determiner.quantity,
            count=count,
            ordinal=ordinal,
            plural=noun.plural and not determiner.exact,
            text=cursor.quote(start),
            key=start,
        )
        if more:
            return self._numbered_each(noun, more)
        return self._others(noun, another) if other else self._useful(noun)

    def _more_ordinals(self, types: Sequence[EntityType]) -> list[int]:
        """The rest of `first and second`, `first, the second and the third`, before one noun."""
        cursor, began, found = self.cursor, self.cursor.at, list[int]()
        while True:
            start = cursor.at
            joined = cursor.take_joint()
            cursor.take_word(DEFINITE)
            ordinal = self._ordinal(types) if joined else None
            if ordinal is None:
                break
            found.append(ordinal)
        cursor.at = start
        if self._nothing_follows() or self.is_pronoun_one():
            cursor.at = began
            return []
        return found

    def _numbered_each(self, noun: NounPhrase, more: Sequence[int]) -> NounPhrase:
        """All of "the first and second cup"."""
        names = [
            name
            for ordinal in (noun.ordinal, *more)
            for name in replace(noun, ordinal=ordinal, count=None, plural=False).resolve().subjects
        ]
        return replace(
            noun.among(names), ordinal=None, quantity=Quantity.ALL, exact=True, plural=True
        )

    def _general(self, start: int, what: str, types: Sequence[EntityType]) -> NounPhrase | None:
        """`everything`, `something`, `everybody`: all that there is of a type, or any of it."""
        cursor = self.cursor
        if self.named(types)[1]:
            return None
        for entity_type, phrases, quantity in _GENERAL:
            if entity_type in types and cursor.take_of(phrases):
                found = tuple(e for e in cursor.lexicon.entities if e.type == entity_type)
                if not found:
                    cursor.at = start
                    raise cursor.unknown(what, types)
                return self.noun_phrase(
                    found, start, quantity=quantity, generic=entity_type == "object"
                )
        return None

    def _useful(self, noun: NounPhrase) -> NounPhrase:
        """The same, with what follows it said: "something to drink", "a book to read".

        Raises:
            NotUnderstood: nothing is known to be good for that.
        """
        cursor = self.cursor
        known = {use for e in cursor.lexicon.entities if e.type == "object" for use in e.uses}
        verb = cursor.word(1)
        if noun.type != "object" or cursor.word() != "to" or not verb:
            return noun
        place = cursor.lexicon.exact(cursor.tokens, cursor.at + 1, ("place", "surface", "robot"))[1]
        if place or (verb not in known and not (noun.generic and verb in _COMMON_USES)):
            return noun
        found = tuple(e for e in noun.found if verb in e.uses)
        cursor.at += 2
        text = cursor.quote(noun.key)
        if not found:
            raise NotUnderstood(
                f"{text!r}: nothing of that kind is known to be good for that; say so with the "
                f'field "uses" of its kind; known uses are {listed(sorted(known))}'
            )
        return replace(noun, found=found, text=text, generic=False)

    def _nothing_follows(self) -> bool:
        word = self.cursor.word()
        return not word or not word[0].isalnum() or word in PREPOSITIONS | COPULAR_VERBS | {"and"}

    def _determiner(self, types: Sequence[EntityType]) -> NounPhrase:
        """Quantity and count that the words before a noun say; `exact` for "one of"."""
        cursor, quantity, count, one = self.cursor, Quantity.BARE, None, False
        if self.named(types)[1]:
            return NounPhrase((), "", 0)
        if word := cursor.take_word(UNIVERSAL):
            quantity, count = Quantity.ALL, 2 if word == "both" else None
            cursor.take("single")
            cursor.take("of")
            cursor.take_word(DEFINITE)
        elif word := cursor.take_word(INDEFINITE):
            quantity = Quantity.ANY
            cursor.take("single")
            if cursor.take("of"):
                cursor.take_word(DEFINITE)
                one = word != "some"
        elif cursor.take_word(DEFINITE):
            quantity = Quantity.THE
            cursor.take("whole")
        number = self._count(types)
        if number is not None:
            count = number if count in (None, number) else -1
            if number == 1 and quantity in (Quantity.BARE, Quantity.ANY):
                quantity, count = Quantity.ANY, None
            if cursor.take("of"):
                cursor.take_word(DEFINITE)
                one = True
        return NounPhrase((), "", 0, quantity, exact=one, count=count)

    def _count(self, types: Sequence[EntityType]) -> int | None:
        number = number_of(self.cursor.word())
        if number is None or self.named(types)[1] or self.is_pronoun_one():
            return None
        self.cursor.at += 1
        return number

    def _ordinal(self, types: Sequence[EntityType]) -> int | None:
        if self.named(types)[1]:
            return None
        if self.cursor.take_word(LAST):
            return 0
        ordinal = ordinal_of(self.cursor.word())
        self.cursor.at += ordinal is not None
        return ordinal

    def _others(self, noun: NounPhrase, another: bool) -> NounPhrase:
        """Those of the kind that were not spoken of yet.

        After "a cup", which may be any, "the other one" is any too if there are two, and "another
        cup" always: that they differ follows from where they are wanted.
        """
        known = set(noun.names)
        gone = [m for m in self._mentioned if known & set(m.subjects)]
        opened = {m.key for m in gone if m.open}
        left = noun.among(known - {s for m in gone if not m.open for s in m.subjects})
        spare = len(left.names) - len(opened)
        if not gone or spare < 1 or (opened and not another and (spare > 1 or noun.plural)):
            raise NotUnderstood(
                f"{noun.text!r} could be {' or '.join(noun.names)}: call it by its name"
            )
        return replace(left, quantity=Quantity.ANY) if opened else left
