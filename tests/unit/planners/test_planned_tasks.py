"""Every task that is shipped is planned in a world of the suite, stage after stage, and checked."""

from __future__ import annotations

from functools import cache

import pytest

from benchmarks.language.entries import load_suite
from benchmarks.language.reader import skills_of, vocabulary_of
from benchmarks.language.worlds import NOW, load_language_world
from fleet.core.checker.plan_checker import CheckedPlan, check_plan
from fleet.core.model.world import WorldModel
from fleet.errors import NotUnderstood
from fleet.language import Reading, read
from fleet.planners.base import PlanningProblem
from fleet.planners.symbolic.planner import SymbolicPlanner
from fleet.service.task_files import load_all_tasks
from keyexpr_schema.facts import HOLDING, NOTHING, FactKey, Value
from keyexpr_schema.payloads.goals import Goal


@cache
def missions() -> dict[str, tuple[str, Reading]]:
    """The first sentence of the suite that calls each task: its world, and what it means there."""
    found: dict[str, tuple[str, Reading]] = {}
    for sentence in load_suite("dev", "vague"):
        entry = sentence.entry
        try:
            meant = read(entry.say, vocabulary_of(entry.world), NOW)
        except NotUnderstood:
            continue
        if isinstance(meant, Reading):
            for use in meant.methods:
                found.setdefault(use.task, (entry.world, meant))
    return found


def planned(world: str, meant: Reading) -> int:
    """How many tasks it takes; what a stage makes true is so when the next one begins."""
    there = load_language_world(world)
    facts: dict[FactKey, Value] = dict(there.facts)
    hands = (name for name, spec in there.robots.items() if "grip" in spec.capabilities)
    facts |= {FactKey(HOLDING, name): NOTHING for name in hands}
    tasks = 0
    for goal in meant.goals:
        for number, stage in enumerate(goal.stages, 1):
            model = WorldModel(
                skills=skills_of(there),
                places=there.places,
                objects=there.objects,
                robots=there.robots,
                available=frozenset(there.robots),
                facts=facts,
            )
            wanted = Goal(goal=f"stage-{number}", text=meant.text, conditions=stage)
            made = SymbolicPlanner().plan(PlanningProblem("p", (wanted,), model))
            assert isinstance(made, CheckedPlan), made
            assert isinstance(check_plan(made.plan, model), CheckedPlan)
            tasks += len(made.plan.tasks)
            facts |= {
                key: value
                for key, value in made.effects.items()
                if not key.subject.startswith("?") and not str(value).startswith("?")
            }
    return tasks


TASKS = [task.name for task in load_all_tasks()]


@pytest.mark.parametrize("task", TASKS)
def test_a_shipped_task_is_a_sentence_of_the_suite_and_planned_there(task: str) -> None:
    world, meant = missions()[task]
    assert planned(world, meant) > 0
