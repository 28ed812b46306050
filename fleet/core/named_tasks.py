"""What the tasks are that people name, and what a text that calls one would mean now."""

from __future__ import annotations

from collections.abc import Sequence

from fleet.core.state import State
from fleet.core.understanding import understood
from fleet.errors import NotUnderstood
from fleet.language import Ambiguity, read
from fleet.language.meanings.expansion import CannotBeDone
from fleet.language.reading import MethodUse
from fleet.language.resolve.frames import said_of
from keyexpr_schema.payloads.goals import Goal, GoalState
from keyexpr_schema.payloads.methods import (
    KnownTask,
    MethodTried,
    TaskCalled,
    TasksQuery,
    TasksReply,
)

LISTED = "`robotctl tasks` lists the tasks that have a name"


def tasks_known(state: State, asked: TasksQuery) -> TasksReply:
    """The tasks that goals can call by name, or what a text would mean, and by which methods."""
    if asked.text is not None:
        return _explained(state, asked.text, asked.speaker)
    return TasksReply(
        tasks=tuple(
            KnownTask(
                task=task.name,
                says=task.says,
                about=task.about,
                file=task.file,
                methods=len(task.methods),
            )
            for task in state.policy.tasks
        )
    )


def _explained(state: State, text: str, speaker: str | None) -> TasksReply:
    try:
        found = read(text, state.vocabulary().spoken_by(speaker))
    except CannotBeDone as error:
        tried = _tried(error.passed_over)
        called = TaskCalled(said=error.said, task=error.task, methods=tried)
        return TasksReply(called=(called,), reason=str(error))
    except NotUnderstood as error:
        return TasksReply(reason=said_of(str(error), "a task", LISTED))
    if isinstance(found, Ambiguity):
        readings = [reading for _, reading in found.candidates]
        uses = dict.fromkeys(use for reading in readings for use in reading.methods)
        words = tuple(words for words, _ in found.candidates)
        called_ = tuple(map(_called, uses))
        return TasksReply(called=called_, reason=found.sentence, candidates=words)
    meant = understood(state, Goal(goal="explained", text=text, speaker=speaker), None)
    rejected = meant.status.state is GoalState.REJECTED
    return TasksReply(
        called=tuple(map(_called, found.methods)),
        stages=meant.status.stages,
        always=meant.goal.always,
        never=meant.goal.never,
        understood=None if rejected else found.understood_as,
        reason=meant.status.reason,
    )


def _called(use: MethodUse) -> TaskCalled:
    taken = MethodTried(text=use.text, taken=True)
    return TaskCalled(said=use.said, task=use.task, methods=(*_tried(use.passed_over), taken))


def _tried(rows: Sequence[tuple[str, str]]) -> tuple[MethodTried, ...]:
    return tuple(MethodTried(text=text, reason=reason) for text, reason in rows)
