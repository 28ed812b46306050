"""Whose things are: "Anna's mug", "my mug", "bring Lily her teddy"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

from fleet.errors import NotUnderstood
from fleet.language.resolve.reference.mentions import NounPhrase, Subject
from fleet.language.resolve.reference.parts import Parts
from fleet.language.resolve.reference.referents import Referents
from fleet.language.resolve.scene import Scene
from fleet.language.tagging.lexicon import Entity, EntityType
from fleet.language.tree.nodes import Noun, Nouns
from fleet.language.words.tokens import words_of


class NounMeanings(Protocol):
    """Whoever knows whom noun phrases mean."""

    def subject(self, noun: Noun, types: Sequence[EntityType], what: str) -> Subject:
        """Whom one noun phrase means."""

    def can_be(self, nouns: Nouns, types: Sequence[EntityType]) -> bool:
        """Whether all of them can be of one of these types."""


class Owners:
    """Tells things apart by whose they are."""

    def __init__(self, scene: Scene, who: Referents, nouns: NounMeanings) -> None:
        self.scene, self.who, self.nouns = scene, who, nouns
        self.parts = Parts(scene)

    def owned(self, noun: Noun, made: NounPhrase) -> NounPhrase:
        """Those of an owner: of "Anna's mug" only those; of "my mug" those, if there are any."""
        said = self.scene.said
        owner: str | None = None
        if noun.whose is not None:
            types: tuple[EntityType, ...] = ("object", "robot")
            if not self.nouns.can_be(Nouns((noun.whose,)), types):
                types = ("object", "robot", "place")
            subject = self.nouns.subject(noun.whose, types, "a person")
            owner = self.who.resolve(subject).subjects[0]
            said.spoken_of((owner,))
        elif noun.determiner in ("my", "our"):
            owner = self.scene.vocabulary.speaker
        elif noun.determiner in ("his", "her", "their"):
            owner = said.person
            if owner is None:
                raise NotUnderstood(f"{noun.determiner!r} refers to nobody before it: name whose")
            made = self._place_of(owner, made) if owner is not None else made
        things = self.scene.vocabulary.objects
        owned = [
            n for n in made.names if n in things and things[n].properties.get("owner") == owner
        ]
        if owner is not None and owned:
            return replace(made.among(owned), exact=made.exact and len(owned) == 1)
        if noun.whose is not None and (inside := made.among(self.parts.belonging(owner))).found:
            return inside
        others = {things[n].properties.get("owner") for n in made.names if n in things}
        if noun.whose is not None or (owner is not None and others and None not in others):
            raise NotUnderstood(f"{made.text!r}: nothing of that kind is known to be {owner}'s")
        return made

    def _place_of(self, owner: str, made: NounPhrase) -> NounPhrase:
        """`her office`, of a place that is called "Carla's office"."""
        names = [words_of(self.scene.vocabulary.objects[owner].label), words_of(owner)]
        called = [
            e.stands_for
            for e in made.found
            if e.type == "place"
            and any(name[: len(own) + 1] == (*own, "'s") for name in e.names for own in names)
        ]
        return made.among(called) if called else made

    def remember(self, named: Sequence[Entity], words: tuple[str, ...]) -> None:
        """Of "Mr Jones's lunch", Mr Jones is whom "him" means."""
        thing = self.scene.vocabulary.objects.get(named[0].id)
        owner = thing.properties.get("owner") if thing is not None and "'s" in words else None
        if len(named) == 1 and isinstance(owner, str):
            self.scene.said.spoken_of((owner,))
