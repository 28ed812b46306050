"""Where things are or shall be: "in the kitchen", "on the table in the hallway"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import one_of
from fleet.language.resolve.frames import EXAMPLE
from fleet.language.resolve.location.deixis import Deixis
from fleet.language.resolve.location.relations import SPATIAL, Relations
from fleet.language.resolve.reference.mentions import Mention, NounPhrase, WhichOne
from fleet.language.resolve.reference.nouns import NounResolver
from fleet.language.resolve.reference.referents import Referents
from fleet.language.resolve.scene import PLACES, SPOTS, THINGS, Scene
from fleet.language.tagging.lexicon import EntityType
from fleet.language.tree.nodes import Noun, Nouns, Place, Quantity
from keyexpr_schema.facts import AT, IN, ON
from keyexpr_schema.payloads.world import Feature

_ON = frozenset({"on", "onto", "top"})
_IN = frozenset({"in", "into", "inside", "within"})
WHERE = frozenset({"to", "in", "from"})
"""Roles of phrases that say where something is or shall be."""


@dataclass(frozen=True)
class Locative:
    """One phrase of place: `to`, `in` or `from`, and what stands behind it."""

    role: str
    noun: NounPhrase
    words: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Where:
    """What the phrases of place of one clause say: places, things or robots, by id.

    `source_surface` and `target_surface` are the surfaces in those places, where one is named that
    is no thing. `relation` is what must hold of the target: `at`, `on` or `in` it.
    `each`: instead of one target, all of several ("to every room"); `text` are their words.
    """

    source: str | None = None
    target: str | None = None
    target_type: EntityType = "place"
    source_surface: str | None = None
    target_surface: str | None = None
    each: tuple[str, ...] = ()
    text: str = ""
    relation: str = AT
    for_speaker: bool = False
    """Whether it is for who speaks, if nothing says more: "get me a glass and put it there"."""
    guessed: str | None = None
    """The source, where no word says that it is one: "the book on the sofa on the shelf"."""


class PlaceResolver:
    """Finds out where phrases of place point."""

    def __init__(self, scene: Scene, who: Referents, nouns: NounResolver) -> None:
        self.scene = scene
        self.who = who
        self.nouns = nouns
        self.relations = Relations(scene, who, nouns)
        self.deixis = Deixis(scene, who, nouns)
        nouns.located = self.located

    def locative(self, place: Place) -> Locative:
        """What a phrase of place says.

        Raises:
            NotUnderstood: it is neither a place, nor a thing that others can be on or in, nor a
                person, a robot, or a robot's basket.
        """
        words = frozenset(place.preposition.split())
        text = self.scene.said.quote(place.first, place.last)
        if place.role not in WHERE:
            raise self.relations.unknown(place)
        if place.special == "there":
            return Locative(place.role, self.deixis.there(place, text), words)
        if place.special == "where" and place.nouns is not None:
            return Locative("to", self.deixis.where_is(place.nouns, text))
        if place.special == "here":
            return Locative(place.role, self.deixis.here(text))
        if place.special in ("anywhere", "house", "home") or place.nouns is None:
            raise NotUnderstood(f"{text!r} does not say one place: name it")
        if place.nouns.either:
            raise NotUnderstood("'or' leaves a choice that cannot be left open; say one of them")
        if len(place.nouns.items) > 1:
            last = place.nouns.items[-1]
            text = self.scene.said.quote(last.first, last.last)
            raise NotUnderstood(
                f"{text!r} is one place too many for one thing; "
                'if one is to come after the other, say "then"'
            )
        noun = place.nouns.items[0]
        return Locative(place.role, self.spot(noun), words)

    def spot(self, noun: Noun) -> NounPhrase:
        """The place, thing, person or robot that a noun phrase means as a place."""
        if noun.form == "basket":
            return self._basket(noun)
        if noun.form == "me":
            return self.nouns.pronouns.speaker(noun)
        if noun.form == "pronoun":
            return self._it(noun)
        if self.scene.vocabulary.good_for:
            self._refuse_thing(noun)
        return self.nouns.noun(noun, SPOTS, "a place")

    def _it(self, noun: Noun) -> NounPhrase:
        mention = self.nouns.pronouns.pronoun(noun, THINGS)
        text = self.scene.said.quote(noun.first, noun.last)
        entities = {e.id: e for e in self.scene.lexicon.entities if e.type in SPOTS}
        found = tuple(entities[name] for name in mention.subjects if name in entities)
        if mention.open and mention.key >= 0 and len(found) == len(mention.subjects):
            sentence = f"{text!r} could be {one_of(mention.subjects)}: say which"
            raise WhichOne(sentence, mention.key, mention.subjects)  # "a bowl with a spoon in it"
        if mention.open or len(found) != len(mention.subjects):
            raise NotUnderstood(f"{text!r} is no place: nothing can be put there; name the place")
        each = Quantity.ALL if noun.words[0] in ("each", "both") else Quantity.BARE
        return NounPhrase(found, text, noun.first, each, exact=True)

    def _refuse_thing(self, noun: Noun) -> None:
        """Say why nothing can be put on what is named, if it is a thing.

        Raises:
            NotUnderstood: it is.
        """
        try:
            self.nouns.noun(noun, SPOTS, "")
        except NotUnderstood:
            pass
        else:
            return
        try:
            thing = self.nouns.noun(noun, ("object",), "")
        except NotUnderstood:
            return
        meant = thing.names if thing.ordinal is None else thing.resolve().subjects
        raise NotUnderstood(f"{thing.text!r}: nothing can be put on or in {one_of(meant)}")

    def with_baskets(self) -> list[str]:
        return sorted(
            n for n, spec in self.scene.vocabulary.robots.items() if "basket" in spec.capabilities
        )

    def _basket(self, noun: Noun) -> NounPhrase:
        """`the basket`, `the locobot's basket`, `the basket of the robot`."""
        text, owners = self.scene.said.quote(noun.first, noun.last), self.with_baskets()
        if noun.owner is not None:
            owner = self.nouns.noun(noun.owner, ("robot",), "a robot")
            if owner.generic or owner.quantity is Quantity.ANY:
                owner = owner.among(owners)
            if not owner.found:
                raise NotUnderstood("no robot with a basket is known")
            return owner
        word = self.scene.said.tokens[noun.last - 1].word
        called = self.scene.tagger.entities((word,)) if word != "basket" else ()
        if any(e.type == "object" for e in called):
            raise NotUnderstood(f"{text!r} is a thing of its own")
        found = tuple(
            e for e in self.scene.lexicon.entities if e.type == "robot" and e.id in owners
        )
        if len(found) != 1:
            reason = f"could be that of {one_of(owners)}" if found else "is no robot's"
            raise NotUnderstood(f"{text!r} {reason}: say whose")
        return NounPhrase(found, text, noun.first, Quantity.THE, exact=True)

    def where(self, locatives: Sequence[Locative], fetching: bool = False) -> Where:
        """Source and target of a clause that moves something, or says where something is.

        What stands behind "to" is the target; without it, what stands behind the last "in". Other
        phrases narrow the target ("on the table in the kitchen") or name the source; after a
        `fetching` verb all "in" are where it is.

        Raises:
            NotUnderstood: a phrase could be several places, or the phrases do not go together.
        """
        shifted = False
        targets = [p for p in locatives if p.role == "to"]
        inside = [p for p in locatives if p.role == "in"]
        sources = [p for p in locatives if p.role == "from"]
        if targets:
            first_to = locatives.index(targets[0])
            sources = [*(p for p in locatives[:first_to] if p in inside), *sources]
            targets = [p for p in locatives if p not in sources]
        elif fetching:
            sources = [p for p in locatives if p.role in ("in", "from")]
        else:
            targets, guessed = inside, len(inside)
            while len(targets) > 1 and not self._shared(targets):
                sources = [targets[0], *sources]
                targets = targets[1:]
            shifted = len(targets) < guessed
        source, _ = self._one(sources) if sources else (None, "place")
        if len(targets) == 1 and targets[0].noun.quantity is Quantity.ALL:
            each = targets[0].noun.resolve()
            things = all(name in self.scene.vocabulary.objects for name in each.subjects)
            if (each.type == "place" or things) and len(each.subjects) > 1:
                return Where(source, each=each.subjects, text=targets[0].noun.text)
        target, target_type = self._one(targets) if targets else (None, "place")
        if source is not None and source == target:
            raise NotUnderstood(f"the sentence says both from and to {source}: say where to")
        kind: EntityType = "robot" if target_type == "robot" else "place"
        if target in self.scene.vocabulary.objects:
            kind = "object"
        return Where(
            source,
            target,
            kind,
            _surface(sources, source),
            _surface(targets, target),
            relation=self._relation(targets, target) if target is not None else AT,
            guessed=source if shifted else None,
        )

    def _relation(self, locatives: Sequence[Locative], target: str) -> str:
        """What must hold of the target: `on` or `in`, as it is good for, or `at` of all else.

        Raises:
            NotUnderstood: it is said to be on what opens, and things can only be in.
        """
        good_for = self.scene.vocabulary.good_for.get(target, frozenset())
        words = {word for p in locatives if target in p.noun.names for word in p.words}
        if Feature.SUPPORTS in good_for:
            both = Feature.CONTAINS in good_for
            return ON if not both or words & _ON else IN if words & _IN else AT
        if Feature.CONTAINS in good_for:
            if words & _ON and self.scene.vocabulary.objects[target].is_a(Feature.OPENABLE):
                raise NotUnderstood(f"nothing can be put on {target}, only in it")
            return IN
        return AT

    def _one(self, locatives: Sequence[Locative]) -> tuple[str, EntityType]:
        """The one place or robot that all the phrases mean."""
        shared = self._shared(locatives)
        if not shared:
            names = " and ".join(repr(locative.noun.text) for locative in locatives)
            raise NotUnderstood(
                f'{names} are two places; if one is to come after the other, say "then"'
            )
        finest = [p for p in locatives if not shared.isdisjoint(p.noun.names)]
        for locative in finest:
            mention = locative.noun.among(shared).resolve()
            if mention.open or len(mention.subjects) != 1:
                raise WhichOne(
                    f"{locative.noun.text!r} could be {one_of(mention.subjects)}: say which",
                    locative.noun.key,
                    mention.subjects,
                )
        return mention.subjects[0], mention.type

    def _shared(self, locatives: Sequence[Locative]) -> frozenset[str]:
        """Who could be meant by every one of the phrases: by its name, or as what is there."""
        is_at = self.scene.vocabulary.is_at
        return frozenset(
            name
            for locative in locatives
            for name in locative.noun.names
            if all(any(name == n or is_at(name, n) for n in p.noun.names) for p in locatives)
        )

    def located(self, noun: Noun, made: NounPhrase) -> NounPhrase:
        """The same with where its own words say that it is: "the cup that is on the table"."""
        made = self.relations.told_apart(noun, made)
        said = (*noun.places, *(p for r in noun.relatives for p in r.places))
        places = [place for place in said if place.role not in SPATIAL]
        if not places:
            return made
        for relative in noun.relatives:
            inside = [p for p in relative.places if p.role not in SPATIAL]
            if relative.negated and inside:
                gone = self.where([self.locative(p) for p in inside]).target or ""
                self.scene.said.last_place = gone or self.scene.said.last_place
                return made.among(
                    [n for n in made.names if not self.scene.vocabulary.is_at(n, gone)]
                )
        where = self.where([self.locative(place) for place in places])
        for name in filter(None, (where.source, where.target)):
            self.scene.said.named.append((name,))
        return replace(
            made,
            source=where.target or where.source,
            source_surface=where.target_surface or where.source_surface,
        )

    def place_of(self, target: str) -> str:
        """The place where somebody goes who goes there.

        Raises:
            NotUnderstood: it is a thing, and not known where.
        """
        place = self.deixis.now_in(target)
        if place is None:
            raise NotUnderstood(f"it is not known in which place {target} is: name the place")
        return place

    def places(self, place: Place) -> tuple[str, ...]:
        """The places behind a preposition: one, several, or all of them."""
        if place.special == "house":
            return tuple(self.scene.vocabulary.places)
        if place.special == "there" and self.scene.said.last_place is not None:
            return (self.scene.said.last_place,)
        if place.nouns is None:
            raise NotUnderstood(f"{self.scene.said.quote(place.first, place.last)!r} is no place")
        return tuple(
            dict.fromkeys(name for m in self.place_mentions(place.nouns) for name in m.subjects)
        )

    def place_mentions(self, nouns: Nouns) -> list[Mention]:
        """The places that noun phrases name, and places of surfaces."""
        if not self.scene.vocabulary.places:
            raise NotUnderstood("no place is known yet: register one")
        if (
            len(nouns.items) == 1
            and nouns.items[0].form == "general"
            and self.nouns.can_be(nouns, ("object",))
        ):  # "everything"
            return [Mention(tuple(self.scene.vocabulary.places), "place", nouns.items[0].first)]
        mentions = []
        for subject in self.nouns.subjects(nouns, PLACES, "a place"):
            mention = self.who.resolve(subject)
            if people := [n for n in mention.subjects if self.scene.vocabulary.is_person(n)]:
                raise NotUnderstood(f"{one_of(people)} is no place")
            if mention.open or mention.type not in PLACES:
                raise NotUnderstood(f"it does not say which place: {EXAMPLE}")
            surfaces = subject.surfaces
            self.scene.said.named.append(mention.subjects)
            mentions.append(replace(mention, surfaces=surfaces))
        return mentions


def _surface(locatives: Sequence[Locative], place: str | None) -> str | None:
    """The one surface of the place that the phrases name, if they name one."""
    found = {
        entity.id
        for locative in locatives
        for entity in locative.noun.found
        if entity.type == "surface" and entity.stands_for == place != entity.id
    }
    return found.pop() if len(found) == 1 else None
