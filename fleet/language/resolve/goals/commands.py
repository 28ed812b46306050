"""Clauses with a verb that somebody shall do."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.resolve.frames import EXAMPLE, Frame, framed, frames_of, no_use, nothing_said
from fleet.language.resolve.goals.deeds import Deeds
from fleet.language.resolve.goals.going import Going
from fleet.language.resolve.goals.looking import ROBOTS_TELL
from fleet.language.resolve.questions import Questions
from fleet.language.resolve.reference.mentions import NounPhrase, Subject
from fleet.language.resolve.scene import THINGS
from fleet.language.resolve.stages import GoalDraft
from fleet.language.tagging.skill_words import SkillFrame
from fleet.language.tree.nodes import Clause, Nouns, Particle, Place, Quantity
from keyexpr_schema.facts import HELD, LOCATED
from keyexpr_schema.payloads.goals import Condition

_FETCHED = frozenset({"get", "fetch", "retrieve"})
"""After these, "next to the lamp" says which one, not where it shall be."""


_AROUND = frozenset(
    ["around", "round", "up", "down", "over", "out", "through", "in", "inside", "away", "back"]
)
"""Particles that change nothing of what it is to look around, or to tidy up."""
_ASKING = frozenset({("should",), ("shall",), ("must",)})
"""Before whom they are said of, these ask: "should Dusty vacuum the hallway?"."""
_CAN = frozenset({("can",)})
_NAMED = ("noun", "one", "headless")
_ALLOWING = frozenset({("may",), ("might",)})


class Commands:
    """Turns clauses with a verb into wishes."""

    def __init__(self, deeds: Deeds, questions: Questions) -> None:
        ground, self.wishes, self.moving, self.looking, self.skilled, self.tidiness = deeds
        self.scene, self.who, self.nouns, self.places = ground
        self.questions = questions
        self.going = Going(ground, self.wishes)
        self._clause: Clause | None = None

    def on_do(self, clause: Clause) -> None:
        """`bring the soup to Anna`, `bring me my mug, washed`."""
        self._verb(clause, self.scene.said.addressees or None)
        for word in clause.words:
            if word.tags & {"ADJ", "PART"} and "NOUN" not in word.tags:
                for mention in self.scene.said.recent:
                    wants = self.scene.stated.wants(word, mention.subjects[0])
                    self.skilled.wish([mention], wants)

    def once_more(self, clause: Clause) -> bool:
        """`then the cactus`, after `water the fern`: whether the verb before was of that kind."""
        before = self.scene.said.again
        if before is None or clause.subject is None:
            return False
        if clause.subject.either:
            raise NotUnderstood(
                f"{self.scene.said.clause!r} leaves open what goes together: say one by one"
            )
        done = {n for stage in self.scene.said.draft.stages for w in stage for n in w.subjects}
        if self.nouns.can_be(clause.subject, THINGS):
            found = self.nouns.subjects(clause.subject, THINGS, "an object or a robot")
            if {name for subject in found for name in subject.names} <= done:
                text = self.scene.said.clause
                raise NotUnderstood(f"{text!r} were named before: say of each which ones are meant")
        rest = [a for a in before.arguments if not isinstance(a, Nouns)]
        self._verb(replace(before, arguments=(clause.subject, *rest)), None)
        return True

    def on_paired(self, clause: Clause) -> None:
        """`and Ben a mug`, after `bring Anna a cup`."""
        offer = self.scene.said.offer
        if offer is None or clause.subject is None:
            first = clause.subject.items if clause.subject is not None else ()
            text = self.scene.said.quote(first[0].first, first[-1].last) if first else ""
            raise nothing_said(text, self.scene.mode)
        self._verb(replace(offer, arguments=(clause.subject, *clause.arguments)), None)

    def on_told(self, clause: Clause) -> None:
        assert clause.subject is not None
        modal = next((w.text for w in clause.words if w.words in _ALLOWING), None)
        if modal is not None:
            raise NotUnderstood(
                f"{modal!r} allows something, and asks for nothing: say what shall be"
            )
        asked = next((w for w in clause.words if w.words in _ASKING), None)
        if asked is not None and asked.first < clause.subject.items[0].first:
            raise NotUnderstood(f"{asked.text!r} asks what shall be done: say who shall do it")
        who = self.nouns.subjects(clause.subject, THINGS, "an object or a robot")
        if self._asks_what_it_can(clause):
            return self.questions.ask_able(self.who.all_of(who), self._would_hold(_of_all(clause)))
        if any(s.type == "object" for s in who) and self._goes(clause):
            self.scene.said.elliptic, self.scene.said.verb = "move", ""
            return self.wishes.to_target(
                who, *self.wishes.whereto(framed(clause.arguments), each=True)
            )
        if self._about(who, clause):
            self.scene.said.remember([self.who.resolve(subject) for subject in who])
            return self._verb(clause, None)
        self.who.check_robots(who)
        self.scene.said.addressees = [
            s for s in who if not (isinstance(s, NounPhrase) and s.generic)
        ]
        return self._verb(clause, who)

    def _about(self, who: Sequence[Subject], clause: Clause) -> bool:
        """`the curtains, please close them`: whether things are named that "it" means then."""
        things = all(s.type == "object" for s in who)
        people = any(self.scene.vocabulary.is_person(name) for s in who for name in s.names)
        meant = any(
            noun.form == "pronoun"
            for a in clause.arguments
            if isinstance(a, Nouns)
            for noun in a.items
        )
        return things and meant and not people and any("COMMA" in w.tags for w in clause.words)

    def _loaded(self, clause: Clause) -> Clause:
        """`load the dishwasher with the plates` as `load the plates into the dishwasher`."""
        heads = self.scene.tagger.verbs.heads(clause.verb.words, "VERB") if clause.verb else ()
        what = [a.nouns for a in clause.arguments if isinstance(a, Place) and a.role == "with"]
        into = [a for a in clause.arguments if isinstance(a, Nouns)]
        two = len(clause.arguments) == 2 and len(what) == len(into) == 1
        loads = any(head[0] in self.scene.tagger.book.loading for head in heads)
        if not two or not loads or what[0] is None:
            return clause
        first, last = into[0].items[0].first, into[0].items[-1].last
        there = Place("to", "into", into[0], first, last)
        return replace(clause, arguments=(what[0], there))

    def _goes(self, clause: Clause) -> bool:
        """`the mail should go to Carla`: whether that is what shall be done with a thing."""
        verb = clause.verb
        heads = self.scene.tagger.verbs.heads(verb.words, "VERB", "FIN") if verb else ()
        return ("go",) in heads

    def _verb(self, clause: Clause, who: Sequence[Subject] | None) -> None:
        assert clause.verb is not None
        clause, who = self._with_robot(clause, who)
        clause = self._loaded(clause)
        verb = clause.verb
        assert verb is not None
        self._clause = clause
        problems: list[NotUnderstood] = []
        frames = frames_of(
            self.scene.tagger, verb, clause.arguments, ("VERB", "FIN", "GER", "PART")
        )
        if not frames:
            behind = [word.lexeme.last for word in clause.arguments if isinstance(word, Particle)]
            end = min([*behind[:1], verb.last + 1, clause.last])
            said = self.scene.said.quote(verb.first, end)
            raise no_use(self.scene.tagger, verb, said)
        for frame, phrases in frames:
            before = self.scene.said
            self.scene.said = before.copy()
            try:
                frame = self._for_me(frame, phrases)
                fetched = frame.verb in _FETCHED or len(frame.themes) > 1
                wishes = "move" in frame.senses and not phrases and not fetched
                frame = self.places.relations.attached(frame, wishes)
                if phrases:
                    if phrases[0].phrase.type != "robot":
                        self._check_who(who)
                    self.scene.said.elliptic = ""
                    self.scene.said.again = clause
                    self.skilled.skill(frame, phrases, who)
                else:
                    self._sense(frame, who)
                return None
            except NotUnderstood as problem:
                self.scene.said = before
                problems.append(problem)
                if self.skilled.fits(frame, phrases):
                    break
        if (other := _with_last_there(clause)) is not None:
            with suppress(NotUnderstood):
                return self._verb(other, who)
        raise problems[0]

    def _with_robot(
        self, clause: Clause, who: Sequence[Subject] | None
    ) -> tuple[Clause, Sequence[Subject] | None]:
        """The clause without "with the forklift", "with Rosie's help", and who does it."""
        for place in clause.arguments:
            if not isinstance(place, Place) or place.role != "with" or place.nouns is None:
                continue
            robots = self.nouns.can_be(place.nouns, ("robot",))
            if robots and not self.nouns.can_be(place.nouns, ("object",)):
                rest = tuple(a for a in clause.arguments if a is not place)
                helper = self.nouns.subjects(place.nouns, ("robot",), "a robot")
                return replace(clause, arguments=rest), [*(who or ()), *helper]
        return clause, who

    def _for_me(self, frame: Frame, skills: Sequence[SkillFrame]) -> Frame:
        """The frame without "for me" and "me", where that says no more than who asks."""
        if "move" in frame.senses:
            return frame
        me = len(frame.themes) == 2 and frame.themes[0].items[0].form == "me"
        if me and "pick" in frame.senses:  # "grab me a banana"
            return replace(frame, senses=frozenset({"move"}))
        for_me = tuple(
            p for p in frame.places if p.role == "for" and p.nouns and p.nouns.items[0].form == "me"
        )
        places = tuple(p for p in frame.places if p not in for_me)
        themes = frame.themes
        if skills and len(themes) == 2 and themes[0].items[0].form == "me":
            themes = themes[1:]
        if for_me and "pick" in frame.senses and self.scene.vocabulary.speaker is not None:
            return replace(frame, senses=frozenset({"move"}))
        return replace(frame, places=places, themes=themes)

    def _sense(self, frame: Frame, who: Sequence[Subject] | None) -> None:
        senses = frame.senses
        self.scene.said.verb = frame.verb
        if len(frame.themes) == 2:
            self.scene.said.offer = self._clause
        if not senses & {"move", "go", "give"}:
            self.scene.said.again = self._clause
        self.scene.said.elliptic = "move" if senses & {"move", "go", "give"} else ""
        goes = not frame.themes and ("move" not in senses or _whereto(frame))
        if "go" in senses and (goes or "move" not in senses):
            return self.going.go(frame, who)
        if not senses & {"move", "give", "pick"}:
            self._check_particles(frame)
        if "patrol" in senses and any(not self.who.any_robot(s) for s in who or ()):
            self.who.check_robots(who or ())
            return self.looking.patrol(frame, who or ())
        self._check_who(who)
        if "bin" in senses:
            return self.tidiness.throw_away(frame)
        if "clear" in senses and "tidy" not in senses:
            return self.tidiness.clear(frame)
        if "move" in senses and (frame.themes or "tidy" not in senses):
            return self.moving.move(frame)
        if "give" in senses:
            return self.moving.move(frame)
        if "tidy" in senses:
            return self.tidiness.tidy(frame)
        if "find" in senses:
            return self.looking.find(frame)
        if "pick" in senses:
            return self.looking.pick(frame)
        return self.looking.search(frame)

    @staticmethod
    def _check_particles(frame: Frame) -> None:
        """Whether the words beside the verb's own say nothing more: "search the kitchen open".

        Raises:
            NotUnderstood: one does.
        """
        if stray := sorted(frame.particle_words - _AROUND):
            raise NotUnderstood(
                f"{stray[0]!r} is not understood after {frame.verb or 'it'!r}: {EXAMPLE}"
            )

    def _check_who(self, who: Sequence[Subject] | None) -> None:
        if who is not None:
            self.who.check_who(who)

    def _asks_what_it_can(self, clause: Clause) -> bool:
        """`can Dusty wash dishes?`: of no dishes in particular, so that nothing is asked for."""
        can = next((w for w in clause.words if w.words in _CAN), None)
        subject = clause.subject
        if can is None or subject is None or can.first > subject.items[0].first:
            return False
        if self.scene.mode or not self.nouns.can_be(subject, ("robot",)):
            return False
        themes = [noun for a in clause.arguments if isinstance(a, Nouns) for noun in a.items]
        return all(
            noun.form == "noun" and noun.quantity is Quantity.BARE and noun.head[0].word[-1] == "s"
            for noun in themes
        ) and not any(isinstance(a, Place) for a in clause.arguments)

    def on_whether_done(self, clause: Clause) -> None:
        """`has anyone watered the fern?`: whether that is so which it would have made so."""
        stages = self._would_hold(clause)
        if len(stages) != 1 or any(c.relation in (HELD, LOCATED) for c in stages[0]):
            text = self.scene.said.clause
            raise NotUnderstood(f"{text!r} is a question that is not understood")
        self.questions.whether(stages[0])

    def _would_hold(self, clause: Clause) -> tuple[tuple[Condition, ...], ...]:
        """What would hold if it were done."""
        before = self.scene.said
        self.scene.said = said = before.copy()
        said.draft = GoalDraft(self.scene.vocabulary.is_at)
        try:
            self._verb(clause, None)
            return self.scene.said.draft.conditions()
        finally:
            self.scene.said = before

    def on_needs_doing(self, clause: Clause) -> None:
        """`the living room needs tidying up`."""
        assert clause.subject is not None and clause.verb is not None
        self._verb(replace(clause, arguments=(clause.subject, *clause.arguments)), None)

    def on_where(self, clause: Clause) -> None:
        if self.scene.mode == "goal" and clause.subject is not None:
            if self.nouns.can_be(clause.subject, ("robot",)) and not self.nouns.can_be(
                clause.subject, ("object",)
            ):
                text = self.scene.said.clause
                subject = clause.subject.items
                text = self.scene.said.quote(subject[0].first, subject[-1].last)
                raise NotUnderstood(f"{text!r}: {ROBOTS_TELL}")
            return self.looking.find_these(clause.subject, ())
        self.questions.ask_where(clause)
        return None


def _with_last_there(clause: Clause) -> Clause | None:
    """`open the blinds and the window in the office`, said of a window there."""
    named = [i for i, a in enumerate(clause.arguments) if isinstance(a, Nouns)]
    places = [a for a in clause.arguments if isinstance(a, Place)]
    nouns = clause.arguments[named[0]] if len(named) == 1 else None
    if not isinstance(nouns, Nouns) or not nouns.items[1:] or nouns.either or len(places) != 1:
        return None
    last = nouns.items[-1]
    if places[0].role not in ("in", "from") or places[0].special or last.form not in _NAMED:
        return None
    there = replace(nouns, items=(*nouns.items[:-1], replace(last, places=tuple(places))))
    rest = tuple(a for a in clause.arguments if not isinstance(a, Nouns | Place))
    return replace(clause, arguments=(there, *rest))


def _of_all(clause: Clause) -> Clause:
    """The same of all that it may be said of: "dishes" are all dishes."""
    return replace(clause, arguments=tuple(
        replace(a, items=tuple(replace(n, quantity=Quantity.ALL) for n in a.items))
        if isinstance(a, Nouns) else a
        for a in clause.arguments
    ))  # fmt: skip


def _whereto(frame: Frame) -> bool:
    return bool(frame.places) or frame.home or "back" in frame.particle_words
