"""What a sentence means, in a form in which two meanings can be compared."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

from keyexpr_schema.facts import Value, parse_value

_CONDITION = re.compile(r"([\w.-]+)\(([^()]*)\)\s*(?:(!?)=\s*(.+))?")


class BadMeaning(ValueError):
    """A condition in the suite cannot be read; one sentence."""


class Wanted(NamedTuple):
    """`relation(a or b) = v or w`: true if some subject has some of these values. `?` stands for
    what a question asks after."""

    relation: str
    subjects: frozenset[str]
    values: frozenset[Value]

    def __str__(self) -> str:
        values = "|".join(sorted(str(v).lower() if isinstance(v, bool) else str(v)
                                 for v in self.values))  # fmt: skip
        return f"{self.relation}({'|'.join(sorted(self.subjects))}) = {values}"


Conditions = frozenset[Wanted]


def wanted(text: str) -> Wanted:
    """`at(cup_1|cup_2) = hallway`; without a value it is `true`; `!=` is "has none of them".

    Raises:
        BadMeaning: it is no such condition.
    """
    found = _CONDITION.fullmatch(text.strip())
    if found is None:
        raise BadMeaning(f"{text!r} is no condition such as `at(cup_1|cup_2) = hallway`")
    relation, subjects, differs, values = found.groups()
    return Wanted(
        f"not {relation}" if differs else relation,
        frozenset(part.strip() for part in subjects.split("|")),
        frozenset(parse_value(part.strip()) for part in (values or "true").split("|")),
    )


def conditions(text: str) -> Conditions:
    """Conditions with semicolons between them."""
    return frozenset(wanted(part) for part in text.split(";") if part.strip())


def each(found: Iterable[Wanted]) -> Conditions:
    """With a condition for each subject: nothing of "cup_1 or cup_2" is nothing of either."""
    return frozenset(
        Wanted(c.relation, frozenset({subject}), frozenset({value}))
        for c in found
        for subject in c.subjects
        for value in c.values
    )


@dataclass(frozen=True)
class WantedMeaning:
    """One goal: stages one after the other, and what stands around them.

    Times are seconds from now; `every` is a cron line or an ISO 8601 period; `by` are the robots
    that shall do it.
    """

    stages: tuple[Conditions, ...] = ()
    always: Conditions = frozenset()
    never: Conditions = frozenset()
    before: frozenset[tuple[Wanted, Wanted]] = frozenset()
    when: Conditions = frozenset()
    whenever: Conditions = frozenset()
    priority: int = 0
    due_s: float | None = None
    not_before_s: float | None = None
    every: str | None = None
    by: frozenset[str] = frozenset()

    def canonical(self) -> WantedMeaning:
        """With "A before B", where B is wanted anyway, as stages; `never` of each subject alone."""
        stages, before = self.stages, self.before
        if len(stages) == 1 and before and all(later in stages[0] for _, later in before):
            first = frozenset(earlier for earlier, _ in before)
            stages, before = (first, stages[0] - first), frozenset()
        return WantedMeaning(
            stages=stages,
            always=self.always,
            never=each(self.never),
            before=before,
            when=self.when,
            whenever=self.whenever,
            priority=(self.priority > 0) - (self.priority < 0),
            due_s=None if self.due_s is None else round(self.due_s, 3),
            not_before_s=None if self.not_before_s is None else round(self.not_before_s, 3),
            every=self.every,
            by=self.by,
        )

    def __str__(self) -> str:
        stages = " > ".join("; ".join(sorted(map(str, stage))) for stage in self.stages)
        parts = [stages] if stages else []
        for name in ("always", "never", "when", "whenever"):
            if rows := getattr(self, name):
                parts.append(f"{name} {'; '.join(sorted(map(str, rows)))}")
        parts += [f"{earlier} before {later}" for earlier, later in sorted(self.before, key=str)]
        for name in ("priority", "due_s", "not_before_s", "every"):
            if value := getattr(self, name):
                parts.append(f"{name} {value}")
        if self.by:
            parts.append(f"by {'|'.join(sorted(self.by))}")
        return ", ".join(parts)


class Asked(NamedTuple):
    """A question: `of` what, about whom (nobody: about anything), and what must hold of them."""

    of: str
    subjects: frozenset[str]
    conditions: Conditions

    def canonical(self) -> Asked:
        """With "is there any soup in the pot?", of one soup, as "is the soup in the pot?"."""
        if self.of != "whether" or len(self.subjects) != 1 or not self.conditions:
            return self
        told = frozenset(
            c._replace(subjects=self.subjects) if c.subjects == {"?"} else c
            for c in self.conditions
        )
        return Asked(self.of, frozenset(), told)

    def __str__(self) -> str:
        about = f" of {'|'.join(sorted(self.subjects))}" if self.subjects else ""
        rows = "; ".join(sorted(map(str, self.conditions)))
        return f"{self.of}{about}" + (f": {rows}" if rows else "")


@dataclass(frozen=True)
class Meaning:
    """All that a text says: goals, facts said in the same breath or alone, a question."""

    goals: frozenset[WantedMeaning] = frozenset()
    facts: Conditions = frozenset()
    question: Asked | None = None

    def __str__(self) -> str:
        parts = [f"goal {goal}" for goal in sorted(self.goals, key=str)]
        if self.facts:
            parts.append(f"facts {'; '.join(sorted(map(str, self.facts)))}")
        if self.question is not None:
            parts.append(f"question {self.question}")
        return " & ".join(parts) or "nothing"

    def rows(self) -> list[Wanted]:
        """All conditions in it, whatever part they play."""
        rows: list[Wanted] = list(self.facts)
        for goal in self.goals:
            rows += [row for stage in goal.stages for row in stage]
            rows += [*goal.always, *goal.never, *goal.when]
            rows += [row for pair in goal.before for row in pair]
        if self.question is not None:
            rows += self.question.conditions
        return rows

    def names(self) -> frozenset[str]:
        """All that its conditions are about, and all values that are words."""
        found = {name for goal in self.goals for name in goal.by}
        found |= self.question.subjects if self.question is not None else frozenset()
        for row in self.rows():
            found |= row.subjects
            found |= {value for value in row.values if isinstance(value, str)}
        return frozenset(found - {"?"})
