"""Pronouns: whom "it", "them", "him" and "me" mean."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import one_of
from fleet.language.resolve.reference.mentions import Mention, NounPhrase, Subject, WhichOne
from fleet.language.resolve.scene import Scene
from fleet.language.tagging.lexicon import EntityType
from fleet.language.tree.nodes import (
    Noun,
    Quantity,
)
from fleet.language.words.folding import folded
from keyexpr_schema.payloads.world import Feature

_PLURAL = frozenset({"them", "they", "these", "those", "both", "all", "each"})
SAME = "the same"
"""What several verbs have in common, that say it once: for all but one of them."""
PERSONAL = frozenset({"him", "her", "he", "she"})


class Pronouns:
    """Finds out whom pronouns mean."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    def speaker(self, noun: Noun, as_type: EntityType = "surface") -> NounPhrase:
        """Who says "me".

        Raises:
            NotUnderstood: nobody knows.
        """
        text = self.scene.said.quote(noun.first, noun.last)
        found = tuple(
            e
            for e in self.scene.lexicon.entities
            if e.type == as_type and e.id == self.scene.vocabulary.speaker
        )
        if not found:
            raise NotUnderstood(
                f"{text!r} names somebody whose place is not known; name a place or a robot"
            )
        return NounPhrase(found, text, noun.first, exact=True)

    def _vessel(self, meant: Sequence[Mention]) -> str | None:
        """What can be moved, and something was put in or on it just now: "it" may be either."""
        carrier = self.scene.said.carrier
        thing = self.scene.vocabulary.objects.get(carrier or "")
        if thing is None or len(meant) != 1:
            return None
        last = self.scene.said.draft.last
        just = last is not None and last.value == carrier
        movable = thing.is_a(Feature.MOVABLE) and thing.object not in meant[0].subjects
        return thing.object if just and movable else None

    def _pair(self, mention: Mention) -> bool:
        """Whether it is one thing that is called by a plural: "the curtains … them"."""
        thing = self.scene.vocabulary.objects.get(mention.subjects[0])
        labelled = thing is not None and folded(thing.label).endswith("s")
        return mention.single and (mention.plural or labelled)

    def _people(self, mention: Mention) -> bool:
        return all(self.scene.vocabulary.is_person(name) for name in mention.subjects)

    def that_can(self, noun: Noun, able: Collection[str]) -> Mention | None:
        """Whom "it" means, of those that something can be done to; `None`: of none of them.

        Raises:
            WhichOne: what was spoken of and what it was put in or on could both be meant.
        """
        said = self.scene.said
        if noun.words != ("it",) or noun.first in said.chosen or any(m.open for m in said.recent):
            return None
        names = [m.subjects[0] for m in said.recent if len(m.subjects) == 1]
        last = said.draft.last
        if said.carrier is not None and last is not None and last.value == said.carrier:
            names.append(said.carrier)
        fit = tuple(dict.fromkeys(name for name in names if name in able))
        if len(fit) > 1:
            text = said.quote(noun.first, noun.last)
            sentence = f"{text!r} could be {one_of(fit)}: name what you mean"
            raise WhichOne(sentence, noun.first, fit)
        return Mention(fit, "object", noun.first) if fit else None

    def pronoun(self, noun: Noun, types: Sequence[EntityType]) -> Mention:
        """Whom a pronoun means.

        Raises:
            NotUnderstood: nobody was spoken of, or it could be several.
        """
        word = noun.words[0]
        said = self.scene.said
        if word in PERSONAL and said.person is not None:
            return Mention((said.person,), "object", noun.first)
        if (chosen := said.chosen.get(noun.first)) is not None:
            types_of = [m.type for m in said.recent if set(chosen) & set(m.subjects)]
            of_type: EntityType = types_of[0] if types_of else "object"
            return Mention(chosen, of_type, noun.first)
        if word == SAME:
            return self._same(noun, types)
        if "object" not in types and "place" in types and word == "them" and said.rooms[1:]:
            return Mention(said.rooms, "place", noun.first)
        if "object" not in types and "place" in types and word == "it" and said.last_place:
            return Mention((said.last_place,), "place", noun.first)
        plural = word in _PLURAL or len(noun.words) > 1
        meant = [
            m for m in said.recent if m.single != plural or m.each or (plural and self._pair(m))
        ]
        if word in PERSONAL:  # a person or a robot, and no thing that was named before
            meant = [m for m in meant if m.type == "robot" or self._people(m)]
        count = 2 if word == "both" else int(word) if word.isdecimal() else None
        if word == "it" and not meant and (vessel := self._vessel(said.recent)) is not None:
            return Mention((vessel,), "object", noun.first)  # "the apples in the bowl … it"
        if word == "it" and (vessel := self._vessel(meant)) is not None:
            text = self.scene.said.quote(noun.first, noun.last)
            either_of = (*meant[0].subjects, vessel)
            sentence = f"{text!r} could be {one_of(either_of)}: name what you mean"
            raise WhichOne(sentence, noun.first, either_of)
        if len(meant) == 1 and count in (None, len(meant[0].subjects)):
            return meant[0]
        if len(meant) == 1 and count and count < len(meant[0].subjects) and not meant[0].open:
            return replace(meant[0], key=noun.first, open=True, least=count)  # "one of them"
        single = [m for m in said.recent if m.single and not m.open and m.type == "object"]
        if plural and not meant and len(single) == 1 and (beneath := self._vessel(single)):
            return Mention((*single[0].subjects, beneath), "object", noun.first)
        could_be = meant if word in PERSONAL else said.recent
        names = sorted({s for m in could_be for s in m.subjects})
        reason = f"could be {one_of(names)}" if names else "refers to nothing before it"
        text = self.scene.said.quote(noun.first, noun.last)
        sentence = f"{text!r} {reason}: name what you mean"
        one_of_them = len(meant) > 1 or (word == "it" and len(names) > 1)
        raise WhichOne(sentence, noun.first, tuple(names) if one_of_them else ())

    def _same(self, noun: Noun, types: Sequence[EntityType]) -> Mention:
        """What the verb before was said of: "wash and fold the shirt".

        Raises:
            NotUnderstood: it was said of nothing.
        """
        said = self.scene.said
        if "object" not in types and "place" in types and said.rooms:
            return Mention(said.rooms, "place", noun.first)
        if len(said.recent) == 1:
            return said.recent[0]
        names = tuple(dict.fromkeys(name for m in said.recent for name in m.subjects))
        if not names or any(m.open for m in said.recent):
            raise NotUnderstood(f"{said.clause!r} does not say what shall be done with it")
        return Mention(names, said.recent[0].type, noun.first)


def either(first: Subject, second: Subject) -> NounPhrase:
    """Any of what the two mean: "cup 1 or cup 2".

    Raises:
        NotUnderstood: one of them leaves open whom it means, or is no name.
    """
    if not isinstance(first, NounPhrase) or not isinstance(second, NounPhrase):
        raise NotUnderstood('"or" is understood between names only: name both')
    if first.type != second.type or not (first.resolve().single and second.resolve().single):
        raise NotUnderstood(f"{first.text!r} or {second.text!r} leaves too much open")
    both = (
        first.among(first.resolve().subjects).found + second.among(second.resolve().subjects).found
    )
    return NounPhrase(both, f"{first.text} or {second.text}", first.key, Quantity.ANY)
