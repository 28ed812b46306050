"""Facts that statements claim, checked against each other."""

from __future__ import annotations

from collections.abc import Sequence

from fleet.errors import NotUnderstood
from fleet.language.goals.clauses import Clauses
from fleet.language.phrases.subjects import Subject
from fleet.language.refusals import one_of
from fleet.language.vocabulary import SkillPhrase, Vocabulary
from keyexpr_schema.facts import AT, HOLDING, NOTHING, ON, SEARCHED, FactKey, Value


class Claims(Clauses):
    """Collects facts; a later one may not contradict an earlier one."""

    def __init__(self, text: str, vocabulary: Vocabulary) -> None:
        super().__init__(text, vocabulary, "a fact")
        self.facts: dict[FactKey, Value] = {}

    def fact(self, relation: str, subject: str, value: Value) -> None:
        """Keep a fact.

        Raises:
            NotUnderstood: the text said something else of it.
        """
        before = self.facts.setdefault(key := FactKey(relation, subject), value)
        if before != value:
            shown = ["nobody knows where" if v is None else str(v) for v in (before, value)]
            raise NotUnderstood(f"it says two things of {key}: {' and '.join(shown)}")

    def put(
        self, things: Sequence[Subject], target: str | None, surface: str | None = None
    ) -> None:
        """These are at the target, on a surface there if one is named."""
        if self.cursor.word() == "or":
            raise self.cursor.refusal("")
        mentions = [self.subjects.resolve(thing) for thing in things]
        for mention in mentions:
            if mention.open:
                raise NotUnderstood(
                    f"{self.clause!r} does not say which of {one_of(mention.subjects)}: name it"
                )
            if mention.type == "robot" and target in self.vocabulary.robots:
                raise NotUnderstood("a robot is at a place, not on a robot: name the place")
            if target in mention.subjects:
                raise NotUnderstood(f"{self.clause!r}: nothing can be on or in itself")
            robot = mention.type == "robot" and target is not None
            for name in mention.subjects:
                self.fact(AT, name, self.place_of(target) if robot and target else target)
                if surface is not None and mention.type == "object":
                    self.fact(ON, name, surface)
        self.subjects.remember(mentions)

    def lost(self, things: Sequence[Subject]) -> None:
        """Nobody knows where these are."""
        mentions = [self.subjects.resolve(thing) for thing in things]
        for mention in mentions:
            if mention.open:
                raise NotUnderstood(f"it does not say which of {one_of(mention.subjects)}: name it")
            for name in mention.subjects:
                self.fact(AT, name, None)
        self.subjects.remember(mentions)

    def holding(
        self, robots: Sequence[Subject], held: Sequence[Subject] | None, in_hand: bool = True
    ) -> None:
        """What a robot has in its hand (`None`: nothing) or on it."""
        names = [name for robot in robots for name in self.subjects.resolve(robot).subjects]
        objects = [n for thing in held or () for n in self.subjects.resolve(thing).subjects]
        opened = any(self.subjects.resolve(s).open for s in (*robots, *(held or ())))
        if opened or (held is not None and (len(names) != 1 or (in_hand and len(objects) != 1))):
            raise NotUnderstood(f"{self.clause!r}: one hand holds one thing; say who holds what")
        for name in names:
            if in_hand:
                self.fact(HOLDING, name, objects[0] if objects else NOTHING)
            for thing in objects:
                self.fact(AT, thing, name)

    def are_so(self, things: Sequence[Subject], phrase: SkillPhrase) -> None:
        """These are as a skill makes them: open, switched on."""
        for thing in things:
            mention = self.subjects.resolve(thing)
            if mention.open:
                raise NotUnderstood(f"it does not say which of {one_of(mention.subjects)}: name it")
            for name in mention.subjects:
                for relation, value in phrase.wants:
                    self.fact(relation, name, value)

    def looked_around(self, places: Sequence[str], value: bool) -> None:
        """Somebody looked around in these places, or nobody did."""
        if not value and len(places) > 1:
            raise NotUnderstood(
                f"{self.clause!r} could mean all or some of them: say it of one place at a time"
            )
        self.cursor.take("yet")
        for place in places:
            self.fact(SEARCHED, place, value)
