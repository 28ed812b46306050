"""What must never be so: "never go to the kitchen", "don't put cups on the sofa"."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import HOW_TO_REST, one_of
from fleet.language.resolve.frames import Frame, framed, frames_of
from fleet.language.resolve.goals.deeds import Deeds
from fleet.language.resolve.location.places import WHERE
from fleet.language.resolve.reference.mentions import NounPhrase, Subject
from fleet.language.resolve.scene import THINGS
from fleet.language.resolve.stages import GoalDraft
from fleet.language.tagging.skill_words import SkillFrame
from fleet.language.tree.nodes import Argument, Clause, Noun, Nouns, Place, Quantity
from keyexpr_schema.facts import AT
from keyexpr_schema.payloads.goals import Condition

_MOVING = frozenset({"move", "go", "drive"})
"""Verbs that say, with no place behind them, that somebody moves."""


class Forbidding:
    """Turns clauses about what must not be done into conditions that must never hold."""

    def __init__(self, deeds: Deeds) -> None:
        ground, self.wishes, self.moving, self.looking, self.skilled, self.tidiness = deeds
        self.scene, self.who, self.nouns, self.places = ground

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
        if clause.subject is None:  # "don't let anybody into the bedroom"
            names = self.who.able_to_drive()
        elif not self.nouns.can_be(clause.subject, ("robot",)):
            return self.on_none_there(clause)
        else:
            names = self.who.all_of(self._all_of(clause.subject))
        places = self._entered(framed(clause.arguments))
        self.scene.said.never.extend(
            Condition(relation=AT, subject=name, value=place) for name in names for place in places
        )
        return None

    def on_never_do(self, clause: Clause) -> None:
        """`never go to the kitchen`, `the hsr should never enter it`."""
        assert clause.verb is not None
        who = None
        if clause.subject is not None:
            who = self._all_of(clause.subject)
        self._never(clause, who)

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
        for arguments in _each_place(tuple(map(_all_of_it, clause.arguments))):
            self._forbid(replace(clause, arguments=arguments), who)

    def _forbid(self, clause: Clause, who: Sequence[Subject] | None) -> None:
        verb = clause.verb
        assert verb is not None
        frames = frames_of(self.scene.tagger, verb, clause.arguments, ("VERB", "FIN", "GER"))
        things = [a for a in clause.arguments if isinstance(a, Nouns)]
        moved = bool(things) and self.nouns.can_be(things[-1], ("object",))
        going = [frame for frame, _ in frames if "go" in frame.senses and not moved]
        if going:
            where = self._entered(going[0])
            names = self.who.all_of(who or ()) or self.who.able_to_drive()
            self.scene.said.never.extend(
                Condition(relation=AT, subject=name, value=place)
                for name in names
                for place in where
            )
            return None
        if who and set(self.who.all_of(who)) < set(self.scene.vocabulary.robots):
            raise NotUnderstood(
                f"{verb.text!r} can be forbidden to all robots only, as what must never "
                'be so: say "never …", or forbid this robot a place'
            )
        problems: list[NotUnderstood] = []
        for frame, phrases in frames:
            try:
                return self._not_so(self._done(frame, phrases))
            except NotUnderstood as problem:
                problems.append(problem)
        raise problems[0] if problems else self._no_state(verb.text)

    def _done(self, frame: Frame, phrases: Sequence[SkillFrame]) -> tuple[Condition, ...]:
        """What would hold if it were done.

        Raises:
            NotUnderstood: nothing that must never be so says it.
        """
        for noun in (noun for nouns in frame.themes for noun in nouns.items):
            if noun.count is not None and not noun.ordinals:
                text = self.scene.said.quote(noun.first, noun.last)
                raise NotUnderstood(f"{text!r}: it is forbidden of none or of all, not of some")
        said = self.scene.said
        draft, said.draft = said.draft, GoalDraft(self.scene.vocabulary.is_at, never=True)
        try:
            if phrases:
                self.skilled.skill(frame, phrases)
            else:
                self._placed(frame)
            return tuple(c for stage in said.draft.conditions() for c in stage)
        finally:
            said.draft, said.elliptic = draft, ""

    def _placed(self, frame: Frame) -> None:
        taken = "hold" in frame.senses or frame.verb == "move"
        goes = [p for p in frame.places if p.role != "from"]
        if "bin" in frame.senses:
            return self.tidiness.throw_away(frame)
        if frame.verb == "leave" or frame.home or frame.particle_words:
            raise self._no_state(frame.verb)
        if "move" in frame.senses or "give" in frame.senses:
            if taken and not goes and len(frame.themes) == 1:  # "don't move the vase"
                self._check_rests(frame)
                return self.looking.pick(replace(frame, places=()))
            if goes or len(frame.themes) == 2:
                return self.moving.move(frame)
        elif "pick" in frame.senses:
            return self.looking.pick(frame)
        raise self._no_state(frame.verb)

    def _check_rests(self, frame: Frame) -> None:
        """Whether what it must not be taken from is a thing: off that it is as soon as it is held.

        Raises:
            NotUnderstood: it is a place, in which it may be held.
        """
        if not frame.places:
            return
        where, _ = self.wishes.whereto(frame, fetching=True)
        if where.source not in self.scene.vocabulary.objects:
            raise self._no_state(frame.verb)

    def _no_state(self, verb: str) -> NotUnderstood:
        return NotUnderstood(
            f"{verb!r} is nothing that can be forbidden here: going to a place can be, putting a "
            "thing somewhere, taking it, and what a skill does"
        )

    def _not_so(self, rows: Sequence[Condition]) -> None:
        """Keep what must never be so.

        Raises:
            NotUnderstood: the text wants it as well.
        """
        for stage in self.scene.said.draft.stages:
            for wish in stage:
                one = wish.condition()
                both = [
                    row for row in rows if row.value == one.value and row.relation == one.relation
                ]
                if not wish.open and any(row.subject == one.subject for row in both):
                    raise NotUnderstood(f"it wants {one}, and that this never be so: say which")
        self.scene.said.never.extend(rows)

    def _entered(self, frame: Frame) -> list[str]:
        nouns = list(frame.themes) + [p.nouns for p in frame.places if p.nouns is not None]
        for place in (p for p in frame.places if p.role not in (*WHERE, "via")):
            raise self.places.relations.unknown(place)
        if not nouns or frame.particle_words:
            rest = f"; {HOW_TO_REST}" if frame.verb in _MOVING else ""
            said = self.scene.said.clause
            raise NotUnderstood(f"{said!r} does not say which place: name it{rest}")
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


def _all_of_it(argument: Argument) -> Argument:
    """The same, of all of whom it may be said: what no cup may be, "a cup" and "cups" may not."""
    if isinstance(argument, Nouns):
        return replace(argument, items=tuple(map(_all, argument.items)), either=False)
    if isinstance(argument, Place) and argument.nouns is not None:
        return replace(argument, nouns=replace(argument.nouns, either=False))
    return argument


def _all(noun: Noun) -> Noun:
    open_ = noun.quantity in (Quantity.ANY, Quantity.BARE) and noun.form in ("noun", "general")
    named = noun.count is not None or noun.numbers or noun.other
    return replace(noun, quantity=Quantity.ALL) if open_ and not named else noun


def _each_place(arguments: Sequence[Argument]) -> Iterator[tuple[Argument, ...]]:
    """The arguments for each of the places: "on the sofa or the bed"."""
    at = next(
        (i for i, a in enumerate(arguments)
         if isinstance(a, Place) and a.nouns is not None and len(a.nouns.items) > 1),
        None,
    )  # fmt: skip
    if at is None:
        yield tuple(arguments)
        return
    place = arguments[at]
    assert isinstance(place, Place) and place.nouns is not None
    for noun in place.nouns.items:
        one = replace(place, nouns=Nouns((noun,)))
        yield (*arguments[:at], one, *arguments[at + 1 :])
