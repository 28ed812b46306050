"""What the items of a list of noun phrases say of each other: "the red and the green mug"."""

from __future__ import annotations

from collections.abc import Sequence

from fleet.errors import NotUnderstood
from fleet.language.resolve.discourse import Discourse
from fleet.language.resolve.mentions import NounPhrase, Subject
from fleet.language.tagging.lexicon import Entity, EntityType, Lexicon
from fleet.language.tree.nodes import Noun, Nouns, Quantity
from fleet.language.words.tokens import tokens_like


def shared_kind(
    lexicon: Lexicon, items: Sequence[Noun], types: Sequence[EntityType]
) -> tuple[Entity, ...]:
    """Of what kind the first item is, if it is no noun: "the red" in "the red and green mugs"."""
    for noun in items[1:]:
        if noun.form == "noun" and noun.head:
            tokens = tokens_like(noun.head[-1].words)
            kind = lexicon.kind(tokens, 0, len(tokens), types)
            return tuple(sorted(kind[1], key=lambda e: e.rank)) if kind is not None else ()
    return ()


def check_list(nouns: Nouns, found: Sequence[Subject], said: Discourse) -> None:
    """Whether each item says something of its own.

    Raises:
        NotUnderstood: "the biggest of the bowls and boxes", "the shirts, the blue ones".
    """
    for noun, one, following in zip(nouns.items, found, found[1:], strict=False):
        most = noun.part and any("SUP" in word.tags for word in noun.adjectives)
        bare = isinstance(following, NounPhrase) and following.quantity is Quantity.BARE
        if most and bare and isinstance(one, NounPhrase):
            raise NotUnderstood(f"{one.text!r} is said of one kind of things at a time")
    for i, noun in enumerate(nouns.items):
        again = noun.form in ("one", "headless") and noun.quantity is Quantity.THE
        before = {name for subject in found[:i] for name in subject.names}
        if again and not noun.other and set(found[i].names) <= before:
            text = said.quote(noun.first, noun.last)
            raise NotUnderstood(f"{text!r} were named before: say of each which ones are meant")
