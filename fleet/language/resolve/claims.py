"""Facts that statements claim, checked against each other."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import one_of
from fleet.language.resolve.frames import SAY_IT, framed, frames_of, no_fact
from fleet.language.resolve.goals.wishes import Wishes
from fleet.language.resolve.ground import Ground
from fleet.language.resolve.reference.mentions import Mention, NounPhrase
from fleet.language.resolve.reference.states import of_each
from fleet.language.resolve.scene import PLACES, THINGS
from fleet.language.tagging.tagger import Lexeme
from fleet.language.tree.nodes import (
    Argument,
    Clause,
    Nouns,
    Place,
)
from keyexpr_schema.facts import (
    AT,
    HOLDING,
    NOTHING,
    ON,
    SEARCHED,
    FactKey,
    Value,
)

_NEGATED = re.compile(r"\b(?:\w+n't|not?|no longer|never)\b", re.IGNORECASE)


class Claims:
    """Collects facts; a later one may not contradict an earlier one."""

    def __init__(self, ground: Ground, wishes: Wishes) -> None:
        self.scene, self.who, self.nouns, self.places = ground
        self._unknown = False
        """Whether what is told is that nobody knows."""
        self.wishes = wishes

    def fact(self, relation: str, subject: str, value: Value) -> None:
        """Keep a fact.

        Raises:
            NotUnderstood: the text said something else of it.
        """
        value = None if self._unknown else value
        before = self.scene.said.facts.setdefault(key := FactKey(relation, subject), value)
        self.scene.said.told.append((key, value))
        if before != value:
            shown = ["nobody knows where" if v is None else str(v) for v in (before, value)]
            raise NotUnderstood(f"it says two things of {key}: {' and '.join(shown)}")

    def placed(self, nouns: Nouns, arguments: Sequence[Argument]) -> None:
        """These are somewhere.

        Raises:
            NotUnderstood: it is not said where, or in two places, or which of several.
        """
        self.scene.said.elliptic = "is"
        if nouns.either:
            raise NotUnderstood("'or' leaves a choice that cannot be left open; say one of them")
        frame = framed(arguments)
        if len(nouns.items) == 1 and nouns.items[0].form == "noun":
            self._speak_of(nouns)
        where, home = self.wishes.whereto(frame)
        if home or not frame.places:
            raise no_fact(self.scene.said.clause)
        if where.source is not None or where.target is None:
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say one place: {SAY_IT}")
        self.put(nouns, where.target, where.target_surface)

    def _speak_of(self, nouns: Nouns) -> None:
        """Whom "her" means in "Carla is in her office"."""
        if self.nouns.can_be(nouns, ("object",)):
            subject = self.nouns.subject(nouns.items[0], ("object",), "an object")
            if isinstance(subject, NounPhrase):
                self.scene.said.spoken_of(subject.names)

    def settled(self, nouns: Nouns, target: str | None = None) -> list[Mention]:
        mentions = [
            self.who.resolve(s)
            for s in self.nouns.subjects(nouns, THINGS, "an object, robot or place")
        ]
        is_at = self.scene.vocabulary.is_at
        for i, mention in enumerate(mentions):
            there = tuple(n for n in mention.subjects if target and is_at(n, target))
            if mention.open and len(there) == 1:  # "there's a mug on the table", of one there
                mentions[i] = mention = replace(mention, subjects=there, open=False)
            if mention.open:
                raise NotUnderstood(
                    f"{self.scene.said.clause!r} does not say which of "
                    f"{one_of(mention.subjects)}: name it"
                )
        return mentions

    def put(self, nouns: Nouns, target: str, surface: str | None = None) -> None:
        """These are at the target, on a surface there if one is named."""
        mentions = self.settled(nouns, target)
        for mention in mentions:
            if mention.type == "robot" and target in self.scene.vocabulary.robots:
                raise NotUnderstood("a robot is at a place, not on a robot: name the place")
            if target in mention.subjects:
                raise NotUnderstood("nothing can be on or in itself: say where else it shall be")
            for name in mention.subjects:
                robot = mention.type == "robot"
                self.fact(AT, name, self.places.place_of(target) if robot else target)
                if surface is not None and not robot:
                    self.fact(ON, name, surface)
        self.scene.said.remember(mentions)

    def lost(self, nouns: Nouns) -> None:
        """Nobody knows where these are."""
        mentions = self.settled(nouns)
        for name in (name for mention in mentions for name in mention.subjects):
            self.fact(AT, name, None)
        self.scene.said.remember(mentions)

    def holding(self, robots: Sequence[Mention], held: Nouns | None, in_hand: bool) -> None:
        """What a robot has in its hand (`None`: nothing) or on it."""
        names = [name for robot in robots for name in robot.subjects]
        things = self.settled(held) if held is not None else []
        objects = [name for thing in things for name in thing.subjects]
        if held is not None and (len(names) != 1 or (in_hand and len(objects) != 1)):
            raise NotUnderstood(
                f"{self.scene.said.clause!r}: one hand holds one thing; say who holds what"
            )
        for name in names:
            if in_hand:
                self.fact(HOLDING, name, objects[0] if objects else NOTHING)
            for thing in objects:
                self.fact(AT, thing, name)

    def looked_around(self, nouns: Nouns | None, value: bool) -> None:
        """Somebody looked around in these places, or nobody did."""
        if nouns is None:
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say where: name a place")
        names = [n for m in self.places.place_mentions(nouns) for n in m.subjects]
        if not value and len(names) > 1:
            raise NotUnderstood(
                f"{self.scene.said.clause!r} could mean all or some of them: "
                "say it of one place at a time"
            )
        for place in names:
            self.fact(SEARCHED, place, value)

    def check_mode(self) -> None:
        """Whether statements are understood here."""
        if self.scene.mode == "goal":
            raise NotUnderstood(
                f"{self.scene.said.line!r} states a fact; a goal says what should be: "
                '"the cup should be in the hallway"'
            )

    def are(self, nouns: Nouns, words: Sequence[Lexeme], negated: bool) -> None:
        self.scene.said.elliptic = "are"
        if self.nouns.can_be(nouns, THINGS):
            mentions = self.settled(nouns)
            self.scene.said.remember(mentions)
        else:
            mentions = self.places.place_mentions(nouns)
        for word in words:
            named = [self.nouns.parts.stated(mention, word, negated) for mention in mentions]
            names = [name for mention in named for name in mention.subjects]
            for relation, name, value in of_each(self.scene.stated, [word], names, negated):
                self.fact(relation, name, value)

    def on_not_being(self, clause: Clause) -> None:
        if clause.predicate is not None and clause.predicate.kind == "state":
            self.check_mode()
            assert clause.subject is not None
            return self.are(clause.subject, clause.predicate.words, True)
        if clause.predicate is not None and clause.predicate.kind == "done":
            return self.were(clause, False)
        raise self.not_so()

    def not_so(self) -> NotUnderstood:
        """What is said to be not so."""
        if self.scene.mode == "goal":
            return NotUnderstood(
                f"{self.scene.said.clause!r} says what must not be, or leaves something out; "
                "say what must hold, name by name"
            )
        return NotUnderstood(
            f"{_negation(self.scene.said.clause)} says what is not so, which tells nobody where "
            'things are: say where it is, or "nobody knows where … is"'
        )

    def were(self, clause: Clause, value: bool) -> None:
        """`The kitchen was searched`."""
        self.check_mode()
        predicate = clause.predicate
        word = predicate.words[0].word if predicate is not None and predicate.words else ""
        assert clause.subject is not None
        states = self.scene.stated.states
        if predicate is not None and predicate.words and predicate.words[0].words in states:
            names = {
                n
                for types in (THINGS, PLACES)
                if self.nouns.can_be(clause.subject, types)
                for s in self.nouns.subjects(clause.subject, types, "an object")
                for n in (s.subjects if isinstance(s, Mention) else s.names)
            }
            if not predicate.arguments and names & self.scene.stated.able(predicate.words[0]):
                return self.are(clause.subject, predicate.words[:1], not value)
        if word not in self.scene.tagger.book.searched or (predicate and predicate.arguments):
            if predicate and predicate.kind == "done" and predicate.arguments and value:
                return self.placed(clause.subject, predicate.arguments)
            raise no_fact(
                self.scene.said.clause,
                predicate.words[0].text if predicate and predicate.words else "",
            )
        if not self.nouns.can_be(clause.subject, PLACES):
            raise NotUnderstood(f"{self.scene.said.clause!r}: only places are searched")
        return self.looked_around(clause.subject, value)

    def on_gone_to(self, clause: Clause) -> None:
        """`the guest has gone to the bathroom`."""
        self.check_mode()
        assert clause.subject is not None
        self.placed(clause.subject, clause.arguments)

    def on_gone(self, clause: Clause) -> None:
        """`the pizza has gone cold`."""
        self.check_mode()
        assert clause.subject is not None
        self.are(clause.subject, [w for w in clause.words if "ADJ" in w.tags][-1:], False)

    def on_left_so(self, clause: Clause) -> None:
        """`somebody left the fridge open`."""
        self.check_mode()
        things = [a for a in (clause.subject, *clause.arguments) if isinstance(a, Nouns)][-1]
        words = [w for w in clause.words if "ADJ" in w.tags][-1:]
        self.are(things, words, False)

    def on_did(self, clause: Clause) -> None:
        """`Ben opened the door`, `we moved the crate to aisle 3`, `I have searched the kitchen`."""
        self.check_mode()
        self._done_by_somebody(clause, True)

    def on_not_done(self, clause: Clause) -> None:
        """`nobody has searched the kitchen`."""
        self.check_mode()
        self._done_by_somebody(clause, False)

    def _done_by_somebody(self, clause: Clause, value: bool) -> None:
        verb = clause.verb
        assert verb is not None
        refusal = no_fact(self.scene.said.clause, verb.text)
        for frame, skills in frames_of(self.scene.tagger, verb, clause.arguments, ("PART",)):
            if "go" in frame.senses and not frame.themes and value and clause.subject is not None:
                if [place.role for place in frame.places] == ["to"]:
                    return self.placed(clause.subject, frame.places)
                continue
            if len(frame.themes) != 1 and not (frame.places and "search" in frame.senses):
                continue
            if skills and not frame.places:
                phrase = skills[0].phrase
                if phrase.type == "place":
                    names = [
                        n for m in self.places.place_mentions(frame.themes[0]) for n in m.subjects
                    ]
                else:
                    names = [n for m in self.settled(frame.themes[0]) for n in m.subjects]
                for name in names:
                    for relation, wanted in phrase.wants:
                        if not value and not isinstance(wanted, bool):
                            raise refusal
                        self.fact(relation, name, wanted if value else not wanted)
                return None
            if "search" in frame.senses and "move" not in frame.senses:
                nouns = frame.themes[0] if frame.themes else frame.places[0].nouns
                return self.looked_around(nouns, value)
            if "move" in frame.senses and frame.places and value:
                return self.placed(frame.themes[0], frame.places)
        raise refusal

    def on_was(self, clause: Clause) -> None:
        predicate = clause.predicate
        done = predicate is not None and all("PART" in word.tags for word in predicate.words)
        if done and predicate is not None and predicate.kind in ("done", "state"):
            return self.were(clause, not clause.has("NOT"))
        was = next(word.text for word in clause.words if "WAS" in word.tags)
        raise NotUnderstood(f"{was!r} tells of the past; say what holds now")

    def on_been(self, clause: Clause) -> None:
        return self.were(clause, not clause.has("NOT"))

    def on_anywhere(self, clause: Clause) -> None:
        self.check_mode()
        assert clause.subject is not None
        self.lost(clause.subject)

    def on_unknown(self, clause: Clause) -> None:
        self.check_mode()
        assert clause.subject is not None
        self.lost(clause.subject)

    def on_inverted(self, clause: Clause) -> None:
        self.check_mode()
        assert clause.subject is not None
        self.placed(clause.subject, [a for a in clause.arguments if isinstance(a, Place)])

    def on_has(self, clause: Clause) -> None:
        self.check_mode()
        self._carries(clause, in_hand=False)

    def on_grips(self, clause: Clause) -> None:
        self.check_mode()
        self._carries(clause, in_hand=True)

    def _carries(self, clause: Clause, in_hand: bool) -> None:
        assert clause.subject is not None
        held = next((a for a in clause.arguments if isinstance(a, Nouns)), None)
        if self.nouns.can_be(clause.subject, ("robot",)):
            robots = [
                self.who.resolve(s)
                for s in self.nouns.subjects(clause.subject, ("robot",), "a robot")
            ]
            if any(robot.open for robot in robots):
                raise NotUnderstood(f"{self.scene.said.clause!r} does not say which robot: name it")
            if held is None and not in_hand:
                raise NotUnderstood('what lies in a basket is said thing by thing, not "nothing"')
            return self.holding(robots, held, in_hand)
        if held is None:
            raise no_fact(self.scene.said.clause)
        if self.nouns.can_be(clause.subject, ("object",)):
            by = [n for m in self.settled(clause.subject) for n in m.subjects]
            person = len(by) == 1 and self.scene.vocabulary.is_person(by[0])
            if len(by) != 1 or not (
                person or (by[0] in self.scene.vocabulary.good_for and not in_hand)
            ):
                raise no_fact(self.scene.said.clause)
            return self.put(held, by[0])
        places = [n for m in self.places.place_mentions(clause.subject) for n in m.subjects]
        if len(places) != 1 or in_hand:
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say one place: {SAY_IT}")
        return self.put(held, places[0])

    def on_hand_empty(self, clause: Clause) -> None:
        self.check_mode()
        assert clause.subject is not None
        robots = [
            self.who.resolve(s) for s in self.nouns.subjects(clause.subject, ("robot",), "a robot")
        ]
        self.holding(robots, None, True)

    def on_seen(self, clause: Clause) -> None:
        self.check_mode()
        assert clause.subject is not None
        self.placed(clause.subject, clause.arguments)

    def on_speaker_at(self, clause: Clause) -> None:
        """`I am in the bedroom`."""
        speaker = self.scene.vocabulary.speaker
        where, _ = self.wishes.whereto(framed(clause.arguments))
        if speaker is None or where.target is None or self.scene.mode == "goal":
            raise NotUnderstood(
                f"{self.scene.said.clause!r} is no goal, and may matter: leave it out, or tell it "
                "as a fact"
            )
        self.fact(AT, speaker, where.target)

    def on_not_known(self, clause: Clause) -> None:
        """`nobody knows whether the fridge is open`: what was believed of that is so no more."""
        self.check_mode()
        predicate = clause.predicate
        if predicate is None or predicate.kind != "state" or clause.subject is None:
            raise NotUnderstood(
                f"{self.scene.said.clause!r} is not understood as a fact: what can be unknown is a "
                'state ("whether the door is open"), and where a thing is'
            )
        self._unknown = True
        try:
            self.are(clause.subject, predicate.words, False)
        finally:
            self._unknown = False

    def on_speaker_has(self, clause: Clause) -> None:
        """`I have the phone`."""
        speaker = self.scene.vocabulary.speaker
        if speaker is None or self.scene.mode == "goal" or clause.subject is None:
            raise NotUnderstood(
                f"{self.scene.said.clause!r} does not say who has it: name who does"
            )
        self.put(clause.subject, speaker)


def _negation(clause: str) -> str:
    """The word by which a clause says that something is not so, and the clause."""
    found = _NEGATED.search(clause)
    return f"{found[0]!r} in {clause!r}" if found is not None else f"{clause!r}"
