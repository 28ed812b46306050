"""Things of which the parts can be what they cannot be: a cabinet is closed drawer by drawer."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import one_of
from fleet.language.resolve.reference.mentions import Mention, WhichOne
from fleet.language.resolve.scene import Scene
from fleet.language.tagging.tagger import Lexeme
from keyexpr_schema.facts import Value


class Parts:
    """Finds the parts that are meant where a whole is named."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    def able(self, able: Collection[str]) -> Mapping[str, tuple[str, ...]]:
        """The things that are not able, with those of their parts that are."""
        found = {
            whole: tuple(part for part in parts if part in able)
            for whole, parts in self.scene.vocabulary.parts.items()
            if whole not in able
        }
        return {whole: parts for whole, parts in found.items() if parts}

    def belonging(self, whole: str | None) -> list[str]:
        """The fixed parts of a thing; of a place, what stands there: "the kitchen's windows"."""
        vocabulary = self.scene.vocabulary
        if whole in vocabulary.places:
            fixed = [n for n in vocabulary.objects if n not in vocabulary.movable]
            return [n for n in fixed if vocabulary.place_of(n) == whole]
        return list(vocabulary.parts.get(whole or "", ()))

    def meant(
        self, mention: Mention, able: Collection[str], wants: Sequence[tuple[str, Value]]
    ) -> Mention:
        """Those that are able, with the parts of a whole in its place.

        A thing is closed when all its parts are; where it shall be open, one part will do, and of
        several it is asked which. What must never be so, must be so of no part.

        Raises:
            WhichOne: one of several parts may be meant.
        """
        wholes = self.able(able)
        if not set(mention.subjects) & set(wholes):
            return mention
        every = self.scene.said.draft.never or all(value is False for _, value in wants)
        found = dict[str, None]()
        for name in mention.subjects:
            parts = wholes.get(name, (name,))
            if len(parts) > 1 and (mention.open or not every):
                parts = self._chosen(mention, name, parts)
            found |= dict.fromkeys(parts)
        alone = len(found) == 1 and set(found) & set(self.scene.vocabulary.good_for)
        named = mention.subjects[0] if len(mention.subjects) == 1 and not alone else None
        return replace(mention, subjects=tuple(found), surfaces=(), whole=named)

    def stated(self, mention: Mention, word: Lexeme, negated: bool = False) -> Mention:
        """Those of whom a word for a state can be said."""
        able = self.scene.stated.able(word)
        wants = self.scene.stated.wants(word, min(able), negated) if able else ()
        return self.meant(mention, able, wants)

    def _chosen(self, mention: Mention, whole: str, parts: tuple[str, ...]) -> tuple[str, ...]:
        key = -1 - mention.key
        chosen = self.scene.said.chosen.get(key)
        if chosen is not None and set(chosen) <= set(parts):
            return chosen
        sentence = f"{whole!r} has parts: it could be {one_of(parts)}: say which"
        if len(mention.subjects) > 1:
            raise NotUnderstood(sentence)
        raise WhichOne(sentence, key, parts, (*((part,) for part in parts), parts))
