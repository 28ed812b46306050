"""Allocation by language model: asked, checked, repaired; another allocator where that fails."""

from __future__ import annotations

import json
import logging
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from string import Template
from typing import Any, Protocol

import msgspec

from fleet.allocators.base import AllocationProblem, Allocator, Assignment, NotAllocated
from fleet.core.checker.plan_checker import check_plan
from fleet.core.schedule.plan_schedule import best_schedule
from keyexpr_schema.facts import AT
from keyexpr_schema.payloads.plans import Violation

log = logging.getLogger(__name__)

PROMPTS = Path(__file__).parent / "prompts"

Choice = dict[str, str]


class Asker(Protocol):
    """Asks a language model until `read` takes its answer, as often as it sees fit.

    What `read` returns is the choice, or the reasons why the answer is wrong, which the model is
    to be told: by the text `repair`, with `$violations` and `$details` filled in. Returns the
    choice, or one sentence on why there is none. `schema` is the answer's JSON schema. May block.
    """

    def __call__(
        self,
        system: str,
        question: str,
        repair: str,
        schema: dict[str, Any],
        read: Callable[[str], Choice | tuple[Violation, ...]],
    ) -> Choice | str:
        """Ask."""


class Row(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One actor's robot, as the model writes it."""

    actor: str
    robot: str


class Answer(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the model answers."""

    robots: list[Row]


class LlmAllocator(Allocator):
    """A language model chooses among the able robots; what it says is checked before it is taken.

    If it says nothing right, or cannot be asked, `fallback` allocates, and a note says so.
    """

    name = "llm"

    def __init__(self, ask: Asker, fallback: Allocator) -> None:
        self._ask = ask
        self._fallback = fallback
        self._system, self._question, self._repair = (
            (PROMPTS / f"{name}.txt").read_text(encoding="utf-8")
            for name in ("system", "question", "repair")
        )

    def _assign(self, problem: AllocationProblem) -> Mapping[str, str] | Assignment | NotAllocated:
        if not problem.able:
            return {}

        def read(text: str) -> Choice | tuple[Violation, ...]:
            return read_choice(text, problem)

        question = Template(self._question).safe_substitute(problem=problem_text(problem))
        schema = answer_schema(problem)
        try:
            made = self._ask(self._system, question, self._repair, schema, read)
        except Exception as error:
            # What a model says must never stop the fleet, whatever it is.
            log.exception("allocation by language model")
            made = f"asking the language model failed: {error or type(error).__name__}"
        if isinstance(made, dict):
            return made
        note = f"allocated by {self._fallback.name} and not by language model: {made}"
        log.warning(note)
        instead = self._fallback._assign(problem)
        if isinstance(instead, NotAllocated):
            return instead
        if not isinstance(instead, Assignment):
            instead = Assignment(instead)
        return replace(instead, notes=(note, *instead.notes))


def problem_text(problem: AllocationProblem) -> str:
    """The problem as JSON that cannot leave its fence: `<` and `>` are escaped."""
    graph = problem.checked.graph
    rank = {task: i for i, task in enumerate(graph.order if graph else ())}
    tasks = sorted(problem.plan.tasks, key=lambda task: rank[task.task])
    world = problem.world
    data = {
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
    text = json.dumps(data, ensure_ascii=True, indent=1)
    return text.replace("<", "\\u003c").replace(">", "\\u003e")


def answer_schema(problem: AllocationProblem) -> dict[str, Any]:
    """The JSON schema of the answer; names are those of this problem."""
    row = {
        "type": "object",
        "properties": {
            "actor": {"type": "string", "enum": list(problem.able)},
            "robot": {"type": "string", "enum": list(problem.world.team)},
        },
        "required": ["actor", "robot"],
        "additionalProperties": False,
    }
    return {
        "type": "object",
        "properties": {"robots": {"type": "array", "items": row}},
        "required": ["robots"],
        "additionalProperties": False,
    }


def read_choice(text: str, problem: AllocationProblem) -> Choice | tuple[Violation, ...]:
    """The choice that an answer holds, or everything that is wrong with it."""
    start, end = text.find("{"), text.rfind("}")
    try:
        answer = msgspec.json.decode(text[start : end + 1], type=Answer)
    except (msgspec.MsgspecError, UnicodeError) as error:
        return (Violation(code="malformed", sentence=f"the answer is not in its form: {error}"),)
    chosen = {row.actor: row.robot for row in answer.robots}
    sentences = list(_wrong(answer, chosen, problem))
    if sentences:
        return tuple(Violation(code="no-robot", sentence=sentence) for sentence in sentences)
    schedule = best_schedule(problem.plan, problem.checked, chosen, problem.world)
    if schedule is None:
        told = "with these robots some wait for each other for ever: choose others"
        return (Violation(code="no-allocation", sentence=told),)
    return (
        check_plan(problem.plan, problem.world, chosen, schedule.extra_after).violations or chosen
    )


def _wrong(answer: Answer, chosen: Choice, problem: AllocationProblem) -> list[str]:
    found = []
    for actor, times in Counter(row.actor for row in answer.robots).items():
        if actor not in problem.able:
            found.append(f"there is no actor {actor}; there are {', '.join(problem.able)}")
        elif times > 1:
            found.append(f"actor {actor} is given {times} robots; it must be one")
    for actor, robots in problem.able.items():
        if actor not in chosen:
            found.append(f"actor {actor} is given no robot")
        elif chosen[actor] not in robots:
            found.append(f"{chosen[actor]} cannot be actor {actor}; it can be {', '.join(robots)}")
    found += [
        f"actors {one} and {other} must be different robots, and both are {chosen[one]}"
        for one, other in sorted(problem.apart)
        if one in chosen and chosen[one] == chosen.get(other)
    ]
    return found
