"""What the items of a list of noun phrases say of each other: "the red and the green mug"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.resolve.discourse import Discourse
from fleet.language.resolve.frames import Frame
from fleet.language.resolve.reference.mentions import NounPhrase, Subject
from fleet.language.tagging.lexicon import Entity, EntityType, Lexicon
from fleet.language.tree.nodes import Noun, Nouns, Place, Quantity
from fleet.language.words.tokens import tokens_like


def shared_kind(
    lexicon: Lexicon,
    items: Sequence[Noun],
    types: Sequence[EntityType],
    spoken_of: tuple[Entity, ...],
) -> tuple[bool, tuple[Entity, ...]]:
    """Of what kind the first item is, if it is no noun, and whether that is plural: "the red" in
    "the red and green mugs"."""
    for noun in items[1:]:
        if noun.form == "one" and len(items) > 1:
            return noun.head[-1].spoken == "ones", spoken_of
        if noun.form == "noun" and noun.head:
            tokens = tokens_like(noun.head[-1].words)
            kind = lexicon.kind(tokens, 0, len(tokens), types)
            if kind is not None:
                return kind[0], tuple(sorted(kind[1], key=lambda e: e.rank))
    return False, ()


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
        counted = any(each.count is not None for each in nouns.items[:i])
        again = noun.form in ("one", "headless") and (counted or noun.quantity is Quantity.THE)
        before = {name for subject in found[:i] for name in subject.names}
        if again and not noun.other and set(found[i].names) <= before:
            text = said.quote(noun.first, noun.last)
            raise NotUnderstood(f"{text!r} were named before: say of each which ones are meant")


def at_each(nouns: Nouns) -> Nouns:
    """The same, with "the windows in the hall and in the study" as two items."""
    items: list[Noun] = []
    for noun in nouns.items:
        several = next((p for p in noun.places if _several(p)), None)
        if several is None or several.nouns is None or noun.quantity is Quantity.ANY:
            items.append(noun)
            continue
        for one in several.nouns.items:
            where = replace(several, nouns=Nouns((one,)))
            places = tuple(where if place is several else place for place in noun.places)
            items.append(replace(noun, places=places))
    return nouns if len(items) == len(nouns.items) else replace(nouns, items=tuple(items))


def with_sources(frame: Frame) -> Frame:
    """The frame with phrases of several places as part of what is said to be in them."""
    there = tuple(place for place in frame.places if _several(place))
    if not there or not frame.themes:
        return frame
    items = tuple(
        replace(noun, places=(*noun.places, *there)) if noun.form in ("noun", "general") else noun
        for noun in frame.themes[-1].items
    )
    if items == frame.themes[-1].items:
        return frame
    themes = (*frame.themes[:-1], replace(frame.themes[-1], items=items))
    return replace(frame, themes=themes, places=tuple(p for p in frame.places if p not in there))


def _several(place: Place) -> bool:
    nouns = place.nouns
    listed = nouns is not None and len(nouns.items) > 1 and not nouns.either
    return listed and place.role in ("in", "from")
