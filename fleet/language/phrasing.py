"""Says back in words what must hold: "the red cup is on the kitchen table"."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import comb

from fleet.language.reading import Reading, WantedGoal
from fleet.language.vocabulary import Vocabulary
from fleet.language.words.recurring import times_in_words
from fleet.language.words.tokens import NUMBERS
from keyexpr_schema.facts import (
    AT,
    HELD,
    HOLDING,
    IN,
    LOCATED,
    NOTHING,
    ON,
    SEARCHED,
    Value,
    render_value,
)
from keyexpr_schema.payloads.goals import Condition

MOST_NAMED = 4
"""Of more things that something may hold for, these many are named."""


@dataclass(frozen=True)
class Phrasing:
    """Words for what is meant, with the names of a vocabulary."""

    vocabulary: Vocabulary

    def reading(self, reading: Reading) -> str:
        """All that a text was understood to ask for."""
        return "; ".join(self.goal(goal) for goal in reading.goals)

    def goal(self, goal: WantedGoal) -> str:
        """What is wanted, and under what conditions."""
        stages = [self.all_of(stage) for stage in goal.stages]
        parts = [", then ".join(stages)] if stages else []
        parts += [f"always: {self.condition(row)}" for row in goal.always]
        parts += [f"never: {self.condition(row)}" for row in goal.never]
        parts += [f"each time that {self.all_of(goal.whenever)}"] if goal.whenever else []
        parts += [f"when {self.all_of(goal.when)}"] if goal.when else []
        parts += [f"if {self.all_of(goal.only_if)}"] if goal.only_if else []
        parts += [times_in_words(goal.every)] if goal.every else []
        parts += [f"in {_span(goal.not_before_s)}"] if goal.not_before_s is not None else []
        parts += [f"within {_span(goal.due_s)}"] if goal.due_s is not None else []
        parts += [f"by {' and '.join(map(self.named, goal.by))}"] if goal.by else []
        parts += [_urgency(goal.priority)] if goal.priority else []
        return ("otherwise: " if goal.otherwise else "") + ", ".join(parts)

    def all_of(self, rows: Sequence[Condition]) -> str:
        """Several conditions that must hold together."""
        said: dict[str, None] = {}
        for row in rows:
            count, names = _some_of(row, rows)
            said[self.condition(row) if not count else self._of_several(row, count, names)] = None
        return " and ".join(said)

    def condition(self, row: Condition) -> str:
        """One condition, as a sentence."""
        subject = self._any_of(row.subjects)
        is_ = "is not" if row.negated else "is"
        if anybody := self._anybody(row):
            return self._sentence(row, f"{'no' if row.negated else 'some'}{anybody}", "is")
        if row.negated and row.any_of[1:]:
            subject, is_ = f"none of {subject}", "is"
        return self._sentence(row, subject, is_)

    def _anybody(self, row: Condition) -> str:
        """`body` or `thing`, where it is all persons or things that may be meant."""
        names = set(row.any_of)
        people = set(filter(self.vocabulary.is_person, self.vocabulary.objects))
        if len(names) > 1 and names in (people, self.vocabulary.movable):
            return "body" if names == people else "thing"
        return ""

    def _of_several(self, row: Condition, count: int, names: Sequence[str]) -> str:
        """`two of butler, cart and hsr are in the kitchen`."""
        *first, last = [self.named(name) for name in names[:MOST_NAMED]]
        more = f"{', '.join((*first, last))}, …" if names[MOST_NAMED:] else (
            f"{', '.join(first)} and {last}"
        )  # fmt: skip
        number = next((word for word, digits in NUMBERS.items() if digits == str(count)), count)
        return self._sentence(row, f"{number} of {more}", "are")

    def _sentence(self, row: Condition, subject: str, is_: str) -> str:
        relation, value = row.relation, row.value
        if relation in (AT, ON, IN) and isinstance(value, str):
            return f"{subject} {is_} {self._where(relation, value)} {self.named(value)}"
        if relation == LOCATED:
            return f"{'nobody knows' if value is row.negated else 'it is known'} where {subject} is"
        if relation == HELD:
            return f"{'no' if value is row.negated else 'a'} robot holds {subject}"
        if relation == SEARCHED:
            return f"{subject} has {'not ' if value is row.negated else ''}been searched"
        if relation == HOLDING:
            held = "nothing" if value == NOTHING else self.named(str(value))
            return f"{subject} {'does not hold' if row.negated else 'holds'} {held}"
        if word := self._state(row):
            return f"{subject} {is_} {word}"
        return self._plainly(row, subject, is_)

    def named(self, name: str) -> str:
        """What something is called; its id, where others are called the same."""
        words = self.vocabulary
        tables: tuple[Mapping[str, object], ...] = (words.objects, words.places, words.robots)
        known = next((table[name] for table in tables if name in table), None)
        label = str(getattr(known, "label", "") or name.replace("_", " "))
        same = (getattr(each, "label", "") == label for table in tables for each in table.values())
        if known is None or sum(same) > 1:
            return name
        bare = name in words.robots or words.is_person(name) or label[-1:].isdigit()
        plain = label.istitle() or label[1:] == label[1:].lower()
        return label if bare else f"the {label.lower() if plain else label}"

    def _any_of(self, names: Sequence[str]) -> str:
        said = [self.named(name) for name in names[:MOST_NAMED]]
        if len(names) > MOST_NAMED:
            return f"one of {len(names)} things ({', '.join(said)}, …)"
        return " or ".join(said)

    def _where(self, relation: str, value: str) -> str:
        words = self.vocabulary
        if value in words.robots or words.is_person(value):
            return "with"
        if relation in (ON, IN):
            return relation
        return "at" if value in words.objects else "in"

    def _state(self, row: Condition) -> str | None:
        """The word that skills and relations have for such a state."""
        thing = self.vocabulary.objects.get(row.subject)
        found = (
            each.word
            for each in self.vocabulary.state_words
            if (each.relation, each.value) == (row.relation, row.value)
            and (thing is None or each.fits(thing))
        )
        return next(found, None)

    @staticmethod
    def _plainly(row: Condition, subject: str, is_: str) -> str:
        if isinstance(row.value, bool):
            state = row.relation.removeprefix("is_").replace("_", " ")
            return f"{subject} {is_} {'' if row.value else 'not '}{state}"
        return f"{row.relation.replace('_', ' ')} of {subject} {is_} {_shown(row.value)}"


def _some_of(row: Condition, rows: Sequence[Condition]) -> tuple[int, tuple[str, ...]]:
    """How many it must hold of, and of whom: of each two of three is of two of them. Else 0."""
    if not row.any_of[1:] or row.negated:
        return 0, ()
    alike = {
        frozenset(each.any_of)
        for each in rows
        if (each.relation, each.value, each.negated, len(each.any_of))
        == (row.relation, row.value, False, len(row.any_of))
    }
    names = tuple(sorted({name for each in alike for name in each}))
    whole = len(alike) > 1 and len(alike) == comb(len(names), len(row.any_of))
    return (len(names) - len(row.any_of) + 1, names) if whole else (0, ())


def _shown(value: Value) -> str:
    return value if isinstance(value, str) else render_value(value)


def _span(seconds: float) -> str:
    """A time in words, all of it: `2 h 30 min`."""
    parts, left = [], seconds
    for size_s, unit in ((86_400.0, "d"), (3600.0, "h"), (60.0, "min")):
        count, left = divmod(left, size_s)
        parts += [f"{count:g} {unit}"] if count else []
    return " ".join([*parts, f"{left:.6g} s"] if left or not parts else parts)


def _urgency(priority: int) -> str:
    """What comes first: a sentence says one of two, and a person any number."""
    words = {1: "before other goals", -1: "after other goals"}
    return words.get(priority, f"with priority {priority}")
