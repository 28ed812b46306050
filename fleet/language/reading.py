"""What a text was understood to mean, as data."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from fleet.language.resolve.scene import Question
from keyexpr_schema.facts import Literal
from keyexpr_schema.payloads.goals import Condition


@dataclass(frozen=True)
class WantedGoal:
    """What shall hold.

    `stages` come one after the other; all conditions of a stage hold together at its end. `always`
    must hold all the time, and of `never` nothing may. `priority` above 0 is for what is urgent.
    `not_before_s` and `due_s` count from now, in seconds; `every` is a line of cron or an ISO 8601
    period. `when` must hold before it is begun; if `only_if` does not hold, it is not wanted;
    with `whenever` it is wanted each time that comes to hold. `by` are robots that shall do it. "A
    before B" are stages. One that is `otherwise` is for when the goal before it is not wanted.
    """

    stages: tuple[tuple[Condition, ...], ...] = ()
    always: tuple[Condition, ...] = ()
    never: tuple[Condition, ...] = ()
    priority: int = 0
    not_before_s: float | None = None
    due_s: float | None = None
    every: str | None = None
    when: tuple[Condition, ...] = ()
    by: tuple[str, ...] = ()
    only_if: tuple[Condition, ...] = ()
    whenever: tuple[Condition, ...] = ()
    otherwise: bool = False


@dataclass(frozen=True)
class MethodUse:
    """A task that a text called by name (`said`), and the method by which it is done here.

    `text` is what the method says, with parameters filled in; `number` counts the task's methods
    from 1, and `passed_over` are those before it, and why they cannot be taken.
    """

    said: str
    task: str
    number: int
    text: str
    passed_over: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Reading:
    """What a text asks for, says or asks.

    `facts` are said in it. `presumed` are facts that it takes for granted: "bring the first cup
    from the kitchen …" presumes `at(cup_1) = kitchen`; they are no part of the goal. `remarks` are
    parts of the text that ask for nothing, as it was written: "I have a headache". `left_out` says
    in sentences what is not wanted though the words could be taken so.
    """

    text: str
    goals: tuple[WantedGoal, ...] = ()
    facts: tuple[Literal, ...] = ()
    question: Question | None = None
    presumed: tuple[Literal, ...] = ()
    remarks: tuple[str, ...] = ()
    methods: tuple[MethodUse, ...] = ()
    """How the tasks are done that it calls by name."""
    left_out: tuple[str, ...] = ()

    @property
    def stages(self) -> tuple[tuple[Condition, ...], ...]:
        """The stages of its goals."""
        return tuple(stage for goal in self.goals for stage in goal.stages)

    @property
    def understood_as(self) -> str:
        """What it was understood as, in words made from what must hold."""
        said = [f"{'; '.join(map(str, self.facts))} is so"] if self.facts else []
        for goal in self.goals:
            stages = [" and ".join(map(str, stage)) for stage in goal.stages]
            parts = [", then ".join(stages)] if stages else []
            parts += [f"always {c}" for c in goal.always] + [f"never {c}" for c in goal.never]
            parts += [f"each time that {' and '.join(map(str, goal.whenever))}"] * bool(
                goal.whenever
            )
            parts += [f"when {c}" for c in goal.when] + [f"if {c}" for c in goal.only_if]
            parts += [f"every {goal.every}"] if goal.every else []
            parts += [f"in {goal.not_before_s:.17g} s"] if goal.not_before_s is not None else []
            parts += [f"within {goal.due_s:.17g} s"] if goal.due_s is not None else []
            parts += [f"by {' and '.join(goal.by)}"] if goal.by else []
            parts += [f"with priority {goal.priority}"] if goal.priority else []
            said.append(("otherwise " if goal.otherwise else "") + ", ".join(parts))
        if self.question is not None:
            said.append(
                f"{self.question.of}: {', '.join(self.question.subjects)} "
                f"{'; '.join(map(str, self.question.holds))}?"
            )
        return "; ".join(said)


def told_apart(
    rows: Iterable[tuple[int, str, Reading]], is_at: Callable[[str, str], bool]
) -> list[tuple[int, str, Reading]]:
    """Readings with what they cost, the plainest first, one of each meaning: what is presumed asks
    for nothing, and of those that differ in that the one comes first in which it is believed."""

    def believed(reading: Reading) -> bool:
        return all(is_at(key.subject, str(value)) for key, value in reading.presumed)

    best: dict[Reading, tuple[int, str, Reading]] = {}
    for each in sorted(rows, key=lambda row: (row[0], not believed(row[2]))):
        best.setdefault(replace(each[2], presumed=()), each)
    return list(best.values())


@dataclass(frozen=True)
class Ambiguity:
    """A text that can mean several things here, none of them plainer than the others."""

    text: str
    candidates: tuple[tuple[str, Reading], ...]
    asked: str = ""

    @property
    def sentence(self) -> str:
        """The question to the person who said it."""
        if self.asked:
            return self.asked
        listed = "; or ".join(words for words, _ in self.candidates)
        return f"{self.text!r} can mean {listed}: which?"
