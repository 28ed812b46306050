"""Allocation by language model: asked, checked, corrected; another allocator where that fails."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import msgspec

from fleet.allocators.base import AllocationProblem, Allocator, Assignment, NotAllocated
from fleet.llm.conversation import GivenUp, LanguageModel, Rejected
from fleet.llm.quoting import fenced
from fleet.llm.structured_output import StructuredAnswer, enumerated, read_answer, schema_of
from fleet.scheduling.plan_schedule import AllocatedPlan
from keyexpr_schema.facts import AT
from keyexpr_schema.payloads.plans import Violation

log = logging.getLogger(__name__)


class ActorAnswer(StructuredAnswer, frozen=True):
    """One actor's robot."""

    actor: str
    robot: str


class AllocationAnswer(StructuredAnswer, frozen=True):
    """A robot for every actor."""

    robots: tuple[ActorAnswer, ...]


class LlmAllocator(Allocator):
    """A language model chooses among the able robots, within the budget of one plan.

    If it says nothing right, or cannot be asked, `fallback` allocates, and a note says so.
    """

    name = "llm"

    def __init__(self, model: LanguageModel, fallback: Allocator) -> None:
        self._model = model
        self._fallback = fallback
        self.waiting_s = model.longest_s

    def _assign(self, problem: AllocationProblem) -> Assignment | NotAllocated:
        if not problem.able:
            return Assignment({})
        allocation: dict[str, str] | GivenUp = self._model.ask(
            system="allocate-system",
            question="allocate",
            correction="allocate-repair",
            values={"problem": problem_text(problem)},
            schema=allocation_schema(problem),
            read=lambda text: read_allocation(text, problem),
        )
        if not isinstance(allocation, GivenUp):
            return Assignment(allocation)
        note = f"allocated by {self._fallback.name} and not by language model: {allocation.reason}"
        log.warning(note)
        instead = self._fallback._assign(problem)
        if isinstance(instead, NotAllocated):
            return instead
        return replace(instead, notes=(note, *instead.notes))


def problem_text(problem: AllocationProblem) -> str:
    """Robots, actors with their tasks and able robots, and who must be apart, fenced."""
    rank = {task: i for i, task in enumerate(problem.checked.graph.order)}
    tasks = sorted(problem.plan.tasks, key=lambda task: rank[task.task])
    world = problem.world
    return fenced(
        {
            "robots": [
                {"robot": robot, "at": world.value(AT, robot) or "unknown"} for robot in world.team
            ],
            "actors": [
                {
                    "actor": actor,
                    "can be": list(robots),
                    "tasks": [
                        {
                            "task": task.task,
                            "skill": task.skill,
                            "args": task.args,
                            "after": list(task.after),
                        }
                        for task in tasks
                        if task.actor == actor
                    ],
                }
                for actor, robots in problem.able.items()
            ],
            "apart": sorted(map(list, problem.apart)),
        }
    )


def allocation_schema(problem: AllocationProblem) -> dict[str, Any]:
    """The JSON schema of the answer; names are those of this problem."""
    row: Any = msgspec.defstruct(
        "Row", [("actor", enumerated(problem.able)), ("robot", enumerated(problem.world.team))]
    )
    return schema_of(msgspec.defstruct("Answer", [("robots", list[row])]))


def read_allocation(text: str, problem: AllocationProblem) -> dict[str, str] | Rejected:
    """The allocation that an answer holds, or everything that is wrong with it."""
    answer = read_answer(text, AllocationAnswer)
    if isinstance(answer, str):
        return Rejected.because("malformed", answer)
    allocation = {row.actor: row.robot for row in answer.robots}
    if sentences := _wrong(answer, allocation, problem):
        return Rejected(tuple(Violation(code="no-robot", sentence=text) for text in sentences))
    allocated = AllocatedPlan(problem.checked, allocation)
    schedule = next(allocated.schedules(), None)
    if schedule is None:
        return Rejected.because(
            "no-allocation", "with these robots some wait for each other for ever: choose others"
        )
    violations = allocated.violations(schedule)
    return Rejected(violations) if violations else allocation


def _wrong(
    answer: AllocationAnswer, allocation: Mapping[str, str], problem: AllocationProblem
) -> list[str]:
    sentences = []
    for actor, times in Counter(row.actor for row in answer.robots).items():
        if actor not in problem.able:
            sentences.append(f"there is no actor {actor}; there are {', '.join(problem.able)}")
        elif times > 1:
            sentences.append(f"actor {actor} is given {times} robots; it must be one")
    for actor, robots in problem.able.items():
        if actor not in allocation:
            sentences.append(f"actor {actor} is given no robot")
        elif allocation[actor] not in robots:
            sentences.append(
                f"{allocation[actor]} cannot be actor {actor}; it can be {', '.join(robots)}"
            )
    sentences += [
        f"actors {one} and {other} must be different robots, and both are {allocation[one]}"
        for one, other in sorted(problem.apart)
        if one in allocation and allocation[one] == allocation.get(other)
    ]
    return sentences
