"""Clauses about where robots shall go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import listed
from fleet.language.resolve.frames import EXAMPLE, Frame
from fleet.language.resolve.goals.wishes import Wishes
from fleet.language.resolve.ground import Ground
from fleet.language.resolve.location.places import WHERE
from fleet.language.resolve.reference.mentions import Subject
from fleet.language.tree.nodes import Place
from keyexpr_schema.facts import AT, HELD


class Going:
    """Turns clauses about going somewhere into wishes."""

    def __init__(self, ground: Ground, wishes: Wishes) -> None:
        self.scene, self.who, self.nouns, self.places = ground
        self.wishes = wishes

    def go(self, frame: Frame, who: Sequence[Subject] | None) -> None:
        """`go to PLACE`; any robot goes if nobody is named."""
        back = bool(frame.particle_words & {"back"}) and not frame.places
        if back and frame.verb == "come" and self.scene.vocabulary.speaker is not None:
            said = self.scene.said
            in_hand = any(wish.relation == HELD for wish in said.draft.stages[-1])
            if in_hand and said.ended < len(said.tokens) - 1:
                return None  # "…, pick it up, come back and give it to me"
            said.draft.next_stage()
            here = Place("to", "", None, self.scene.said.began, self.scene.said.ended, "here")
            return self.go(replace(frame, particles=(), places=(here,)), who)
        if frame.home or back:
            raise NotUnderstood("a robot has no home: name the place where it shall go")
        if frame.verb in ("head for", "make for", "enter", "visit"):
            frame = self._headed_for(frame)
        for nouns in frame.themes:
            text = self.scene.said.quote(nouns.items[0].first, nouns.items[-1].last)
            raise NotUnderstood(f"{text!r} is not understood after {frame.verb!r}: {EXAMPLE}")
        if via := [p for p in frame.places if p.role == "via" and p.nouns is not None]:
            return self._by_way_of(frame, via, who)
        if other := [p for p in frame.places if p.role not in WHERE]:
            raise self.places.relations.unknown(other[0])
        where, _ = self.wishes.whereto(frame)
        if where.target is None or where.target_type == "robot":
            known = listed(self.scene.lexicon.known(("place",)))
            raise NotUnderstood(
                f"{self.scene.said.clause!r} ends where a place is missing; known are {known}"
            )
        if who is not None:
            return self.wishes.to_target(who, where, False)
        self.scene.said.moved = [robot := self.who.some_robot()]
        self.scene.said.draft.add(AT, robot, self.places.place_of(where.target), means=True)
        return None

    def _headed_for(self, frame: Frame) -> Frame:
        """The same with what is headed for, or entered, as the place to go to."""
        places = tuple(replace(p, role="to") if p.role == "for" else p for p in frame.places)
        for nouns in frame.themes:
            if not self.nouns.can_be(nouns, ("place",)):
                text = self.scene.said.quote(nouns.items[0].first, nouns.items[-1].last)
                raise NotUnderstood(f"{text!r} is no place that a robot can go into: name one")
            first, last = nouns.items[0].first, nouns.items[-1].last
            places = (Place("to", "", nouns, first, last), *places)
        return replace(frame, places=places, themes=())

    def _by_way_of(self, frame: Frame, via: Sequence[Place], who: Sequence[Subject] | None) -> None:
        """`go to the garden via the garage`: one after the other."""
        rest = tuple(p for p in frame.places if p not in via)
        for place in via:
            self.go(replace(frame, places=(replace(place, role="to"),)), who)
            self.scene.said.draft.next_stage()
        return self.go(replace(frame, places=rest), who)
