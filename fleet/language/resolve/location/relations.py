"""What is next to, under or between other things: as it is believed, and as places are laid out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

from fleet.errors import NotUnderstood
from fleet.language.refusals import Misused, listed, one_of, reason_for
from fleet.language.resolve.frames import Frame
from fleet.language.resolve.reference.mentions import NounPhrase
from fleet.language.resolve.reference.nouns import NounResolver
from fleet.language.resolve.reference.referents import Referents
from fleet.language.resolve.scene import Scene
from fleet.language.tagging.lexicon import EntityType
from fleet.language.tree.nodes import Noun, Place
from fleet.language.vocabulary import Vocabulary
from keyexpr_schema.facts import FactKey
from keyexpr_schema.payloads.world import Surface

BETWEEN, NEXT_TO = "between", "next_to"
SPATIAL = frozenset(
    {NEXT_TO, "under", "above", "behind", "in_front_of", "left_of", "right_of", BETWEEN}
)
"""Roles of phrases that say where something is by what is around it."""
_NEAR_M = 1.0
"""Furniture with no more than that between it stands next to each other."""
_LANDMARKS: tuple[EntityType, ...] = ("object", "place")


class Relations:
    """Tells things apart by what is around them."""

    def __init__(self, scene: Scene, who: Referents, nouns: NounResolver) -> None:
        self.scene, self.who, self.nouns = scene, who, nouns

    def unknown(self, place: Place) -> NotUnderstood:
        """Why a phrase with such a preposition says nothing here."""
        shown = reason_for([(word, word) for word in place.preposition.split()])
        if shown is None or place.role in SPATIAL:
            made = listed(("in", "on", "at", *self.scene.vocabulary.relations))
            word = place.preposition.removeprefix("to the ").removeprefix("on the ")
            shown = f"{word!r} names a relation that is not known; known are {made}"
        return Misused(shown)

    def made(self, place: Place) -> bool:
        """Whether a skill brings things into that relation."""
        return place.role in self.scene.vocabulary.relations

    def landmark(self, place: Place) -> str:
        """The one thing that something is said to be next to.

        Raises:
            NotUnderstood: it does not say which.
        """
        names = self._landmarks(place)
        if len(names) != 1:
            raise NotUnderstood(f"{place.preposition!r}: it could be {one_of(names)}: say which")
        return names[0]

    def told_apart(self, noun: Noun, made: NounPhrase) -> NounPhrase:
        """Those of which all is believed that the noun's own words say of what is around it."""
        for place in (p for p in noun.places if p.role in SPATIAL):
            made = self.narrowed(made, place)
        for relative in noun.relatives:
            for place in (p for p in relative.places if p.role in SPATIAL):
                beside = self.narrowed(made, place)
                rest = [name for name in made.names if name not in beside.names]
                made = made.among(rest) if relative.negated else beside
        return made

    def narrowed(self, made: NounPhrase, place: Place) -> NounPhrase:
        """Those of which it is believed.

        Raises:
            NotUnderstood: it is believed of none, or nothing is known of such a relation.
        """
        vocabulary, marks = self.scene.vocabulary, self._landmarks(place)
        if place.role == BETWEEN and len(marks) == 2:
            found = [n for n in made.names if _between(vocabulary, n, *marks)]
        elif place.role == NEXT_TO:
            found = [n for n in made.names if any(_next_to(vocabulary, n, m) for m in marks)]
        else:
            found = []
        told = [
            name
            for name, mark in product(made.names, marks)
            if vocabulary.believed.get(FactKey(place.role, name)) == mark
        ]
        if found := list(dict.fromkeys([*told, *found])):
            return made.among(found)
        if place.role in (NEXT_TO, BETWEEN) or self.made(place):
            raise NotUnderstood(
                f"it is not known that {one_of(made.names)} is {place.preposition} "
                f"{' and '.join(marks)}: name it"
            )
        raise self.unknown(place)

    def _landmarks(self, place: Place) -> list[str]:
        if place.nouns is None:
            raise self.unknown(place)
        found = self.nouns.subjects(place.nouns, _LANDMARKS, "an object or a place")
        return self.who.all_of(found)

    def attached(self, frame: Frame, wishes: bool) -> Frame:
        """The frame with such phrases as part of what they stand behind.

        `wishes`: the last one may say where it shall be, where nothing else does.
        """
        themes, places = list(frame.themes), list[Place]()
        for i, place in enumerate(frame.places):
            later = [p for p in frame.places[i + 1 :] if p.role not in SPATIAL]
            elsewhere = later or not wishes or places[-1:]
            if place.role not in SPATIAL or not elsewhere:
                places.append(place)
            elif places and places[-1].nouns is not None and places[-1].last == place.first:
                items = _with_place(places[-1].nouns.items, place)
                nouns = replace(places[-1].nouns, items=items)
                places[-1] = replace(places[-1], nouns=nouns, last=place.last)
            elif themes and _end(themes[-1].items[-1]) == place.first:
                themes[-1] = replace(themes[-1], items=_with_place(themes[-1].items, place))
            else:
                places.append(place)
        return replace(frame, themes=tuple(themes), places=tuple(places))


def _with_place(items: Sequence[Noun], place: Place) -> tuple[Noun, ...]:
    return (*items[:-1], replace(items[-1], places=(*items[-1].places, place)))


def _end(noun: Noun) -> int:
    return noun.places[-1].last if noun.places else noun.last


def _next_to(vocabulary: Vocabulary, one: str, other: str) -> bool:
    """Whether they are on or in the same thing, or stand close together on the floor plan."""
    above, below = _carriers(vocabulary, one), _carriers(vocabulary, other)
    if one == other or one in below or other in above:
        return False
    if above[:1] == below[:1] and above and above[0] not in vocabulary.places:
        return True
    here, there = _standing(vocabulary, one), _standing(vocabulary, other)
    return here is not None and there is not None and _gap_m(here, there) <= _NEAR_M


def _between(vocabulary: Vocabulary, name: str, one: str, other: str) -> bool:
    """Whether it stands between them, no farther aside than they are apart."""
    found = [s for n in (name, one, other) if (s := _standing(vocabulary, n)) is not None]
    if len(found) < 3 or name in (one, other):
        return False
    (x, y), (x1, y1), (x2, y2) = ((s.x_m, s.y_m) for s in found)
    square = (x2 - x1) ** 2 + (y2 - y1) ** 2
    if not square:
        return False
    along = ((x - x1) * (x2 - x1) + (y - y1) * (y2 - y1)) / square
    aside = abs((x - x1) * (y2 - y1) - (y - y1) * (x2 - x1)) / square
    return 0.0 < along < 1.0 and aside < 0.5


def _carriers(vocabulary: Vocabulary, name: str) -> tuple[str, ...]:
    """All that it is on or in, the nearest first; surfaces that are no things, too."""
    resting = vocabulary.rests.get(name)
    carriers = tuple(vocabulary.carriers.get(name, ()))
    on_surface = resting in vocabulary.surfaces and resting not in carriers
    return (str(resting), *carriers) if on_surface else carriers


def _standing(vocabulary: Vocabulary, name: str) -> Surface | None:
    """The piece of the floor plan that it takes up, or that what it is on does."""
    surfaces = vocabulary.surfaces
    over = (name, *_carriers(vocabulary, name))
    return next((surfaces[each] for each in over if each in surfaces), None)


def _gap_m(one: Surface, other: Surface) -> float:
    """Between their borders, as far as corners and middles show it [m]."""

    def reach(a: Surface, b: Surface) -> float:
        sides = product(
            (-a.length_m / 2, 0.0, a.length_m / 2), (-a.width_m / 2, 0.0, a.width_m / 2)
        )
        return min(b.distance_m(*a.point_m(along, across)[:2]) for along, across in sides)

    return min(reach(one, other), reach(other, one))
