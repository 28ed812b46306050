"""Reads noun phrases: "the second cup", "all cups", "one of the robots", "cups 1 and 2"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fleet.core.language.cursor import Cursor
from fleet.core.language.heads import LAST, Heads
from fleet.core.language.lexicon import Sort
from fleet.core.language.mentions import Mention, Noun, Quantity
from fleet.core.language.tokens import number_of, ordinal_of
from fleet.core.language.wordlists import (
    ANYTHING,
    DEFINITE,
    EVERYTHING,
    INDEFINITE,
    PREPOSITIONS,
    STANDING,
    UNIVERSAL,
)
from fleet.errors import NotUnderstood


class Nouns(Heads):
    """Reads noun phrases from a cursor, and remembers whom was spoken of."""

    def __init__(self, cursor: Cursor) -> None:
        super().__init__(cursor)
        self._spoken_of: list[Mention] = []

    def spoken(self, mention: Mention) -> None:
        """Remember it for "the other cup"."""
        self._spoken_of.append(mention)

    def starts(self, sorts: Sequence[Sort]) -> bool:
        """Whether a noun phrase of one of these sorts comes next; nothing is gone past."""
        start = self.cursor.at
        try:
            self.noun("", sorts)
        except NotUnderstood:
            return False
        finally:
            self.cursor.at = start
        return True

    def noun(self, what: str, sorts: Sequence[Sort]) -> Noun:
        """The noun phrase that comes next.

        Raises:
            NotUnderstood: nothing known of these sorts comes next; the message lists what is.
        """
        cursor, start = self.cursor, self.cursor.at
        if "object" in sorts and not self.named(sorts)[1]:
            for phrases, quantity in ((EVERYTHING, Quantity.ALL), (ANYTHING, Quantity.ANY)):
                if cursor.take_of(phrases):
                    found = [e for e in cursor.lexicon.entities if e.sort == "object"]
                    if not found:
                        cursor.at = start
                        raise cursor.unknown(what, sorts)
                    return self.made(tuple(found), start, quantity=quantity, generic=True)
        said = self._determiner(sorts)
        other = bool(not self.named(sorts)[1] and cursor.take("other"))
        if other and said.count is None:
            said = replace(said, count=self._count(sorts))
        ordinal = None if other else self._ordinal(sorts)
        if ordinal is not None and said.count is not None:
            raise self.unknown(start, what, sorts)  # "the two first cup"
        count = self._count(sorts) if ordinal is not None else said.count
        bare = (other or ordinal is not None) and self._nothing_follows()
        kin = tuple(e for e in self.kind if e.sort in sorts) if bare else ()
        noun = self.made(kin, start) if kin else self.head(start, what, sorts)
        noun = replace(
            noun,
            quantity=noun.quantity if noun.quantity is Quantity.ALL else said.quantity,
            count=count,
            ordinal=ordinal,
            plural=noun.plural and not said.exact,
            text=cursor.said(start),
            key=start,
        )
        return self._others(noun) if other else noun

    def _nothing_follows(self) -> bool:
        word = self.cursor.word()
        return not word or not word[0].isalnum() or word in PREPOSITIONS | STANDING | {"and"}

    def _determiner(self, sorts: Sequence[Sort]) -> Noun:
        """Quantity and count that the words before a noun say; `exact` for "one of"."""
        cursor, quantity, count, one = self.cursor, Quantity.BARE, None, False
        if self.named(sorts)[1]:
            return Noun((), "", 0)
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
        number = self._count(sorts)
        if number is not None:
            count = number if count in (None, number) else -1
            if number == 1 and quantity in (Quantity.BARE, Quantity.ANY):
                quantity, count = Quantity.ANY, None
            if cursor.take("of"):
                cursor.take_word(DEFINITE)
                one = True
        return Noun((), "", 0, quantity, exact=one, count=count)

    def _count(self, sorts: Sequence[Sort]) -> int | None:
        number = number_of(self.cursor.word())
        if number is None or self.named(sorts)[1] or self.is_pronoun_one():
            return None
        self.cursor.at += 1
        return number

    def _ordinal(self, sorts: Sequence[Sort]) -> int | None:
        if self.named(sorts)[1]:
            return None
        if self.cursor.take_word(LAST):
            return 0
        ordinal = ordinal_of(self.cursor.word())
        self.cursor.at += ordinal is not None
        return ordinal

    def _others(self, noun: Noun) -> Noun:
        """Those of the kind that were not spoken of yet."""
        known = set(noun.names)
        gone = [m for m in self._spoken_of if known & set(m.subjects)]
        left = noun.among(known - {s for m in gone for s in m.subjects})
        if not gone or any(m.open for m in gone) or not left.found:
            raise NotUnderstood(
                f"{noun.text!r} could be {' or '.join(noun.names)}: call it by its name"
            )
        return left
