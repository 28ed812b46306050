"""The heads of noun phrases: names, kinds, words that occur in names, and numbers behind them."""

from __future__ import annotations

from collections.abc import Sequence

from fleet.errors import NotUnderstood
from fleet.language.phrases.cursor import Cursor
from fleet.language.phrases.mentions import NounPhrase, Quantity
from fleet.language.words.lexicon import CATEGORIES, ENTITY_TYPES, Entity, EntityType
from fleet.language.words.tokens import number_of, ordinal_of
from fleet.language.words.wordlists import DEFINITE

_NUMBER_SIGNS = frozenset({"number", "no", "nr", "#"})
LAST = frozenset({"last", "final"})


class Heads:
    """Reads the heads of noun phrases from a cursor."""

    def __init__(self, cursor: Cursor) -> None:
        self.cursor = cursor
        self._kind_of: Entity | None = None

    def noun_phrase(
        self,
        found: tuple[Entity, ...],
        start: int,
        *,
        quantity: Quantity = Quantity.BARE,
        plural: bool = False,
        exact: bool = False,
        generic: bool = False,
    ) -> NounPhrase:
        """A noun phrase that began at token `start` and ends here."""
        text = self.cursor.quote(start)
        return NounPhrase(tuple(found), text, start, quantity, plural, exact, generic)

    def named(self, types: Sequence[EntityType]) -> tuple[int, tuple[Entity, ...]]:
        """The whole name that comes next; a kind that has several members is none."""
        cursor = self.cursor
        end, found = cursor.lexicon.exact(cursor.tokens, cursor.at, types)
        if len(found) > 1:
            raw = cursor.quote(cursor.at, end).casefold()
            found = tuple(e for e in found if e.id.casefold() == raw) or found
        name = tuple(token.word for token in cursor.tokens[cursor.at : end])
        if found and cursor.lexicon.is_several(name, types):
            raw = cursor.quote(cursor.at, end).casefold()
            found = tuple(e for e in found if e.id.casefold() == raw)
        return (end, found) if found else (cursor.at, ())

    def is_pronoun_one(self) -> bool:
        """Whether "one" or "ones" stands for the kind that was spoken of last."""
        cursor = self.cursor
        if cursor.ended or self._kind_of is None:
            return False
        spoken = cursor.tokens[cursor.at].spoken
        behind = cursor.tokens[cursor.at - 1].word if cursor.at else ""
        determined = (
            behind in DEFINITE | {"other", "each", "every"}
            or ordinal_of(behind) is not None
            or behind in LAST
        )
        return spoken == "ones" or (spoken == "one" and determined and cursor.word(1) != "of")

    def head(self, start: int, what: str, types: Sequence[EntityType]) -> NounPhrase:
        """The noun itself, past determiner and ordinal.

        Raises:
            NotUnderstood: nothing known of these types comes next.
        """
        cursor = self.cursor
        name_end, named = self.named(types)
        if self.is_pronoun_one() and not named:
            plural = cursor.tokens[cursor.at].spoken == "ones"
            found = tuple(e for e in self.kind if e.type in types)
            cursor.at += 1
            if found:
                return self.noun_phrase(found, start, plural=plural)
        described = self._described(start, types)
        if described is not None and cursor.at > name_end:
            return described
        if not named:
            cursor.at = start if described is None else cursor.at
            raise self.unknown(start, what, types)
        cursor.at = name_end
        self._remember_kind(named[0])
        return self.noun_phrase(named, start, exact=True)

    def _described(self, start: int, types: Sequence[EntityType]) -> NounPhrase | None:
        """A run of words that occur in names and kinds, perhaps with numbers behind it."""
        cursor, begin = self.cursor, self.cursor.at
        end, found = cursor.lexicon.described(cursor.tokens, begin, types)
        name_end, named = cursor.lexicon.exact(cursor.tokens, begin, ENTITY_TYPES)
        # "The kitchen" is the place of that name, and no table that is called by it, too.
        other = named and name_end >= end and all(e.type not in types for e in named)
        if not found or (other and all(e.type == "place" for e in named)):
            return None
        plural, generic = False, False
        kind = cursor.lexicon.kind(cursor.tokens, begin, end, types)
        if kind is not None and (of_kind := tuple(e for e in found if e in kind[1])):
            plural, found = kind[0], of_kind
            generic = end - begin == 1 and len(found) == len(kind[1]) and self._is_category(begin)
        cursor.at = end
        found = self._of_what(found)
        self._remember_kind(found[0])
        one = not cursor.ended and cursor.tokens[cursor.at].spoken in ("one", "ones")
        if kind is None and one:
            plural = cursor.tokens[cursor.at].spoken == "ones"
            cursor.at += 1
            return self.noun_phrase(found, start, plural=plural)
        numbers = self._numbers()
        if not numbers:
            return self.noun_phrase(found, start, plural=plural, generic=generic)
        chosen = tuple(e for number in numbers for e in self._numbered(found, number, start))
        quantity = Quantity.ALL if len(numbers) > 1 else Quantity.BARE
        return self.noun_phrase(chosen, start, quantity=quantity, exact=True)

    def _of_what(self, found: tuple[Entity, ...]) -> tuple[Entity, ...]:
        """Those with a name that has the words of `of …` in it: "bottle of water"."""
        cursor, start = self.cursor, self.cursor.at
        if cursor.take("of"):
            end, named = cursor.lexicon.described(cursor.tokens, cursor.at, ("object",))
            narrower = tuple(e for e in found if e in named)
            if narrower:
                cursor.at = end
                return narrower
        cursor.at = start
        return found

    def _is_category(self, at: int) -> bool:
        word = self.cursor.tokens[at].word
        return any(word in (c, f"{c}s") for names in CATEGORIES.values() for c in names)

    def _numbers(self) -> list[int]:
        """The numbers behind a kind: `2`, `number 2`, `1, 2 and 3`."""
        cursor = self.cursor
        found: list[int] = []
        while True:
            before = cursor.at
            if found and not cursor.take_joint():
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
                f"{self.cursor.quote(start)!r}: there is no number {number}; known are {known}"
            )
        return chosen

    @property
    def kind(self) -> tuple[Entity, ...]:
        """Whom "one" may mean in "the second one"."""
        return () if self._kind_of is None else self.cursor.lexicon.kin(self._kind_of)

    def _remember_kind(self, entity: Entity) -> None:
        if entity.type in ("object", "robot"):
            self._kind_of = entity

    def unknown(self, start: int, what: str, types: Sequence[EntityType]) -> NotUnderstood:
        """The phrase that began at token `start` names nothing known."""
        self.cursor.at = start
        return self.cursor.unknown(what, types)
