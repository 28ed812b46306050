"""Clauses that go on from one before: "and then to the kitchen", "and the second one"."""

from __future__ import annotations

from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import one_of
from fleet.language.resolve.claims import Claims
from fleet.language.resolve.frames import framed, nothing_said
from fleet.language.resolve.goals.commands import Commands
from fleet.language.resolve.goals.wishes import Wishes
from fleet.language.resolve.ground import Ground
from fleet.language.resolve.location.places import WHERE, Where
from fleet.language.resolve.reference.mentions import Mention, NounPhrase, Subject
from fleet.language.resolve.scene import PLACES, THINGS
from fleet.language.tree.nodes import (
    Clause,
    Nouns,
    Place,
    Quantity,
)
from keyexpr_schema.facts import HELD


class Continuations:
    """Turns clauses that go on from one before into wishes."""

    def __init__(self, ground: Ground, wishes: Wishes, claims: Claims, commands: Commands) -> None:
        self.scene, self.who, self.nouns, self.places = ground
        self.wishes = wishes
        self.claims = claims
        self.commands = commands

    def on_bare(self, clause: Clause) -> None:
        """`and the book to the kitchen`, `and the second cup in the hallway`."""
        assert clause.subject is not None
        if self.scene.said.elliptic == "is":
            return self.claims.placed(clause.subject, clause.arguments)
        if self.scene.mode == "fact":
            return self.claims.placed(clause.subject, clause.arguments)
        said = self.scene.said
        self.places_are_known(clause)
        last = said.draft.last
        if last is not None and last.whereto and (clause.subject.either or last.open):
            raise NotUnderstood(
                f"it does not say where to bring {one_of(last.subjects)}: it leaves open what "
                "goes together; say one after the other"
            )
        if not said.elliptic and said.clauses:
            raise NotUnderstood(f"{said.clause!r} does not say what shall be done with it")
        if not said.elliptic:
            said.telegraphic = True
            said.elliptic = "move"
        frame, beneficiary = self.wishes.for_whom(framed(clause.arguments))
        if beneficiary is not None and not frame.places:
            return self._to_person(clause.subject, beneficiary)
        who = self.nouns.subjects(clause.subject, THINGS, "an object or a robot")
        verb = said.verb.split()[:1] if said.elliptic == "move" else []
        fetching = bool(verb) and verb[0] in self.scene.tagger.book.fetching
        where, home = self.wishes.whereto(framed(clause.arguments), each=True, fetching=fetching)
        last = said.draft.last
        if last is not None and last.relation == HELD and where.target and said.elliptic == "move":
            # "take the teddy from the sofa and the doll from the box to Lily"
            who = [Mention(last.subjects, "object", last.key, last.open), *who]
        return self.wishes.to_target(who, where, home)

    def on_whereto(self, clause: Clause) -> None:
        """`and then to the kitchen`."""
        self.places_are_known(clause)
        if not self.scene.said.elliptic or not (self.scene.said.recent or self.scene.said.moved):
            raise nothing_said(self.scene.said.clause, self.scene.mode)
        where, home = self.wishes.whereto(framed(clause.arguments))
        same: list[Subject] = list(self.scene.said.recent[:1]) or self.scene.said.moved
        return self.wishes.to_target(same, where, home)

    def on_named(self, clause: Clause) -> None:
        assert clause.subject is not None
        said = self.scene.said
        if not said.elliptic and self.commands.once_more(clause):
            return None
        strange = any("UNK" in w.tags for n in clause.subject.items for w in n.head)
        if self.scene.said.elliptic and not strange and self.nouns.can_be(clause.subject, PLACES):
            raise NotUnderstood(
                f"{self.scene.said.clause!r} is one place too many for one thing; if one is to "
                'come after the other, say "then"'
            )
        if self.scene.said.elliptic and not strange:
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say where to: name a place")
        one = clause.subject.items[0]
        asked = one.quantity.name == "ANY" or "SOMETHING" in ((one.head and one.head[0].tags) or ())
        speaker = self.scene.vocabulary.speaker
        if asked and speaker is not None and not strange and self.scene.mode == "":
            return self._to_person(clause.subject, speaker)
        raise nothing_said(self.scene.said.clause, self.scene.mode)

    def places_are_known(self, clause: Clause) -> None:
        """Refuse what is under or beside something first.

        Raises:
            NotUnderstood: a phrase of place has a relation that is not known.
        """
        for place in clause.arguments:
            if isinstance(place, Place) and place.role not in ("for", *WHERE):
                self.wishes.places.locative(place)

    def topic(self, clause: Clause) -> None:
        """`that blanket on the couch, fold it`: what the rest of the sentence is about."""
        assert clause.subject is not None
        places = tuple(a for a in clause.arguments if isinstance(a, Place))
        last = replace(clause.subject.items[-1], places=places)
        nouns = replace(clause.subject, items=(*clause.subject.items[:-1], last))
        types = THINGS if self.nouns.can_be(nouns, THINGS) else PLACES
        found = self.nouns.subjects(nouns, types, "an object, robot or place")
        self.scene.said.remember([self.who.resolve(subject) for subject in found])

    def _to_person(self, nouns: Nouns, person: str) -> None:
        things = self.nouns.subjects(nouns, ("object",), "an object")
        where = Where(target=person, target_type="object")
        return self.wishes.to_target(things, where, False)

    def on_enough(self, clause: Clause) -> None:
        """`a bottle in the kitchen would do`: which of what was asked for before, and where to."""
        assert clause.subject is not None
        noun = self.nouns.subject(clause.subject.items[0], ("object",), "an object")
        will_do = self.who.resolve(self.who.movable(noun)).subjects
        asked = [m for m in self.scene.said.recent if m.open and set(m.subjects) & set(will_do)]
        speaker = self.scene.vocabulary.speaker
        anything = isinstance(noun, NounPhrase) and noun.quantity is Quantity.ANY
        if not asked and anything and not clause.arguments and speaker and not self.scene.mode:
            return self._to_person(clause.subject, speaker)  # "some fruit would be nice"
        if len(asked) != 1:
            raise NotUnderstood(
                f"{self.scene.said.clause!r}: nothing was asked for before that it could do for"
            )
        meant = self.scene.said.draft.narrow(asked[0], will_do)
        self.scene.said.remember([meant])
        if clause.arguments:
            where, home = self.wishes.whereto(framed(clause.arguments))
            self.wishes.to_target([meant], where, home)
        return None
