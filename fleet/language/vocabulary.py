"""The names that sentences can use."""

from __future__ import annotations

from collections.abc import Mapping, MutableMapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import msgspec

from fleet.errors import NotUnderstood
from fleet.language.methods.model import OBJECT, PERSON, PLACE, ROBOT, CompoundTask
from fleet.language.words.latest import Latest
from fleet.language.words.wordbook import Wordbook, shipped_language
from keyexpr_schema.facts import AT, IN, ON, FactKey, Value
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Feature, Object, Place, Surface

_CARRYING = (Feature.SUPPORTS, Feature.CONTAINS, Feature.PERSON)


class SkillTool(msgspec.Struct, frozen=True, kw_only=True):
    """A parameter of a skill that people name after "with": of what `type` it is.

    `relation`: what then holds between the thing and it (`cut_with(food) = tool`); empty where no
    effect says with what it was done.
    """

    name: str
    type: str
    relation: str = ""


class SkillPhrase(msgspec.Struct, frozen=True, kw_only=True):
    """A skill that can be asked for by name: "vacuum the hallway".

    `type` is that of what it is done to: `place`, `object`, or kinds, categories and features of
    things, as skill files write them (`openable`, `cup & clean | glass`); `wants` are the relations
    and values that hold of it then.
    """

    verb: str
    type: str = msgspec.field(name="sort")
    wants: tuple[tuple[str, Value], ...]
    says: tuple[str, ...] = ()
    """Other ways to ask for it: `cut {object} [up] [with {tool}]`, `turn {object} off`."""
    skill: str = ""
    tools: tuple[SkillTool, ...] = ()

    def fits(self, thing: Object) -> bool:
        """Whether it can be done to a thing."""
        return _is_of(thing, self.type)


class StateWord(msgspec.Struct, frozen=True, kw_only=True):
    """A word for a value of a relation: "clean" and "dirty" things.

    `type` is that of what it is said of, as skill files write it.
    """

    word: str
    type: str
    relation: str
    value: Value

    def fits(self, thing: Object) -> bool:
        """Whether it can be said of a thing."""
        return _is_of(thing, self.type)


def _is_of(thing: Object, type_: str) -> bool:
    return any(
        all(word.strip() == "object" or thing.is_a(word.strip()) for word in words.split("&"))
        for words in type_.split("|")
    )


@dataclass(frozen=True)
class Vocabulary:
    """Places, objects and robots that exist, by id.

    `whereabouts` may say at which place (or robot, or person) an object is believed to be; phrases
    such as "the cup in the kitchen" or "all cups from the kitchen" are told apart by it, and "tidy
    up the kitchen" is said of what is believed to be there. `rests` may say on or in what it is
    believed to lie there: a thing, a surface, or `floor`. `carriers` may say all that it is on or
    in, the nearest first: "the fork in the drawer" also of one in a box in that drawer.
    `skill_phrases` are skills that can be asked for by name. `speaker` is the person who speaks:
    "me". `believed` gives what is believed of other state variables: "the open window", "a clean
    mug"; `state_words` are the words for that. `language` has the words, where a fleet has words of
    its own.
    """

    places: Mapping[str, Place]
    objects: Mapping[str, Object]
    robots: Mapping[str, RobotSpec]
    whereabouts: Mapping[str, str] = field(default_factory=dict)
    rests: Mapping[str, str] = field(default_factory=dict)
    skill_phrases: tuple[SkillPhrase, ...] = ()
    carriers: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    speaker: str | None = None
    believed: Mapping[FactKey, Value] = field(default_factory=dict)
    language: Wordbook | None = None
    state_words: tuple[StateWord, ...] = ()
    tasks: tuple[CompoundTask, ...] = ()
    """What people call by names of its own: "set the table"."""
    relations: tuple[str, ...] = ()
    """What skills bring about between two things: `next_to`."""

    @property
    def wordbook(self) -> Wordbook:
        """The words that sentences are made of."""
        return self.language or shipped_language()

    def is_at(self, name: str, where: str) -> bool:
        """Whether something is believed to be there, directly or on or in what is there."""
        known = (self.whereabouts.get(name), self.rests.get(name), *self.carriers.get(name, ()))
        return where in known

    def place_of(self, name: str) -> str | None:
        """The place in which a thing is believed to be; a place is its own."""
        known = (name, *self.carriers.get(name, ()), self.whereabouts.get(name))
        return next((place for place in known if place in self.places), None)

    @cached_property
    def good_for(self) -> Mapping[str, frozenset[Feature]]:
        """What has others on it or in it, or is a person, by id: by itself, or by its parts."""
        return _abilities(self.objects).good_for

    @cached_property
    def surfaces(self) -> Mapping[str, Surface]:
        """Where furniture stands on the floor plan, as far as places say it."""
        return {s.surface: s for place in self.places.values() for s in place.surfaces}

    @cached_property
    def movable(self) -> frozenset[str]:
        """What can be moved."""
        return _abilities(self.objects).movable

    @cached_property
    def parts(self) -> Mapping[str, tuple[str, ...]]:
        """The fixed parts of things, and the parts of these, by id of the whole."""
        return _abilities(self.objects).parts

    def relation_to(self, name: str) -> str:
        """What must hold of a thing that is at a place, or on or in another thing."""
        good_for = self.good_for.get(name, frozenset())
        on, within = Feature.SUPPORTS in good_for, Feature.CONTAINS in good_for
        return AT if on == within else ON if on else IN

    def is_person(self, name: str) -> bool:
        """Whether somebody of that name is there, whom things can be given to."""
        return Feature.PERSON in self.good_for.get(name, ())

    def spoken_by(self, speaker: str | None) -> Vocabulary:
        """The same names, in the mouth of a person; of nobody in particular without one.

        Raises:
            NotUnderstood: nobody of that name is known.
        """
        if speaker is not None and not self.is_person(speaker):
            known = ", ".join(sorted(filter(self.is_person, self.objects))) or "none"
            raise NotUnderstood(
                f"{speaker!r}, who says it, is no person that is known; known are {known}"
            )
        return replace(self, speaker=speaker)

    def of_type(self, type_: str) -> frozenset[str]:
        """All that is of a type as files write it: `place`, `person`, `robot`, `object`, or kinds,
        categories and features of things (`cup & openable | glass`)."""
        if type_ == PLACE:
            return frozenset(self.places)
        if type_ == ROBOT:
            return frozenset(self.robots)
        if type_ == PERSON:
            return frozenset(filter(self.is_person, self.objects))
        if type_ == OBJECT:
            return frozenset(self.objects)
        return frozenset(name for name, thing in self.objects.items() if _is_of(thing, type_))

    def can(self, skill: str) -> bool:
        """Whether a skill of that name can be asked for by name."""
        return any(skill in (each.skill, each.verb) for each in self.skill_phrases)


class _Abilities(NamedTuple):
    good_for: Mapping[str, frozenset[Feature]]
    movable: frozenset[str]
    parts: Mapping[str, tuple[str, ...]]


_LATEST: Latest[Mapping[str, Object], _Abilities] = Latest()


def _abilities(objects: Mapping[str, Object]) -> _Abilities:
    """What things are good for: found out once for the very same things, if they cannot change."""
    if isinstance(objects, MutableMapping):
        return _abilities_of(objects)
    return _LATEST.of(objects, lambda: _abilities_of(objects))


def _abilities_of(objects: Mapping[str, Object]) -> _Abilities:
    found: dict[str, set[Feature]] = {}
    parts: dict[str, list[str]] = {}
    for thing in objects.values():
        features = {feature for feature in _CARRYING if thing.is_a(feature)}
        here: Object | None = thing
        seen: set[str] = set()
        while here is not None and here.object not in seen:
            if features:
                found.setdefault(here.object, set()).update(features)
            if here is not thing:
                parts.setdefault(here.object, []).append(thing.object)
            seen.add(here.object)
            here = objects.get(here.part_of) if here.part_of is not None else None
    movable = frozenset(o.object for o in objects.values() if o.is_a(Feature.MOVABLE))
    return _Abilities(
        {name: frozenset(kinds) for name, kinds in found.items()},
        movable,
        {whole: tuple(of) for whole, of in parts.items()},
    )
