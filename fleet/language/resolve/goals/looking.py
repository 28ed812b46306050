"""Clauses about finding, picking up, searching and patrolling."""

from __future__ import annotations

from collections.abc import Sequence

from fleet.errors import NotUnderstood
from fleet.language.resolve.frames import Frame
from fleet.language.resolve.goals.wishes import Wishes
from fleet.language.resolve.ground import Ground
from fleet.language.resolve.location.places import WHERE
from fleet.language.resolve.reference.mentions import Mention, NounPhrase, Subject
from fleet.language.tree.nodes import (
    Nouns,
    Place,
)
from keyexpr_schema.facts import (
    AT,
    HELD,
    LOCATED,
    SEARCHED,
)
from keyexpr_schema.payloads.world import Feature

ROBOTS_TELL = "robots say themselves where they are; see their states"


class Looking:
    """Turns clauses about finding, picking up and searching into wishes."""

    def __init__(self, ground: Ground, wishes: Wishes) -> None:
        self.scene, self.who, self.nouns, self.places = ground
        self.wishes = wishes

    def find(self, frame: Frame) -> None:
        """`find NP`, perhaps with where to look."""
        themes, places = list(frame.themes), list(frame.places)
        if not themes and places and places[0].role == "for" and places[0].nouns:
            themes = [places.pop(0).nouns or Nouns(())]
        if len(themes) != 1:
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say what to look for")
        self.find_these(themes[0], places)

    def find_these(self, nouns: Nouns, places: Sequence[Place]) -> None:
        """Wish that it is known where these are, and that somebody looked in these places."""
        text = self.scene.said.quote(nouns.items[0].first, nouns.items[-1].last)
        if self.nouns.can_be(nouns, ("robot",)) and not self.nouns.can_be(nouns, ("object",)):
            raise NotUnderstood(f"{text!r}: {ROBOTS_TELL}")
        found = self.nouns.subjects(nouns, ("object",), "an object")
        if any(isinstance(s, Mention) and s.type == "robot" for s in found):
            raise NotUnderstood(ROBOTS_TELL)
        places = [p for p in places if p.special != "anywhere"]
        if (there := self._believed_there(found, places)) is not None:
            mentions, places = there, []
        else:
            mentions = [self.who.resolve(subject) for subject in found]
        self._look_in([p for p in places if p.special != "anywhere"])
        for mention in mentions:
            self.scene.said.draft.add(LOCATED, mention, True)
        self.scene.said.remember(mentions)

    def _believed_there(
        self, found: Sequence[Subject], places: Sequence[Place]
    ) -> list[Mention] | None:
        """Who is meant by "a mug in the kitchen", where some of several are believed there."""
        if len(found) != 1 or not isinstance(found[0], NounPhrase) or len(found[0].names) < 2:
            return None
        if not places or any(p.special or p.role not in ("in", "from") for p in places):
            return None
        try:
            where = self.places.where([self.places.locative(p) for p in places], fetching=True)
        except NotUnderstood:
            return None
        source = where.source or where.target or ""
        there = [n for n in found[0].names if self.scene.vocabulary.is_at(n, source)]
        return [found[0].among(there).resolve()] if there else None

    def _look_in(self, places: Sequence[Place]) -> None:
        if not places:
            return None
        for place in places:
            if place.role not in ("around", *WHERE):
                self.places.locative(place)  # says what is wrong with it
        if any(p.role not in ("in", "from", "around") and p.special != "house" for p in places):
            raise NotUnderstood(f"{self.scene.said.clause!r}: things are looked for in places")
        if len(places) > 1 and all(p.nouns and len(p.nouns.items) == 1 for p in places):
            where = self.places.where([self.places.locative(p) for p in places])
            names: tuple[str, ...] = tuple(filter(None, (where.target or where.source,)))
            return self.searched(names)
        found = [name for place in places for name in self.places.places(place)]
        return self.searched(tuple(dict.fromkeys(found)))

    def pick(self, frame: Frame) -> None:
        """`pick up NP`, perhaps with where it is."""
        if len(frame.themes) != 1:
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say what to pick up")
        picked = [
            self.who.movable(s)
            for s in self.nouns.subjects(frame.themes[0], ("object",), "an object")
        ]
        if any(isinstance(s, Mention) and s.type == "robot" for s in picked):
            raise NotUnderstood("a robot cannot be picked up: name an object")
        locatives, home = self.wishes.locatives(frame)
        if home or any(locative.role == "to" for locative in locatives):
            raise NotUnderstood(f'{self.scene.said.clause!r}: to move a thing, say "bring"')
        where = self.places.where(locatives, fetching=True)
        if where.source in self.scene.vocabulary.places:
            self.scene.said.last_place = where.source
        mentions = [self.who.resolve(s, where.source, where.source_surface) for s in picked]
        for mention in mentions:
            self.scene.said.draft.add(HELD, mention, True)
        self.scene.said.remember(mentions)

    def search(self, frame: Frame) -> None:
        """`search PLACE`, perhaps with what for."""
        sought = [p.nouns for p in frame.places if p.role == "for" and p.nouns is not None]
        places = tuple(dict.fromkeys(self.route(frame)))
        self.searched(places)
        for nouns in sought:
            self.find_these(nouns, ())

    def patrol(self, frame: Frame, who: Sequence[Subject]) -> None:
        """`ROBOT, patrol PLACE and PLACE`: it goes from one to the next, in that order.

        Raises:
            NotUnderstood: several robots, who could share the places or go to each of them.
        """
        if sought := [p for p in frame.places if p.role == "for"]:
            text = self.scene.said.quote(sought[0].first, sought[0].last)
            raise NotUnderstood(
                f"{text!r} is not understood after "
                f"{self.scene.said.quote(self.scene.said.began, sought[0].first)!r}"
            )
        mentions = [self.who.resolve(self.who.drivers(subject)) for subject in who]
        if len(mentions) != 1 or not mentions[0].single:
            raise NotUnderstood(
                f"{self.scene.said.clause!r} does not say which robot goes where: say it of "
                "one robot at a time, or leave the robots out"
            )
        for i, place in enumerate(self.route(frame)):
            if i:
                self.scene.said.draft.next_stage()
            self.scene.said.draft.add(AT, mentions[0], self.places.place_of(place))
            self.scene.said.last_place = place
        self.scene.said.remember(mentions)

    def route(self, frame: Frame) -> tuple[str, ...]:
        """The places where somebody shall look around, in the order of the words."""
        places = [p for p in frame.places if p.role != "for" and p.special != "there"]
        if len(frame.themes) > 1:
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say where to look around")
        if any(p.role not in ("in", "around", "via", "to") for p in places):
            for place in places:
                if place.role not in ("around", "via", *WHERE):
                    self.places.locative(place)  # says what is wrong with it
            raise NotUnderstood(f"{self.scene.said.clause!r}: places are searched, and in them")
        if frame.themes and not (
            len(frame.themes[0].items) == 1 and frame.themes[0].items[0].form == "pronoun"
        ):
            named = [
                name for m in self.places.place_mentions(frame.themes[0]) for name in m.subjects
            ]
            if places:
                where = self.places.where([self.places.locative(p) for p in places])
                inside = where.target or where.source
                named = [
                    n for n in named if self.scene.vocabulary.place_of(n) == inside or n == inside
                ]
                if not named:
                    raise NotUnderstood(f"{self.scene.said.clause!r} names two places")
            return tuple(named)
        if places:
            if len(places) > 1 and all(p.nouns and len(p.nouns.items) == 1 for p in places):
                where = self.places.where([self.places.locative(p) for p in places])
                return tuple(filter(None, (where.target or where.source,)))
            return tuple(name for place in places for name in self.places.places(place))
        if self.scene.said.last_place is None:
            raise NotUnderstood(
                'it does not say where to look around: name a place, or say "everywhere"'
            )
        return (self.scene.said.last_place,)

    def searched(self, places: Sequence[str]) -> None:
        """Wish that somebody looked around in these places, or into these things."""
        places = [self._searchable(place) for place in places]
        key = self.scene.said.began
        self.scene.said.draft.add(SEARCHED, Mention(tuple(places), "place", key), True)
        if len(places) == 1:
            self.scene.said.last_place = places[0]

    def _searchable(self, name: str) -> str:
        """What is looked into: a thing that others can be in; else the place where it is."""
        inside = Feature.CONTAINS in self.scene.vocabulary.good_for.get(name, ())
        return name if inside else self.places.place_of(name)
