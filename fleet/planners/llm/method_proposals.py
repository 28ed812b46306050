"""Tasks that a language model proposes beside its sentences: read, and planned, before offered."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace as changed
from datetime import datetime
from itertools import islice

from fleet.core.model.world import WorldModel
from fleet.errors import BadTaskFile, NotUnderstood
from fleet.jobshop.time_budget import TimeBudget
from fleet.language import Ambiguity, Reading, Vocabulary, WantedGoal, read
from fleet.language.methods.model import NUMBER, CompoundTask
from fleet.language.methods.patterns import rows_of
from fleet.language.methods.task_file import tasks_from_data
from fleet.llm.quoting import printable
from fleet.llm.structured_output import StructuredAnswer
from fleet.planners.base import NoPlan, Planner, PlanningProblem
from fleet.planners.llm.candidate import world_after
from keyexpr_schema.payloads.goals import Goal

MOST_PHRASES = 10
MOST_SENTENCES = 20
MOST_TRIED = 60
"""Of what the phrases of a task stand for, so much is tried to be read without it."""
PLANNING_S = 5.0
"""How long it may take to see that what a task comes to can be done."""


class TaskAnswer(StructuredAnswer, frozen=True):
    """A task as a model proposes it: a row of `do` after the other, of a row all side by side."""

    name: str
    says: tuple[str, ...]
    do: tuple[tuple[str, ...], ...]


class ProposalRefused(Exception):
    """A proposed task is not offered; one sentence says why."""


def checked_task(
    answer: TaskAnswer,
    sentence: str,
    meaning: Reading,
    vocabulary: Vocabulary,
    now: datetime | None,
    planner: Planner,
    world: WorldModel,
) -> CompoundTask:
    """The proposed task, if the sentence calls it, means the same by it as `meaning`, and that can
    be done in this world.

    Raises:
        ProposalRefused: it is none, means something else, or there is no plan for it.
    """
    (task,) = _parsed(answer)
    if any(task.name == known.name for known in vocabulary.tasks):
        raise ProposalRefused(f"there is a task {task.name} already")
    if (taken := _means_already(task, vocabulary, now)) is not None:
        raise ProposalRefused(f"task {task.name} is called by {taken!r}, which is read already")
    try:
        found = read(sentence, changed(vocabulary, tasks=(*vocabulary.tasks, task)), now)
    except NotUnderstood as error:
        raise ProposalRefused(f"with task {task.name}, {error}") from None
    if isinstance(found, Ambiguity) or not any(use.task == task.name for use in found.methods):
        raise ProposalRefused(f"{sentence!r} does not call task {task.name}")
    if found.goals != meaning.goals:
        raise ProposalRefused(f"task {task.name} means {found.understood_as}")
    if (why := _impossible(found.goals, planner, world)) is not None:
        raise ProposalRefused(f"task {task.name} cannot be done: {why}")
    return task


def _means_already(task: CompoundTask, vocabulary: Vocabulary, now: datetime | None) -> str | None:
    """The first of a task's phrases that is read without it: kept, the task would change what
    people mean by it."""
    rows = (row for phrase in task.says for row in rows_of(phrase))
    for row in islice(rows, MOST_TRIED):
        words = [part if isinstance(part, str) else _example(part.type, vocabulary) for part in row]
        try:
            read(said := " ".join(words), vocabulary, now)
        except NotUnderstood:
            continue
        return said
    return None


def _example(type_: str, vocabulary: Vocabulary) -> str:
    """Something of a type, as it is called."""
    if type_ == NUMBER:
        return "two"
    tables = (vocabulary.objects, vocabulary.places, vocabulary.robots)
    name = min(vocabulary.of_type(type_), default=type_)
    known = next((table[name] for table in tables if name in table), None)
    return str(getattr(known, "label", "") or name.replace("_", " "))


def _parsed(answer: TaskAnswer) -> tuple[CompoundTask, ...]:
    entry = {
        "says": list(map(printable, answer.says)),
        "in_order": [list(map(printable, row)) for row in answer.do],
    }
    if len(answer.says) > MOST_PHRASES or sum(map(len, answer.do)) > MOST_SENTENCES:
        raise ProposalRefused(f"at most {MOST_PHRASES} phrases and {MOST_SENTENCES} sentences")
    try:
        return tasks_from_data({"tasks": {answer.name: entry}}, "the proposal")
    except BadTaskFile as error:
        raise ProposalRefused(str(error)) from None


def _impossible(goals: Iterable[WantedGoal], planner: Planner, world: WorldModel) -> str | None:
    """Why the stages of goals cannot be reached one after the other, or `None`."""
    budget = TimeBudget(PLANNING_S)
    for stage in (stage for goal in goals for stage in goal.stages):
        goal = Goal(goal="proposal", text="", conditions=stage)
        made = planner.plan(
            PlanningProblem(plan="proposal", goals=(goal,), world=world, budget=budget)
        )
        if isinstance(made, NoPlan):
            return made.reason
        world = world_after(made.plan, world)
    return None
