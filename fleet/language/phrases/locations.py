"""Where things are or shall be: "in the kitchen", "on the table in the hallway"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fleet.errors import NotUnderstood
from fleet.language.phrases.cursor import Cursor
from fleet.language.phrases.mentions import NounPhrase, Quantity
from fleet.language.phrases.noun_phrases import NounPhrases
from fleet.language.refusals import one_of
from fleet.language.vocabulary import Vocabulary
from fleet.language.words.lexicon import EntityType
from fleet.language.words.wordlists import BASKETS, DEFINITE, INDEFINITE, SPEAKER
from keyexpr_schema.facts import AT, IN, ON
from keyexpr_schema.payloads.world import Feature

PLACES: tuple[EntityType, ...] = ("place", "surface")
SPOTS: tuple[EntityType, ...] = ("place", "robot", "surface")
_ON = frozenset({"on", "onto", "top"})
_IN = frozenset({"in", "into", "inside", "within"})


@dataclass(frozen=True)
class Locative:
    """One prepositional phrase: `to`, `in` or `from`, and what stands behind it.

    `word` is the preposition as it was said.
    """

    preposition: str
    noun: NounPhrase
    word: str = ""


@dataclass(frozen=True)
class Where:
    """What the prepositional phrases of one clause say: places, things or robots, by id.

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


class Locations:
    """Reads prepositional phrases of place."""

    def __init__(self, cursor: Cursor, nouns: NounPhrases, vocabulary: Vocabulary) -> None:
        self.cursor, self.nouns, self.vocabulary = cursor, nouns, vocabulary

    def locative(self, preposition: str) -> Locative:
        """What stands behind a preposition that was just read.

        Raises:
            NotUnderstood: it is neither a place, nor a thing that others can be on or in, nor a
                person, a robot, or a robot's basket.
        """
        cursor, start = self.cursor, self.cursor.at
        before = [token.word for token in cursor.tokens[:start] if token.word != "of"]
        word = before[-1] if before else ""
        if (speaker := self._speaker()) is not None:
            return Locative(preposition, speaker, word)
        if (basket := self._basket(start)) is not None:
            return Locative(preposition, basket)
        if self.vocabulary.good_for and not self.nouns.starts(SPOTS):
            self._refuse_thing()
        noun = self.nouns.noun("a place", SPOTS)
        if noun.type == "robot":
            possessed = cursor.take("'s") or cursor.take("'")
            if cursor.take_word(BASKETS):
                noun = noun.among(self._with_baskets()) if noun.generic else noun
                if not noun.found:
                    raise NotUnderstood("no robot with a basket is known")
            elif possessed:
                raise cursor.refusal(
                    f"{cursor.quote(start)!r} is followed by what is not understood; "
                    "a robot has a basket"
                )
        return Locative(preposition, noun, word)

    def _speaker(self) -> NounPhrase | None:
        """Who says "me", if that comes next and it is known."""
        cursor, start = self.cursor, self.cursor.at
        if self.vocabulary.speaker is None or not cursor.take_word(SPEAKER):
            return None
        found = tuple(
            e
            for e in cursor.lexicon.entities
            if e.type == "surface" and e.id == self.vocabulary.speaker
        )
        return NounPhrase(found, cursor.quote(start), start, exact=True) if found else None

    def _refuse_thing(self) -> None:
        """Say why nothing can be put on what comes next, if it is a thing.

        Raises:
            NotUnderstood: it is.
        """
        cursor, start = self.cursor, self.cursor.at
        if self.nouns.starts(("object",)):
            noun = self.nouns.noun("an object", ("object",))
            raise NotUnderstood(
                f"{cursor.quote(start)!r}: nothing can be put on or in {one_of(noun.names)}"
            )

    def _with_baskets(self) -> list[str]:
        return sorted(
            n for n, spec in self.vocabulary.robots.items() if "basket" in spec.capabilities
        )

    def _basket(self, start: int) -> NounPhrase | None:
        """`the basket`, `its basket`, `the basket of the robot`."""
        cursor = self.cursor
        cursor.take_word(DEFINITE | INDEFINITE)
        lexicon, tokens = cursor.lexicon, cursor.tokens
        named = (
            lexicon.exact(tokens, cursor.at, SPOTS)[1]
            or lexicon.described(tokens, cursor.at, ("surface",))[1]
        )
        if named or not cursor.take_word(BASKETS):
            cursor.at = start
            return None
        if cursor.take("of"):
            return self.nouns.noun("a robot", ("robot",))
        owners = self._with_baskets()
        found = tuple(e for e in cursor.lexicon.entities if e.type == "robot" and e.id in owners)
        if len(found) != 1:
            reason = f"could be that of {one_of(owners)}" if found else "is no robot's"
            raise NotUnderstood(f"{cursor.quote(start)!r} {reason}: say whose")
        return NounPhrase(found, cursor.quote(start), start, Quantity.THE, exact=True)

    def where(self, locatives: Sequence[Locative]) -> Where:
        """Source and target of a clause that moves something, or says where something is.

        What stands behind "to" is the target; without it, what stands behind the last "in". Other
        phrases narrow the target ("on the table in the kitchen") or name the source.

        Raises:
            NotUnderstood: a phrase could be several places, or the phrases do not go together.
        """
        targets = [p for p in locatives if p.preposition == "to"]
        inside = [p for p in locatives if p.preposition == "in"]
        sources = [p for p in locatives if p.preposition == "from"]
        if targets:
            first_to = locatives.index(targets[0])
            sources = [*(p for p in locatives[:first_to] if p in inside), *sources]
            targets = [p for p in locatives if p not in sources]
        else:
            targets = inside
            while len(targets) > 1 and not self._shared(targets):
                sources = [targets[0], *sources]
                targets = targets[1:]
        source, _ = self._one(sources) if sources else (None, "place")
        if len(targets) == 1 and targets[0].noun.quantity is Quantity.ALL:
            each = targets[0].noun.resolve()
            things = all(name in self.vocabulary.objects for name in each.subjects)
            if (each.type == "place" or things) and len(each.subjects) > 1:
                return Where(source, each=each.subjects, text=targets[0].noun.text)
        target, target_type = self._one(targets) if targets else (None, "place")
        if source is not None and source == target:
            raise NotUnderstood(f"the sentence says both from and to {source}: say where to")
        kind: EntityType = "robot" if target_type == "robot" else "place"
        if target in self.vocabulary.objects:
            kind = "object"
        return Where(
            source,
            target,
            kind,
            _surface(sources, source),
            _surface(targets, target),
            relation=self._relation(targets, target) if target is not None else AT,
        )

    def _relation(self, locatives: Sequence[Locative], target: str) -> str:
        """What must hold of the target: `on` or `in`, as it is good for, or `at` of all else.

        Raises:
            NotUnderstood: it is said to be on what opens, and things can only be in.
        """
        good_for = self.vocabulary.good_for.get(target, frozenset())
        words = {p.word for p in locatives if target in p.noun.names}
        if Feature.SUPPORTS in good_for:
            both = Feature.CONTAINS in good_for
            return ON if not both or words & _ON else IN if words & _IN else AT
        if Feature.CONTAINS in good_for:
            if words & _ON and self.vocabulary.objects[target].is_a(Feature.OPENABLE):
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
                raise NotUnderstood(
                    f"{locative.noun.text!r} could be {one_of(mention.subjects)}: say which"
                )
        return mention.subjects[0], mention.type

    def _shared(self, locatives: Sequence[Locative]) -> frozenset[str]:
        """Who could be meant by every one of the phrases: by its name, or as what is there."""
        return frozenset(
            name
            for locative in locatives
            for name in locative.noun.names
            if all(
                any(name == there or self.vocabulary.is_at(name, there) for there in p.noun.names)
                for p in locatives
            )
        )


def _surface(locatives: Sequence[Locative], place: str | None) -> str | None:
    """The one surface of the place that the phrases name, if they name one."""
    found = {
        entity.id
        for locative in locatives
        for entity in locative.noun.found
        if entity.type == "surface" and entity.stands_for == place != entity.id
    }
    return found.pop() if len(found) == 1 else None
