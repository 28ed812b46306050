"""What must never be so, and where nobody may go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import one_of
from fleet.language.resolve.frames import Frame, framed, frames_of
from fleet.language.resolve.ground import Ground
from fleet.language.resolve.mentions import NounPhrase, Subject
from fleet.language.resolve.places import WHERE
from fleet.language.resolve.scene import THINGS
from fleet.language.resolve.skilled import Skilled
from fleet.language.resolve.stages import GoalDraft
from fleet.language.resolve.wishes import Wishes
from fleet.language.tree.nodes import Clause, Nouns, Quantity
from keyexpr_schema.facts import AT
from keyexpr_schema.payloads.goals import Condition


class Forbidding:
    """Turns clauses with "never", "no" and "avoid" into what must never be so."""

    def __init__(self, ground: Ground, wishes: Wishes, skilled: Skilled) -> None:
        self.scene, self.who, self.nouns, self.places = ground
        self.wishes, self.skilled = wishes, skilled

    def on_none_there(self, clause: Clause) -> None:
        """`no forklift in the packing area`."""
        assert clause.subject is not None
        where, home = self.wishes.whereto(framed(clause.arguments))
        if where.target is None or home:
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say where: name a place")
        self.scene.said.never.extend(
            Condition(relation=where.relation, subject=name, value=where.target)
            for s in self.nouns.subjects(clause.subject, THINGS, "an object or a robot")
            for name in s.names
        )

    def on_not_allowed(self, clause: Clause) -> None:
        """`Scout isn't allowed in the office`."""
        assert clause.subject is not None
        who = self._all_of(clause.subject)
        names = self.who.all_of(who)
        places = self._entered(framed(clause.arguments))
        self.scene.said.never.extend(
            Condition(relation=AT, subject=name, value=place) for name in names for place in places
        )

    def on_never_do(self, clause: Clause) -> None:
        """`never go to the kitchen`, `the hsr should never enter it`."""
        assert clause.verb is not None
        who = None
        if clause.subject is not None:
            who = self._all_of(clause.subject)
        self._never(clause, who)

    def _all_of(self, nouns: Nouns) -> list[Subject]:
        """The robots that must not: "robots" are all of them."""
        return [
            replace(s, quantity=Quantity.ALL)
            if isinstance(s, NounPhrase) and s.plural and s.quantity is Quantity.BARE
            else s
            for s in self.nouns.subjects(nouns, ("robot",), "a robot")
        ]

    def _never(self, clause: Clause, who: Sequence[Subject] | None) -> None:
        assert clause.verb is not None
        frames = frames_of(self.scene.tagger, clause.verb, clause.arguments, ("VERB", "FIN", "GER"))
        going = [frame for frame, _ in frames if "go" in frame.senses]
        making = [(frame, phrases) for frame, phrases in frames if phrases]
        if going:
            where = self._entered(going[0])
            names = self.who.all_of(who or ())
            names = names or self.who.able_to_drive()
            self.scene.said.never.extend(
                Condition(relation=AT, subject=name, value=place)
                for name in names
                for place in where
            )
            return
        if making:
            if who and set(self.who.all_of(who)) < set(self.scene.vocabulary.robots):
                raise NotUnderstood(
                    f"{clause.verb.text!r} can be forbidden to all robots only, as what must never "
                    'be so: say "never …", or forbid this robot a place'
                )
            draft, self.scene.said.draft = (
                self.scene.said.draft,
                GoalDraft(self.scene.vocabulary.is_at, never=True),
            )
            try:
                self.skilled.skill(*making[0])
                self.scene.said.never.extend(
                    c for s in self.scene.said.draft.conditions() for c in s
                )
            finally:
                self.scene.said.draft = draft
            return
        raise NotUnderstood(
            f"{clause.verb.text!r} is nothing that can be forbidden: going to a place can be, and "
            "what a skill does"
        )

    def _entered(self, frame: Frame) -> list[str]:
        nouns = list(frame.themes) + [p.nouns for p in frame.places if p.nouns is not None]
        for place in (p for p in frame.places if p.role not in (*WHERE, "via")):
            raise self.places.relations.unknown(place)
        if not nouns or frame.particle_words:
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say which place: name it")
        return [name for each in nouns for name in self._rooms(each)]

    def _rooms(self, nouns: Nouns) -> list[str]:
        """Places that robots can be in.

        Raises:
            NotUnderstood: it is a thing.
        """
        names = [n for m in self.places.place_mentions(nouns) for n in m.subjects]
        if things := [n for n in names if n not in self.scene.vocabulary.places]:
            raise NotUnderstood(f"{one_of(things)} is no place that a robot can be in: name one")
        return names

    def on_avoid(self, clause: Clause) -> None:
        """`avoid the kitchen`, `without entering the kitchen`."""
        if clause.verb is not None:
            return self._never(clause, self.scene.said.addressees or None)
        assert clause.subject is not None
        self.scene.said.never.extend(
            Condition(relation=AT, subject=name, value=place)
            for name in self.who.able_to_drive()
            for place in self._rooms(clause.subject)
        )
        return None
