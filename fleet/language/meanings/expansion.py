"""Tasks that a text calls by name: which method is taken, and what it means here.

A method's sentences are read like any others; so whatever goes for goals goes for tasks.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod

from fleet.errors import NotUnderstood
from fleet.language.meanings.needs import check_needs
from fleet.language.methods.model import filled
from fleet.language.reading import MethodUse, Reading, WantedGoal
from fleet.language.resolve.discourse import Discourse
from fleet.language.resolve.reference.mentions import Mention
from fleet.language.resolve.wish import Wish
from fleet.language.tagging.task_phrases import TaskCall
from fleet.language.vocabulary import Vocabulary

MOST_DEEP = 5
"""Tasks that may be named by each other's methods, one inside the other."""
_KEYS = 10_000_000
"""Wishes of tasks are counted from there, apart from what noun phrases mean."""
MOST_MEANINGS = 12
"""Of so many that a task may have here, one is asked for."""

Row = tuple[int, str, Reading]
"""What a text can mean: its cost, the question that it is an answer to, the reading."""


class CannotBeDone(NotUnderstood):
    """No method of a task can be taken.

    `said` called it; `passed_over` are its methods, and why they cannot be taken.
    """

    def __init__(
        self, sentence: str, said: str, task: str, passed_over: Sequence[tuple[str, str]]
    ) -> None:
        super().__init__(sentence)
        self.said, self.task, self.passed_over = said, task, tuple(passed_over)


class TaskRefused(NotUnderstood):
    """A task is refused whatever other methods it has: it is a part of itself, or leaves too much
    open."""


@dataclass(frozen=True)
class Expansion:
    """One thing that a task can mean: by which method, and what its sentences mean, row by row.

    `asked` is the question to which it is an answer.
    """

    use: MethodUse
    rows: tuple[tuple[Reading, ...], ...]
    asked: str = ""


def expanded(
    call: TaskCall,
    vocabulary: Vocabulary,
    within: tuple[str, ...],
    read: Callable[[str, tuple[str, ...]], list[Row]],
) -> list[Expansion]:
    """What a task means here, by the first of its methods that can be taken: all that is equally
    plain.

    `read` reads a sentence, `within` are the tasks of which this one is a part.

    Raises:
        CannotBeDone: none can be taken; one sentence says why.
        TaskRefused: it is a part of itself, or leaves too much open.
    """
    task, said = call.task, call.lexeme.text
    if task.name in within or len(within) >= MOST_DEEP:
        way = " → ".join((*within, task.name))
        what = "is a part of itself" if task.name in within else "has tasks in tasks too deep"
        raise TaskRefused(f"{said!r} {what}: {way}; say in {task.file} what it means")
    given = dict(call.lexeme.given)
    passed: list[tuple[str, str]] = []
    for number, method in enumerate(task.methods, 1):
        text = method.text(given)
        try:
            check_needs(method, given, vocabulary)
            read_ = [
                [_plainest(read(filled(each, given), (*within, task.name))) for each in row]
                for row in method.do
            ]
        except TaskRefused:
            raise
        except NotUnderstood as problem:
            passed.append((text, str(problem)))
            continue
        use = MethodUse(said, task.name, number, text, tuple(passed))
        return _choices(use, read_)
    reasons = "; ".join(dict.fromkeys(why for _, why in passed))
    sentence = f"{said!r} cannot be done here: {reasons}"
    raise CannotBeDone(sentence, said, task.name, passed)


def _plainest(rows: Sequence[Row]) -> list[tuple[str, Reading]]:
    """What a sentence means, or all that it can, with the question that tells that apart."""
    best = [reading for cost, _, reading in rows if cost == rows[0][0]]
    for reading in best:
        _check(reading)
    asked = rows[0][1] or f"{best[0].text!r} can mean several things"
    return [(asked if best[1:] else "", reading) for reading in best]


def _choices(
    use: MethodUse, rows: Sequence[Sequence[list[tuple[str, Reading]]]]
) -> list[Expansion]:
    """Each choice of a meaning for every sentence.

    Raises:
        TaskRefused: there are too many.
    """
    asked = next((each[0][0] for row in rows for each in row if each[1:]), "")
    if prod(len(each) for row in rows for each in row) > MOST_MEANINGS:
        raise TaskRefused(f"{use.said!r} leaves too much open here: {asked}")
    each_row = [
        [tuple(reading for _, reading in chosen) for chosen in product(*row)] for row in rows
    ]
    return [Expansion(use, chosen, asked) for chosen in product(*each_row)]


def _check(reading: Reading) -> None:
    """Whether it says no more than what shall be done."""
    if reading.question is not None or reading.facts:
        raise NotUnderstood(f"{reading.text!r} says more than what is to be done")
    plain = tuple(
        WantedGoal(g.stages, g.always, g.never, by=g.by, priority=g.priority) for g in reading.goals
    )
    if plain != reading.goals:
        raise NotUnderstood(f"{reading.text!r} says when; say that along with the task instead")


def take(said: Discourse, call: TaskCall, meant: Expansion, robots: Container[str]) -> None:
    """Take what a task means into what a text has said so far."""
    stages, key = said.draft.stages, -_KEYS * (call.lexeme.first + 1)
    said.methods.append(meant.use)
    for later, row in enumerate(meant.rows):
        begins = len(stages) if later else len(stages) - 1
        for reading in row:
            for goal in reading.goals:
                for number, stage in enumerate(goal.stages, begins):
                    if number == len(stages):
                        stages.append([])
                    for condition in stage:
                        named, key = condition.subjects, key - 1
                        by = None if named[0] in robots else call.by or goal.by
                        stages[number].append(
                            Wish(
                                condition.relation,
                                named,
                                condition.value,
                                key,
                                open=len(named) > 1,
                                by=by,
                            )
                        )
                said.always.extend(goal.always)
                said.never.extend(goal.never)
            said.presumed.extend(reading.presumed)
            said.methods.extend(reading.methods)
    said.recent, said.done = list[Mention](), True
