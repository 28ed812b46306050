"""Noun phrases that name nothing known: which word of them is at fault, and what is known."""

from __future__ import annotations

from collections.abc import Sequence

from fleet.errors import NotUnderstood
from fleet.language.refusals import nearest, nothing_of_it, suggestion
from fleet.language.resolve.scene import Scene
from fleet.language.tagging.lexicon import Entity, EntityType
from fleet.language.tree.nodes import Noun
from fleet.language.words.folding import folded
from fleet.language.words.tokens import ORDINALS, words_of


def unknown_noun(
    scene: Scene,
    noun: Noun,
    types: Sequence[EntityType],
    what: str,
    near: Sequence[Entity] = (),
) -> NotUnderstood:
    """The phrase names nothing known of these types; `near` are called something like it."""
    strange = [word for word in noun.head if "UNK" in word.tags]
    end = strange[-1].last if strange else noun.last
    first = noun.first
    measured = [word for word in noun.of if "UNK" in word.tags]
    if measured or (noun.of and not strange):  # "a cup of tea"
        strange, first, end = measured, noun.of[0].first, noun.of[-1].last
    shown = scene.said.quote(first, end)
    names = scene.lexicon.names_in(types) | set(ORDINALS)
    single = [word.text for word in strange] or [word.text for word in noun.head]
    everyday = scene.tagger.book.everyday
    hint = ""
    for part in (shown, " ".join(words_of(shown)), *single) if strange else ():
        if folded(part) not in ORDINALS and not hint:
            hint = suggestion(part, names, everyday)
    if strange and not hint and strange != list(noun.head) and not measured:
        whole = scene.said.quote(noun.first, noun.last)
        of_kind = [e.id for e in scene.lexicon.meant(noun.head[-1].words)]
        return nothing_of_it(strange[0].text, whole, of_kind)
    called = [e.id for e in near] or scene.lexicon.known(types)
    known = nearest(called, " ".join(single))
    bare = what.removeprefix("a ").removeprefix("an ")
    return NotUnderstood(f"{shown!r} is not a known {bare}{hint}; known are {known}")
