"""Reads noun phrases: "the second cup", "all cups", "one of the robots", "cups 1 and 2"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fleet.core.language.cursor import Cursor
from fleet.core.language.lexicon import CATEGORIES, Entity, Sort
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

_NUMBER_SIGNS = frozenset({"number", "no", "nr", "#"})
_LAST = frozenset({"last", "final"})


class Nouns:
    """Reads noun phrases from a cursor, and remembers whom was spoken of."""

    def __init__(self, cursor: Cursor) -> None:
        self.cursor = cursor
        self._kind: tuple[Entity, ...] = ()  # whom "one" may mean in "the second one"
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
        if "object" in sorts and not self._named(sorts)[1]:
            for phrases, quantity in ((EVERYTHING, Quantity.ALL), (ANYTHING, Quantity.ANY)):
                if cursor.take_of(phrases):
                    found = [e for e in cursor.lexicon.entities if e.sort == "object"]
                    if not found:
                        cursor.at = start
                        raise cursor.unknown(what, sorts)
                    return self._made(tuple(found), start, quantity=quantity, generic=True)
        said = self._determiner(sorts)
        other = bool(not self._named(sorts)[1] and cursor.take("other"))
        if other and said.count is None:
            said = replace(said, count=self._count(sorts))
        ordinal = None if other else self._ordinal(sorts)
        if ordinal is not None and said.count is not None:
            raise self._unknown(start, what, sorts)  # "the two first cup"
        count = self._count(sorts) if ordinal is not None else said.count
        bare = (other or ordinal is not None) and self._nothing_follows()
        kin = tuple(e for e in self._kind if e.sort in sorts) if bare else ()
        noun = self._made(kin, start) if kin else self._head(start, what, sorts)
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

    def _made(
        self,
        found: tuple[Entity, ...],
        start: int,
        *,
        quantity: Quantity = Quantity.BARE,
        plural: bool = False,
        exact: bool = False,
        generic: bool = False,
    ) -> Noun:
        text = self.cursor.said(start)
        return Noun(tuple(found), text, start, quantity, plural, exact, generic)

    def _named(self, sorts: Sequence[Sort]) -> tuple[int, tuple[Entity, ...]]:
        """The whole name that comes next; a kind that has several members is none."""
        cursor = self.cursor
        end, found = cursor.lexicon.exact(cursor.tokens, cursor.at, sorts)
        if len(found) > 1:
            raw = cursor.said(cursor.at, end).casefold()
            found = tuple(e for e in found if e.id.casefold() == raw) or found
        name = tuple(token.word for token in cursor.tokens[cursor.at : end])
        if found and cursor.lexicon.is_several(name, sorts):
            raw = cursor.said(cursor.at, end).casefold()
            found = tuple(e for e in found if e.id.casefold() == raw)
        return (end, found) if found else (cursor.at, ())

    def _determiner(self, sorts: Sequence[Sort]) -> Noun:
        """Quantity and count that the words before a noun say; `exact` for "one of"."""
        cursor, quantity, count, one = self.cursor, Quantity.BARE, None, False
        if self._named(sorts)[1]:
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
        if number is None or self._named(sorts)[1] or self._is_pronoun_one():
            return None
        self.cursor.at += 1
        return number

    def _ordinal(self, sorts: Sequence[Sort]) -> int | None:
        if self._named(sorts)[1]:
            return None
        if self.cursor.take_word(_LAST):
            return 0
        ordinal = ordinal_of(self.cursor.word())
        self.cursor.at += ordinal is not None
        return ordinal

    def _is_pronoun_one(self) -> bool:
        """Whether "one" or "ones" stands for the kind that was spoken of last."""
        cursor = self.cursor
        if cursor.ended or not self._kind:
            return False
        spoken = cursor.tokens[cursor.at].spoken
        behind = cursor.tokens[cursor.at - 1].word if cursor.at else ""
        determined = (
            behind in DEFINITE | {"other", "each", "every"}
            or ordinal_of(behind) is not None
            or behind in _LAST
        )
        return spoken == "ones" or (spoken == "one" and determined and cursor.word(1) != "of")

    def _head(self, start: int, what: str, sorts: Sequence[Sort]) -> Noun:
        cursor = self.cursor
        name_end, named = self._named(sorts)
        if self._is_pronoun_one() and not named:
            plural = cursor.tokens[cursor.at].spoken == "ones"
            found = tuple(e for e in self._kind if e.sort in sorts)
            cursor.at += 1
            if found:
                return self._made(found, start, plural=plural)
        described = self._described(start, sorts)
        if described is not None and cursor.at > name_end:
            return described
        if not named:
            cursor.at = start if described is None else cursor.at
            raise self._unknown(start, what, sorts)
        cursor.at = name_end
        self._remember_kind(named[0], sorts)
        return self._made(named, start, exact=True)

    def _described(self, start: int, sorts: Sequence[Sort]) -> Noun | None:
        """A run of words that occur in names and kinds, perhaps with numbers behind it."""
        cursor, begin = self.cursor, self.cursor.at
        end, found = cursor.lexicon.described(cursor.tokens, begin, sorts)
        if not found:
            return None
        plural, generic = False, False
        kind = cursor.lexicon.kind(cursor.tokens, begin, end, sorts)
        if kind is not None and (of_kind := tuple(e for e in found if e in kind[1])):
            plural, found = kind[0], of_kind
            generic = end - begin == 1 and len(found) == len(kind[1]) and self._is_category(begin)
        cursor.at = end
        self._remember_kind(found[0], sorts)
        one = not cursor.ended and cursor.tokens[cursor.at].spoken in ("one", "ones")
        if kind is None and one:
            plural = cursor.tokens[cursor.at].spoken == "ones"
            cursor.at += 1
            return self._made(found, start, plural=plural)
        numbers = self._numbers()
        if not numbers:
            return self._made(found, start, plural=plural, generic=generic)
        chosen = tuple(e for number in numbers for e in self._numbered(found, number, start))
        quantity = Quantity.ALL if len(numbers) > 1 else Quantity.BARE
        return self._made(chosen, start, quantity=quantity, exact=True)

    def _is_category(self, at: int) -> bool:
        word = self.cursor.tokens[at].word
        return any(word in (c, f"{c}s") for names in CATEGORIES.values() for c in names)

    def _numbers(self) -> list[int]:
        """The numbers behind a kind: `2`, `number 2`, `1, 2 and 3`."""
        cursor = self.cursor
        found: list[int] = []
        while True:
            before = cursor.at
            if found and not (cursor.take(",", "and") or cursor.take(",") or cursor.take("and")):
                break
            if cursor.take_word(_NUMBER_SIGNS):
                cursor.take(".")
            number = number_of(cursor.word())
            counts = found and cursor.lexicon.starts_name(cursor.tokens, cursor.at + 1)
            if number is None or counts or (found and cursor.word(1) == "of"):
                cursor.at = before
                break
            cursor.at += 1
            found.append(number)
        return found

    def _numbered(self, found: tuple[Entity, ...], number: int, start: int) -> tuple[Entity, ...]:
        chosen = tuple(e for e in found if e.ordinal == number) or tuple(
            e for e in found if any(str(number) in name for name in e.names)
        )
        if not chosen:
            known = ", ".join(dict.fromkeys(e.stands_for for e in found))
            raise NotUnderstood(
                f"{self.cursor.said(start)!r}: there is no number {number}; known are {known}"
            )
        return chosen

    def _remember_kind(self, entity: Entity, sorts: Sequence[Sort]) -> None:
        if entity.sort in ("object", "robot"):
            self._kind = self.cursor.lexicon.kin(entity)

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

    def _unknown(self, start: int, what: str, sorts: Sequence[Sort]) -> NotUnderstood:
        self.cursor.at = start
        return self.cursor.unknown(what, sorts)
