"""What shall be so, stay so or never be so: "the lamp should be off", "keep the door closed"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import one_of
from fleet.language.resolve.claims import Claims
from fleet.language.resolve.frames import EXAMPLE, SAY_IT, Frame, framed, frames_of, no_fact
from fleet.language.resolve.goals.deeds import Deeds
from fleet.language.resolve.reference.mentions import Mention
from fleet.language.resolve.scene import PLACES, THINGS
from fleet.language.resolve.stages import GoalDraft
from fleet.language.resolve.wish import PLACED
from fleet.language.tagging.skill_words import SkillFrame
from fleet.language.tagging.tagger import Lexeme
from fleet.language.tree.nodes import (
    Argument,
    Clause,
    Noun,
    Nouns,
    Place,
    Predicate,
)
from keyexpr_schema.facts import (
    HELD,
    LOCATED,
    SEARCHED,
)
from keyexpr_schema.payloads.goals import Condition

_DONE = {"find": LOCATED, "pick": HELD, "search": SEARCHED}
"""What holds when it has been done: "the book should be found"."""
_GUESSES = frozenset({"can", "could", "may", "would", "will"})


_AS_IT_IS = frozenset({("leave",), ("stays",), ("remains",)})
"""What is said of things that are where they shall be."""


class Shall:
    """Turns clauses about what shall be so into wishes."""

    def __init__(self, deeds: Deeds, claims: Claims) -> None:
        ground, self.wishes, _, self.looking, self.skilled, _ = deeds
        self.scene, self.who, self.nouns, self.places = ground
        self.claims = claims

    def on_shall_be(self, clause: Clause) -> None:
        modal = next((w.word for w in clause.words if "MODAL" in w.tags), "")
        if modal in _GUESSES and not clause.has("WISHIF"):
            if modal == "can" and clause.predicate is not None and clause.subject is not None:
                self.claims.check_mode()
                return self.claims.placed(clause.subject, clause.predicate.arguments)
            raise NotUnderstood(f"{modal!r} is uncertain; say what holds, or what should hold")
        if self.scene.mode == "fact":
            raise NotUnderstood(f"{self.scene.said.line!r} is a goal and not a fact: {SAY_IT}")
        got = any(w.word == "get" for w in clause.words)
        if got and clause.predicate is not None and clause.predicate.kind == "placed":
            raise NotUnderstood(f"{self.scene.said.clause!r}: that is what somebody does")
        return self.to_be(clause.subject, clause.predicate, clause.arguments)

    def to_be(
        self, subject: Nouns | None, predicate: Predicate | None, arguments: Sequence[Argument]
    ) -> None:
        """What follows "should be": a place, a state, or what should have been done."""
        assert subject is not None
        self.scene.said.elliptic, self.scene.said.addressees = "be", []
        places = not self.nouns.can_be(subject, THINGS) and self.nouns.can_be(subject, PLACES)
        if predicate is not None and predicate.kind == "state":
            return self._made(subject, predicate.words, places)
        if predicate is not None and predicate.kind == "done":
            return self._done_to(subject, predicate, places)
        if places:
            raise NotUnderstood(
                f"{self.scene.said.clause!r} is a place, and places stay where they are: {EXAMPLE}"
            )
        who = self.nouns.subjects(subject, THINGS, "an object or a robot")
        frame = framed(predicate.arguments if predicate is not None else arguments)
        if self.wishes.beside(who, frame):
            return None
        where, home = self.wishes.whereto(frame, each=True)
        return self.wishes.to_target(who, where, home)

    def _made(
        self, subject: Nouns, words: Sequence[Lexeme], places: bool, negated: bool = False
    ) -> None:
        for word in words:
            able = self.scene.stated.able(word)
            if places:
                mentions = self.places.place_mentions(subject)
            elif self.nouns.can_be(subject, ("object",)):
                things = self.nouns.subjects(subject, ("object",), "an object")
                fit = sorted(able)[:1]
                wants = self.scene.stated.wants(word, fit[0], negated) if fit else ()
                mentions = self.skilled.those(things, able, word.word, wants)
                self.scene.said.remember(mentions)
            else:
                mentions = [
                    self.who.resolve(s) for s in self.nouns.subjects(subject, ("robot",), "a robot")
                ]
            for mention in mentions:
                self.skilled.wish(
                    [mention], self.scene.stated.wants(word, mention.subjects[0], negated)
                )

    def _done_to(self, subject: Nouns, predicate: Predicate, places: bool) -> None:
        participle = predicate.words[0]
        by = next((a for a in predicate.arguments if self._names_doer(a)), None)
        if isinstance(by, Place) and by.nouns is not None:
            self.who.check_who(self.nouns.subjects(by.nouns, ("robot",), "a robot"))
            rest = tuple(a for a in predicate.arguments if a is not by)
            predicate = replace(predicate, arguments=rest)
        frames = frames_of(self.scene.tagger, participle, predicate.arguments, ("PART",))
        problems: list[NotUnderstood] = []
        for frame, phrases in frames:
            try:
                return self._passive(subject, frame, phrases, places)
            except NotUnderstood as problem:
                problems.append(problem)
        raise problems[0] if problems else NotUnderstood(f"{self.scene.said.clause!r}: {EXAMPLE}")

    def _names_doer(self, argument: Argument) -> bool:
        """`… shall be brought by Rosie`."""
        by = isinstance(argument, Place) and argument.preposition == "by"
        nouns = argument.nouns if isinstance(argument, Place) and by else None
        return nouns is not None and self.nouns.can_be(nouns, ("robot",))

    def _passive(
        self, subject: Nouns, frame: Frame, phrases: Sequence[SkillFrame], places: bool
    ) -> None:
        if phrases:
            return self.skilled.skill(replace(frame, themes=(subject, *frame.themes)), phrases)
        relation = next((name for sense, name in _DONE.items() if sense in frame.senses), None)
        if relation is not None and "move" not in frame.senses:
            self.scene.said.elliptic = ""
            if frame.places or frame.themes:
                raise NotUnderstood(f"{self.scene.said.clause!r}: say it as a command")
            return self._has_been(subject, relation)
        if places:
            raise NotUnderstood(f"{self.scene.said.clause!r}: places stay where they are")
        who = self.nouns.subjects(subject, THINGS, "an object or a robot")
        where, home = self.wishes.whereto(frame, each=True)
        return self.wishes.to_target(who, where, home or "tidy" in frame.senses)

    def _has_been(self, subject: Nouns, relation: str) -> None:
        wanted = PLACES if relation == SEARCHED else ("object",)
        if relation == SEARCHED and self.nouns.can_be(subject, PLACES):
            return self.looking.searched(
                [n for m in self.places.place_mentions(subject) for n in m.subjects]
            )
        who = self.nouns.subjects(subject, THINGS, "an object")
        mentions = [self.who.resolve(self.who.movable(s) if relation == HELD else s) for s in who]
        for mention in mentions:
            if mention.type not in wanted:
                raise NotUnderstood(
                    f"{self.scene.said.clause!r}: {relation} is said of "
                    f"{'places' if relation == SEARCHED else 'objects'} only"
                )
            self.scene.said.draft.add(relation, mention, True)
        return self.scene.said.remember(mentions)

    def on_guess(self, clause: Clause) -> None:
        """`should the door be open, …`: a condition, else a guess."""
        if self.scene.mode == "fact":
            return self.on_being(clause)
        said, what = self.scene.said.clause, clause.predicate
        shown = said
        if what is not None and what.words:
            shown = what.words[-1].text
        elif what is not None and what.arguments and isinstance(what.arguments[0], Place):
            shown = self.scene.said.quote(what.arguments[0].first, what.arguments[0].last)
        beside = f" in {said!r}" if shown != said else ""
        raise NotUnderstood(f"{shown!r}{beside} asks what may be: say what shall be")

    def on_needs(self, clause: Clause) -> None:
        """`Ben needs a screwdriver`, `Anna is in the garden and wants it`."""
        assert clause.subject is not None
        wanted = next((a for a in clause.arguments if isinstance(a, Nouns)), None)
        places = [a for a in clause.arguments if isinstance(a, Place)]
        if wanted is None:  # it was said before who
            wanted = clause.subject
            names = [n for m in self.scene.said.recent for n in m.subjects]
        else:
            persons = self.nouns.subjects(clause.subject, ("object",), "a person")
            names = self.who.all_of(persons)
            self.scene.said.spoken_of(names)
        if len(names) != 1 or not self.scene.vocabulary.is_person(names[0]):
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say what shall be so")
        things = self.nouns.subjects(wanted, ("object",), "an object")
        if places:  # that is where it shall be
            return self.wishes.to_target(things, *self.wishes.whereto(framed(places)))
        where = replace(self.places.where([]), target=names[0], target_type="object")
        self.scene.said.spoken_of(names)
        return self.wishes.to_target(things, where, False)

    def on_needs_done(self, clause: Clause) -> None:
        """`Ben wants his shirt washed`."""
        assert clause.subject is not None
        thing = next(a for a in clause.arguments if isinstance(a, Nouns))
        persons = self.nouns.subjects(clause.subject, ("object",), "a person")
        names = self.who.all_of(persons)
        if not all(map(self.scene.vocabulary.is_person, names)):
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say what shall be so")
        self.scene.said.spoken_of(names)
        word = [w for w in clause.words if w.tags & {"PART", "ADJ"}][-1]
        places = tuple(a for a in clause.arguments if isinstance(a, Place))
        kind = "done" if "PART" in word.tags else "state"
        if kind == "state" and places:
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say what shall be so")
        return self.to_be(thing, Predicate(kind, (word,), places), ())

    def on_remarked(self, clause: Clause) -> None:
        """`Mr Jones is thirsty`, `I can't reach the cookbook`: it asks for nothing by itself."""
        said = self.scene.said
        if self.scene.mode == "fact":
            raise no_fact(said.clause)
        nouns = [clause.subject] if clause.subject is not None else []
        for each in nouns:
            types = THINGS if self.nouns.can_be(each, THINGS) else PLACES
            found = self.nouns.subjects(each, types, "an object, robot or place")
            said.remember([self.who.resolve(subject) for subject in found])
        said.remarks.append(said.clause)

    def on_sought(self, clause: Clause) -> None:
        """`I can't find my key`."""
        assert clause.subject is not None
        verb = next(word for word in clause.words if "VERB" in word.tags)
        if ("find",) not in self.scene.tagger.verbs.heads(verb.words, "VERB"):
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say what shall be so")
        return self.looking.find_these(clause.subject, ())

    def on_bare_state(self, clause: Clause) -> None:
        """`and the curtains closed`, `lights off in the bathroom`."""
        assert clause.subject is not None
        words = [w for w in clause.words if "ADJ" in w.tags]
        if self.scene.question is not None:
            raise NotUnderstood(f"{self.scene.said.line!r} asks two things: ask one at a time")
        if self.scene.said.elliptic in ("is", "are") or self.scene.mode == "fact":
            return self.claims.are(clause.subject, words, False)
        said = self.scene.said
        if said.keeps:  # "keep the fridge closed and the lights off"
            if said.keeps != "kept" or clause.arguments:
                raise NotUnderstood(f"{said.clause!r} does not say whether that shall stay so, too")
            kept = self._aside(clause.subject, Predicate("state", tuple(words)))
            return said.always.extend(kept)
        ends = [token.word for token in said.tokens[said.ended : said.ended + 1]]
        if not said.elliptic and ends == ["?"]:
            raise NotUnderstood(
                f'{said.clause!r} may be asked, or asked for: say "are they …?" or what shall be'
            )
        if not said.elliptic:
            said.telegraphic = True
        said.elliptic = "be"
        subject = clause.subject
        if clause.arguments:
            placed = tuple(a for a in clause.arguments if isinstance(a, Place))
            last = replace(subject.items[-1], places=placed)
            subject = replace(subject, items=(*subject.items[:-1], last))
        places = not self.nouns.can_be(subject, THINGS) and self.nouns.can_be(subject, PLACES)
        return self._made(subject, words, places)

    def on_wanted(self, clause: Clause) -> None:
        assert clause.subject is not None
        if clause.predicate is not None:
            return self.to_be(clause.subject, clause.predicate, clause.arguments)
        self.scene.said.elliptic = "be"
        things = self.nouns.subjects(clause.subject, ("object",), "an object")
        speaker = self.scene.vocabulary.speaker
        if speaker is None:
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say where to: name a place")
        from_speaker = Mention((speaker,), "object", clause.first)
        where = self.places.where([])
        return self.wishes.to_target(
            things, replace(where, target=from_speaker.subjects[0], target_type="object"), False
        )

    def on_belongs(self, clause: Clause) -> None:
        assert clause.subject is not None
        self.scene.said.elliptic = "be"
        if not self.nouns.can_be(clause.subject, THINGS) and self.nouns.can_be(
            clause.subject, PLACES
        ):
            raise NotUnderstood(f"{self.scene.said.clause!r}: places stay where they are")
        who = self.nouns.subjects(clause.subject, THINGS, "an object or a robot")
        where, home = self.wishes.whereto(framed(clause.arguments))
        if self.scene.vocabulary.is_person(where.target or ""):
            belongs = next(w.text for w in clause.words if "BELONG" in w.tags)
            raise NotUnderstood(
                f"{belongs!r} says whose it is, which is no goal: say who shall "
                'have it, or give the object the property "owner"'
            )
        if where.target_type == "robot" or where.source is not None:
            raise NotUnderstood(
                f"{self.scene.said.clause!r} does not say in which place it belongs: {EXAMPLE}"
            )
        return self.wishes.to_target(who, where, home)

    def on_being(self, clause: Clause) -> None:
        assert clause.subject is not None
        if self.scene.said.elliptic == "be":
            self.to_be(clause.subject, clause.predicate, clause.arguments)
            return
        self.claims.check_mode()
        predicate = clause.predicate
        if predicate is None:
            raise no_fact(self.scene.said.clause)
        if any(isinstance(a, Place) and a.role == "to" for a in predicate.arguments):
            raise no_fact(self.scene.said.clause)  # "Mrs Lee's to nurse Sam"
        if predicate.kind == "placed":
            self.claims.placed(clause.subject, predicate.arguments)
        elif predicate.kind == "state":
            self.claims.are(clause.subject, predicate.words, False)
        else:
            self.claims.were(clause, True)

    def on_there(self, clause: Clause) -> None:
        assert clause.subject is not None
        if self.scene.said.elliptic == "be":
            return self.to_be(clause.subject, None, clause.arguments)
        self.claims.check_mode()
        return self.claims.placed(clause.subject, clause.arguments)

    def on_kept(self, clause: Clause) -> None:
        pairs = _each_to_its_place(clause.subject, clause.predicate)
        kept = [row for nouns, where in pairs for row in self._aside(nouns, where)]
        is_at = self.scene.vocabulary.is_at
        leaves = next((w for w in clause.words if w.words in _AS_IT_IS), None)
        for each in kept:
            there = any(is_at(name, str(each.value)) for name in each.subjects)
            if leaves and each.relation in PLACED and not there:
                raise NotUnderstood(f"{leaves.text!r}: {one_of(each.subjects)} is not there yet")
        self.scene.said.always.extend(kept)

    def on_never_be(self, clause: Clause) -> None:
        self.scene.said.never.extend(self._aside(clause.subject, clause.predicate, never=True))

    def _aside(
        self, subject: Nouns | None, predicate: Predicate | None, never: bool = False
    ) -> list[Condition]:
        """The conditions that a clause asks for, beside the stages."""
        draft = self.scene.said.draft
        self.scene.said.draft = GoalDraft(self.scene.vocabulary.is_at, never=never)
        try:
            self.to_be(subject, predicate, ())
            return [c for stage in self.scene.said.draft.conditions() for c in stage]
        finally:
            self.scene.said.draft, self.scene.said.elliptic = draft, ""


def _each_to_its_place(
    nouns: Nouns | None, predicate: Predicate | None
) -> list[tuple[Nouns | None, Predicate | None]]:
    """`keep the novel in the kitchen and the cookbook in the bedroom`, thing by thing."""
    placed = predicate is not None and predicate.kind == "placed"
    if nouns is None or not placed or not any(noun.places for noun in nouns.items[:-1]):
        return [(nouns, predicate)]
    found: list[tuple[Nouns | None, Predicate | None]] = []
    begun: list[Noun] = []
    for noun in nouns.items:
        begun.append(replace(noun, places=()))
        if noun.places:
            found.append((Nouns(tuple(begun)), Predicate("placed", (), noun.places)))
            begun = []
    return [*found, (Nouns(tuple(begun)), predicate)] if begun else found
