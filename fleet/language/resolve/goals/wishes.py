"""Clauses about where things and robots shall be: bringing, giving, putting back, going."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import listed, one_of
from fleet.language.resolve.frames import EXAMPLE, Frame
from fleet.language.resolve.goals.homes import Homes
from fleet.language.resolve.ground import Ground
from fleet.language.resolve.location.places import Locative, Where
from fleet.language.resolve.location.relations import SPATIAL
from fleet.language.resolve.reference.mentions import Mention, NounPhrase, Subject
from fleet.language.tree.nodes import Quantity
from keyexpr_schema.facts import AT
from keyexpr_schema.payloads.world import Feature

_MOST = 20
"""Of so many things of all kinds it is asked whether all are meant."""
HOMEWARD = frozenset({"back", "away"})
_LOOSE = frozenset({"back", "away", "up", "over", "down", "off", "out"})


class Wishes:
    """Turns clauses about where things and robots shall be into wishes."""

    def __init__(self, ground: Ground) -> None:
        self.scene, self.who, self.nouns, self.places = ground
        self.homes = Homes(ground)

    def beside(self, moved: Sequence[Subject], frame: Frame) -> bool:
        """Whether it says that these shall be next to something, and a skill does that."""
        relations = self.places.relations
        where = next((p for p in frame.places if p.role in SPATIAL and relations.made(p)), None)
        if where is None or any(subject.type == "robot" for subject in moved):
            return False
        if len(frame.places) > 1 or frame.particle_words - _LOOSE:
            raise NotUnderstood(f"{self.scene.said.clause!r} says twice where to: say one")
        landmark = relations.landmark(where)
        mentions = [self.who.resolve(self.who.movable(subject)) for subject in moved]
        for mention in mentions:
            kept = tuple(name for name in mention.subjects if name != landmark)
            if not kept:
                raise NotUnderstood(f"nothing can be {where.preposition} itself: say what else")
            self.scene.said.draft.add(where.role, replace(mention, subjects=kept), landmark)
        self.scene.said.remember(mentions)
        return True

    def for_whom(self, frame: Frame) -> tuple[Frame, str | None]:
        """The frame without "for Anna"; for whom it is, if that is known."""
        for place in frame.places:
            if place.role != "for" or place.nouns is None:
                continue
            rest = replace(frame, places=tuple(p for p in frame.places if p is not place))
            one = place.nouns.items[0]
            if one.form == "me":
                return rest, self.scene.vocabulary.speaker
            if len(place.nouns.items) == 1 and self.nouns.can_be(place.nouns, ("object",)):
                subject = self.nouns.subject(one, ("object",), "a person")
                mention = self.who.resolve(subject)
                if len(mention.subjects) == 1:
                    self.scene.said.spoken_of(mention.subjects)
                if not mention.open and self.scene.vocabulary.is_person(mention.subjects[0]):
                    return rest, mention.subjects[0]
        return frame, None

    def from_where(self, subject: Subject, where: Where) -> Mention:
        """Who is meant, told apart by where they are."""
        return self.who.resolve(subject, where.source, where.source_surface)

    def locatives(self, frame: Frame) -> tuple[list[Locative], bool]:
        """The phrases of place; whether they say "home".

        Raises:
            NotUnderstood: a phrase or particle means nothing here.
        """
        particles = frame.particle_words
        if stray := sorted(particles - _LOOSE):
            raise NotUnderstood(
                f"{stray[0]!r} is not understood after {frame.verb or 'it'!r}: {EXAMPLE}"
            )
        locatives = [
            self.places.locative(place)
            for place in frame.places
            if place.special not in ("home", "anywhere")
        ]
        bare = [p.special == "there" and not p.preposition for p in frame.places]
        if len(locatives) == len(bare) > 1:  # "in the washing machine there"
            locatives = [
                replace(loc, role="in") if is_bare else loc
                for loc, is_bare in zip(locatives, bare, strict=True)
            ]
        placed = any(locative.role != "from" for locative in locatives)
        home = frame.home or bool(particles & {"back", "away"})
        if placed and frame.home:
            raise NotUnderstood(
                f'{self.scene.said.clause!r} names a place and says "home": say one'
            )
        return locatives, home and not placed

    def whereto(
        self, frame: Frame, each: bool = False, fetching: bool = False
    ) -> tuple[Where, bool]:
        """Source and target, which is what "there" means next; whether it says "home".

        Raises:
            NotUnderstood: the phrases say "every room", and not `each` of several can be meant.
        """
        locatives, home = self.locatives(frame)
        where = self.places.where(locatives, fetching)
        good_for = self.scene.vocabulary.good_for.get(where.target or "", frozenset())
        for name in filter(None, (where.source, where.target)):
            self.scene.said.named.append((name,))
        if good_for - {Feature.PERSON}:
            self.scene.said.carrier = where.target
        if where.each and not each:
            raise self._which_of(where)
        if where.target is not None and where.target_type != "robot":
            self.scene.said.last_place = where.target
        elif where.source in self.scene.vocabulary.places:
            self.scene.said.last_place = where.source
        return where, home

    @staticmethod
    def _which_of(where: Where) -> NotUnderstood:
        return NotUnderstood(f"{where.text!r} could be {one_of(where.each)}: say which")

    def _to_each(self, moved: Sequence[Subject], where: Where) -> None:
        """Wish that another one is in each of several places: "a cup in every room".

        Raises:
            NotUnderstood: there are fewer than places, or it does not leave open which ones.
        """
        mentions = [self.from_where(self.who.drivers(self.who.movable(s)), where) for s in moved]
        if len(mentions) != 1 or not mentions[0].open:
            raise self._which_of(where)
        if len(where.each) > len(mentions[0].subjects):
            raise NotUnderstood(
                f"{where.text!r} are {len(where.each)}, and there are only "
                f"{len(mentions[0].subjects)} for them: {one_of(mentions[0].subjects)}"
            )
        for number, place in enumerate(where.each, 1):
            # Each is one of its own: negative keys are those of no word.
            one = replace(mentions[0], key=-(1000 * (mentions[0].key + 1) + number))
            if one.type == "robot":
                self.scene.said.draft.add(AT, one, self.places.place_of(place))
            else:
                self.homes.to_spot(one, place)
        self.scene.said.moved = []
        self.scene.said.remember([])

    def to_target(self, moved: Sequence[Subject], where: Where, home: bool) -> None:
        """Wish that these are at the target, or at home."""
        if where.each:
            return self._to_each(moved, where)
        for subject in moved if not home and where.source is None else ():
            self._not_too_many(subject)
        self.scene.said.moved = list(moved)
        able = [self.who.drivers(self.who.movable(subject)) for subject in moved]
        able = [self.homes.with_homes(subject) for subject in able] if home else able
        mentions = [self.from_where(subject, where) for subject in able]
        for mention in mentions:
            if home:
                self.homes.home(mention)
            elif where.target is None:
                raise self.no_target()
            elif where.target_type == "robot" and mention.type == "robot":
                raise NotUnderstood("a robot goes to a place, not to a robot: name the place")
            else:
                self._put(mention, where, where.target)
        self.scene.said.remember(mentions)
        self.scene.said.spoken_of([where.target] if where.target else [])
        if where.target is not None and where.target_type == "robot":
            receiver = Mention((where.target,), "robot", self.scene.said.ended)
            self.scene.said.recent = [*self.scene.said.recent, receiver]
        return None

    def _not_too_many(self, subject: Subject) -> None:
        """Whether so much may go to one place: "bring everything to the garage".

        Raises:
            NotUnderstood: it would be nearly all that there is.
        """
        if not isinstance(subject, NounPhrase) or not subject.generic or subject.source is not None:
            return
        if subject.type != "object" or subject.quantity is not Quantity.ALL:
            return
        movable = self.who.movable(subject)
        if isinstance(movable, NounPhrase) and len(movable.names) > _MOST:
            raise NotUnderstood(
                f"{subject.text!r} would be {len(movable.names)} things: say of what kind they "
                "are, or where"
            )

    def _put(self, mention: Mention, where: Where, target: str) -> None:
        if mention.type == "robot":
            return self.scene.said.draft.add(AT, mention, self.places.place_of(target))
        kept = tuple(name for name in mention.subjects if name != target)
        if not kept:
            raise NotUnderstood("nothing can be on or in itself: say where else it shall be")
        others = replace(mention, subjects=kept, open=mention.open and len(kept) > 1)
        handed = where.target_type == "robot" or self.scene.vocabulary.is_person(target)
        return self.scene.said.draft.add(
            where.relation, others, target, on_robot=handed, for_now=where.for_speaker
        )

    def no_target(self) -> NotUnderstood:
        """It is not said where to."""
        verb, clause = self.scene.said.verb, self.scene.said.clause
        said = f"{verb!r} in {clause!r}" if verb else f"{clause!r}"
        return NotUnderstood(
            f"{said} does not say where to: name a place; known are "
            f"{listed(self.scene.lexicon.known(('place',)))}"
        )
