"""Sentences for a robot: what they want of its program."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from fleet.errors import NotUnderstood
from fleet.language import Ambiguity, Vocabulary, WantedGoal, read
from keyexpr_schema.facts import LOCATED
from keyexpr_schema.payloads.goals import Condition
from keyexpr_schema.payloads.programs import Program, ProgramPart


def program_for(text: str, vocabulary: Vocabulary, robot: str | None) -> tuple[Program, str | None]:
    """The program that is to be written for a sentence, and the robot that shall run it: `robot`,
    or the one that the sentence names.

    Raises:
        NotUnderstood: it is not understood, or is nothing for a program; one sentence.
    """
    reading = read(text, vocabulary)
    if isinstance(reading, Ambiguity):
        raise NotUnderstood(reading.sentence)
    if reading.question is not None:
        raise NotUnderstood("it is a question: ask it with `robotctl ask`")
    if reading.facts or not reading.goals:
        raise NotUnderstood("it says what holds: tell that with `robotctl world add`")
    for goal in reading.goals:
        _check(goal)
    if not any(goal.stages for goal in reading.goals):
        raise NotUnderstood("it says only what to keep or to avoid: give it as a goal")
    named = {name for goal in reading.goals for name in goal.by}
    if named - {robot} and (robot is not None or len(named) > 1):
        whom = " and ".join(sorted(named))
        raise NotUnderstood(
            f"{whom} shall do it, and a task is for one robot: {robot or 'name it'}"
        )
    _check_looked_for(reading.goals)
    stages = reading.goals[0].stages
    parts: tuple[ProgramPart, ...] = ()
    if reading.goals[1:] or reading.goals[0].only_if:
        parts = tuple(_part(goal) for goal in reading.goals if goal.stages)
        in_any_case = _in_any_case(parts)
        stages = (in_any_case,) if in_any_case else ()
    program = Program(
        text=text,
        stages=stages,
        parts=parts,
        always=_all(goal.always for goal in reading.goals),
        never=_all(goal.never for goal in reading.goals),
    )
    return program, robot or next(iter(named), None)


def _part(goal: WantedGoal) -> ProgramPart:
    """A part of a program; what is done otherwise belongs to the condition of the part before."""
    if not goal.otherwise:
        return ProgramPart(stages=goal.stages, only_if=goal.only_if)
    if goal.only_if[1:]:
        raise NotUnderstood('"otherwise, if …" is not understood of a task: say one of both')
    return ProgramPart(stages=goal.stages, otherwise=True)


def _check(goal: WantedGoal) -> None:
    late = [
        (goal.whenever, f"is for each time that {' and '.join(map(str, goal.whenever))}"),
        (goal.when, f"waits until {' and '.join(map(str, goal.when))}"),
        (goal.not_before_s is not None, "is for later"),
        (goal.due_s is not None, "says when it is due"),
        (goal.every is not None, "is to be done again and again"),
    ]
    for given, what in late:
        if given:
            raise NotUnderstood(f"it {what}, which no task can: give it as a goal")


def _check_looked_for(goals: Sequence[WantedGoal]) -> None:
    """Whether what is done otherwise, where something is not found, follows a search for it.

    Raises:
        NotUnderstood: nothing has said to look for it.
    """
    for number, goal in enumerate(goals):
        rows = (c for g in goals[:number] for stage in g.stages for c in stage)
        sought = {name for c in rows if c.relation == LOCATED for name in c.subjects}
        asked = {n for c in goal.only_if if c.relation == LOCATED for n in c.subjects}
        if goal.otherwise and asked - sought:
            thing = " and ".join(sorted(asked - sought))
            raise NotUnderstood(f'it asks whether {thing} is found: say "look for …" before that')


def _all(rows: Iterable[tuple[Condition, ...]]) -> tuple[Condition, ...]:
    return tuple(dict.fromkeys(row for each in rows for row in each))


def _in_any_case(parts: Sequence[ProgramPart]) -> tuple[Condition, ...]:
    """What shall hold in the end whatever is found: of parts under no condition, what no later
    part is about."""
    kept: list[Condition] = []
    for number, part in enumerate(parts):
        if part.only_if or part.otherwise or not part.stages:
            continue
        later = parts[number + 1 :]
        touched = {n for p in later for stage in p.stages for c in stage for n in c.subjects}
        asked = {n for p in later for c in p.only_if if c.relation == LOCATED for n in c.subjects}
        kept += (
            row
            for row in part.stages[-1]
            if touched.isdisjoint(row.subjects)
            and not (row.relation == LOCATED and asked.intersection(row.subjects))
        )
    return tuple(dict.fromkeys(kept))
