"""Where "here", "there" and "where the shirt is" are."""

from __future__ import annotations

from fleet.errors import NotUnderstood
from fleet.language.refusals import one_of
from fleet.language.resolve.reference.mentions import NounPhrase, WhichOne
from fleet.language.resolve.reference.nouns import NounResolver
from fleet.language.resolve.reference.referents import Referents
from fleet.language.resolve.scene import THINGS, Scene
from fleet.language.tree.nodes import Nouns, Place
from keyexpr_schema.facts import AT, FactKey
from keyexpr_schema.payloads.world import Feature


class Deixis:
    """Finds the places that are pointed at, rather than named."""

    def __init__(self, scene: Scene, who: Referents, nouns: NounResolver) -> None:
        self.scene, self.who, self.nouns = scene, who, nouns

    def _in_there(self, place: Place, text: str) -> NounPhrase | None:
        """`put it in there`: into what was named last that others can be in."""
        said, good_for = self.scene.said, self.scene.vocabulary.good_for
        wanted = Feature.SUPPORTS if place.preposition in ("on", "onto") else Feature.CONTAINS
        fit = tuple(n for m in said.recent for n in m.subjects if wanted in good_for.get(n, ()))
        fit = said.chosen.get(place.first, fit)
        if len(fit) > 1:
            sentence = f"{text!r} could be {one_of(fit)}: name what you mean"
            raise WhichOne(sentence, place.first, fit)
        for names in reversed([*said.named, *((name,) for name in fit)]):
            if len(names) == 1 and names[0] in self.scene.vocabulary.places:
                return None
            if len(names) == 1 and wanted in self.scene.vocabulary.good_for.get(names[0], ()):
                entities = self.scene.lexicon.entities
                found = tuple(e for e in entities if e.id == names[0] and e.type == "surface")
                return NounPhrase(found, text, place.first, exact=True)
        return None

    def there(self, place: Place, text: str) -> NounPhrase:
        if place.preposition and (inside := self._in_there(place, text)) is not None:
            return inside
        last = self.scene.said.last_place or self._of_what_stays()
        if last is None:
            raise NotUnderstood('"there" refers to no place before it: name the place')
        entities = self.scene.lexicon.entities
        found = [e for e in entities if e.id == last and e.type != "object"]
        found = [e for e in found if e.type == "place"] or found
        return NounPhrase(tuple(found), text, place.first, exact=True)

    def _of_what_stays(self) -> str | None:
        """Where that is which was spoken of last, if it only can be there: "the window"."""
        vocabulary, recent = self.scene.vocabulary, self.scene.said.recent[-1:]
        names = {name for mention in recent for name in mention.subjects}
        into = names & vocabulary.good_for.keys()
        if not names or into or names & vocabulary.movable or any(m.open for m in recent):
            return None
        places = {vocabulary.place_of(name) for name in names}
        return places.pop() if len(places) == 1 else None

    def where_is(self, nouns: Nouns, text: str) -> NounPhrase:
        """`where the shirt is`: what that is believed to be on or in, or its place."""
        if len(nouns.items) != 1:
            raise NotUnderstood(f"{text!r} does not say one place: name it")
        mention = self.who.resolve(self.nouns.subject(nouns.items[0], THINGS, "an object"))
        name, vocabulary = mention.subjects[0], self.scene.vocabulary
        where = vocabulary.rests.get(name) or vocabulary.place_of(name)
        found = tuple(
            e
            for e in self.scene.lexicon.entities
            if e.id == where and e.type in ("place", "surface")
        )
        if mention.open or len(mention.subjects) != 1 or not found:
            raise NotUnderstood(f"{text!r}: it is not known where that is: name the place")
        return NounPhrase(found, text, nouns.items[0].first, exact=True)

    def here(self, text: str) -> NounPhrase:
        speaker = self.scene.vocabulary.speaker
        place = None if speaker is None else self.now_in(speaker)
        found = tuple(e for e in self.scene.lexicon.entities if e.type == "place" and e.id == place)
        if not found:
            raise NotUnderstood(
                f"{text!r} names somebody whose place is not known; name a place or a robot"
            )
        return NounPhrase(found, text, 0, exact=True)

    def now_in(self, name: str) -> str | None:
        """The place where somebody is, as was just said, or as is believed."""
        told = self.scene.said.facts.get(FactKey(AT, name))
        known = self.scene.vocabulary.place_of
        return known(told) if isinstance(told, str) else known(name)
