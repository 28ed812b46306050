"""Noun phrases as they were read, and who is meant by them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import listed, one_of
from fleet.language.tagging.lexicon import Entity, EntityType
from fleet.language.tree.nodes import Quantity

_MOST = 6
"""Of so many at most some may be left open: "two of the chairs"."""


class WhichOne(NotUnderstood):
    """A noun phrase could be one of several; `key` is the token at which it begins.

    `choices` are those who can be meant by it: one, or several together.
    """

    def __init__(
        self,
        sentence: str,
        key: int,
        names: tuple[str, ...],
        choices: tuple[tuple[str, ...], ...] = (),
    ) -> None:
        super().__init__(sentence)
        self.key, self.choices = key, choices or tuple((name,) for name in names)


class TooOpen(NotUnderstood):
    """So much is left open that not all that it can mean is tried."""


@dataclass(frozen=True)
class Mention:
    """Who is meant: all of `subjects`, or with `open` any one of them.

    `key` tells one mention from another: two that say "a cup" may mean different cups.
    `selective`: other words would narrow it down, as in "all cups" but not in "the first cup".
    `surfaces` are those by which places were named.
    """

    subjects: tuple[str, ...]
    type: EntityType
    key: int
    open: bool = False
    selective: bool = False
    surfaces: tuple[str, ...] = ()
    least: int = 1
    """Of an open one, how many of them."""
    each: bool = False
    """Whether it is each of several: "it" may mean them after "every cup"."""
    plural: bool = False
    """Whether one is called by a plural: "them" may mean it after "the dirty plates"."""
    whole: str | None = None
    """The thing that was named, where its parts are meant: "it" means it from then on."""

    @property
    def names(self) -> tuple[str, ...]:
        """Everybody who is meant, or could be: as of a noun phrase that is not resolved yet."""
        return self.subjects

    @property
    def single(self) -> bool:
        """Whether just one is meant, known or open."""
        return (self.open and self.least == 1) or len(self.subjects) == 1


@dataclass(frozen=True)
class NounPhrase:
    """A noun phrase before it is resolved to those meant; `ordinal` 0 is the last one.

    `exact`: the words name each of `found`. `generic`: the words say no more than "thing".
    `source`: its own words say where it is ("the cup that is on the table").
    """

    found: tuple[Entity, ...]
    text: str
    key: int
    quantity: Quantity = Quantity.BARE
    plural: bool = False
    exact: bool = False
    generic: bool = False
    mass: bool = False
    """Whether a word that is no plural says all of them: "the mail", and "it" after that."""
    count: int | None = None
    ordinal: int | None = None
    source: str | None = None
    source_surface: str | None = None
    wider: tuple[Entity, ...] = ()
    """Those who could be meant if the text had not spoken of `found` before."""

    @property
    def type(self) -> EntityType:
        """The type of those that could be meant."""
        return self.found[0].type

    @property
    def names(self) -> tuple[str, ...]:
        """Everybody who could be meant."""
        return tuple(dict.fromkeys(e.stands_for for e in self.found))

    @property
    def surfaces(self) -> tuple[str, ...]:
        """The surfaces that could be meant."""
        return tuple(e.id for e in self.found if e.type == "surface")

    def among(self, subjects: Collection[str]) -> NounPhrase:
        """The same phrase, said of some of those that it could be."""
        found, wider = (
            tuple(e for e in entities if e.stands_for in subjects)
            for entities in (self.found, self.wider)
        )
        return replace(self, found=found, wider=wider)

    def resolve(self) -> Mention:
        """Who is meant.

        Raises:
            NotUnderstood: it does not say which of several, or counts more than there are.
        """
        names, listing = self.names, listed(self.names)
        if len({e.type for e in self.found}) > 1 and self.exact:
            both = one_of(f"the {e.type} {e.id}" for e in self.found)
            raise NotUnderstood(f"{self.text!r} could be {both}: give one of them another name")
        if self.ordinal is not None:
            return Mention(self._by_ordinal(), self.type, self.key)
        if self.count is not None and self.count != len(names):
            verb = "is" if len(names) == 1 else "are"
            several = len(names) <= _MOST and self.quantity in (Quantity.BARE, Quantity.ANY)
            if 0 < self.count < len(names) and several:
                return Mention(
                    names, self.type, self.key, open=True, selective=True, least=self.count
                )
            reason = (
                f"say which {self.count}"
                if 0 < self.count < len(names)
                else f"there {verb} only {len(names)}"
            )
            raise NotUnderstood(f"{self.text!r}: {reason}; known are {listing}")
        if self.quantity is Quantity.ALL or self.count is not None:
            selective = len(names) > 1 and not self.exact and self.count is None
            each = self.count is None and (self.mass or not self.plural) and len(names) > 1
            one = self.plural and len(names) == 1
            return Mention(names, self.type, self.key, selective=selective, each=each, plural=one)
        if self.plural and self.quantity in (Quantity.ANY, Quantity.BARE):
            raise NotUnderstood(
                f"{self.text!r} does not say how many: say all of them or which ones; "
                f"known are {listing}"
            )
        if len(names) == 1:
            return Mention(names, self.type, self.key, plural=self.plural)
        if self.quantity is Quantity.ANY:
            return Mention(names, self.type, self.key, open=True, selective=True)
        if self.plural:
            return Mention(names, self.type, self.key, selective=True, each=self.mass)
        what = "place" if self.type == "surface" else self.type
        sentence = f"{self.text!r} could be {one_of(names)}: say which {what}"
        raise WhichOne(sentence, self.key, names)

    def _by_ordinal(self) -> tuple[str, ...]:
        ordered = sorted(self.found, key=lambda e: e.rank)
        chosen: list[Entity] = []
        if all(e.ordinal is not None for e in ordered):
            if self.count is None:
                wanted = self.ordinal or max(e.ordinal or 0 for e in ordered)
                chosen = [e for e in ordered if e.ordinal == wanted]
            elif len({e.ordinal for e in ordered}) < len(ordered):
                raise NotUnderstood(
                    f"{self.text!r} could be several of {listed(self.names)}: say which"
                )
            elif self.count <= len(ordered) and self.ordinal in (0, 1):
                chosen = ordered[: self.count] if self.ordinal else ordered[-self.count :]
        names = tuple(e.stands_for for e in chosen)
        if not names:
            raise NotUnderstood(f"there is no {self.text!r}; known are {listed(self.names)}")
        if len(names) > 1 and self.count is None:
            raise WhichOne(f"{self.text!r} could be {one_of(names)}: say which", self.key, names)
        return names


Subject = NounPhrase | Mention
"""Whom a clause is about: a noun phrase, or somebody who was settled before ("it")."""


def with_article(subject: Subject, before: Subject) -> Subject:
    """The same, with the article of the one before if it has none: "a mug or glass"."""
    if (
        isinstance(subject, NounPhrase)
        and isinstance(before, NounPhrase)
        and (subject.quantity, before.quantity) == (Quantity.BARE, Quantity.ANY)
        and not subject.plural
        and not before.plural
        and subject.count is None
        and before.count in (None, 1)
    ):
        return replace(subject, quantity=Quantity.ANY, count=before.count)
    return subject


def determined_as(subject: Subject, before: Subject) -> Subject:
    """The same, with the determiner of the one before if it has none: "all cups and books"."""
    if (
        isinstance(subject, NounPhrase)
        and isinstance(before, NounPhrase)
        and subject.plural
        and subject.quantity is Quantity.BARE
        and subject.count is None
        and before.quantity in (Quantity.ALL, Quantity.THE)
        and before.ordinal is None
    ):
        return replace(subject, quantity=before.quantity)
    return subject
