"""Every task that is shipped is planned in a world of the suite, stage after stage, and checked."""

from __future__ import annotations

from dataclasses import replace as changed
from functools import cache
from pathlib import Path

import pytest
from msgspec.structs import replace

from benchmarks.allocation.household import data
from benchmarks.language.entries import load_suite
from benchmarks.language.reader import skills_of, vocabulary_of
from benchmarks.language.worlds import NOW, load_language_world
from fleet.core.checker.plan_checker import CheckedPlan, check_plan
from fleet.core.model.skills import Skills, phrases_of, state_words_of
from fleet.core.model.world import WorldModel
from fleet.errors import NotUnderstood
from fleet.language import Reading, read
from fleet.planners.base import BIG_DAG, LEAST_WORK, PlanningProblem
from fleet.planners.symbolic.planner import SymbolicPlanner
from fleet.service.skill_models import load_all_skills, load_skills
from fleet.service.task_files import load_all_tasks
from keyexpr_schema.facts import HOLDING, NOTHING, FactKey, Value
from keyexpr_schema.payloads.goals import Goal

EXAMPLE = Path(__file__).parents[3] / "examples" / "breakfast"


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


def planned(
    world: str, meant: Reading, own: Skills | None = None, strategy: str = BIG_DAG
) -> list[str]:
    """The skills that it takes; what a stage makes true is so when the next one begins.

    `own`: skills of all robots with a hand besides those of the world.
    """
    there = load_language_world(world)
    robots = {
        name: replace(spec, skills=(*spec.skills, *(own or ()))) if "grip" in spec.capabilities
        else spec
        for name, spec in there.robots.items()
    }  # fmt: skip
    facts: dict[FactKey, Value] = dict(there.facts)
    hands = (name for name, spec in there.robots.items() if "grip" in spec.capabilities)
    facts |= {FactKey(HOLDING, name): NOTHING for name in hands}
    tasks: list[str] = []
    for goal in meant.goals:
        for number, stage in enumerate(goal.stages, 1):
            model = WorldModel(
                skills={**skills_of(there), **(own or {})},
                places=there.places,
                objects=there.objects,
                robots=robots,
                available=frozenset(there.robots),
                facts=facts,
            )
            wanted = Goal(goal=f"stage-{number}", text=meant.text, conditions=stage)
            problem = PlanningProblem("p", (wanted,), model, strategy=strategy)
            made = SymbolicPlanner().plan(problem)
            assert isinstance(made, CheckedPlan), made
            assert isinstance(check_plan(made.plan, model), CheckedPlan)
            tasks += [task.skill for task in made.plan.tasks]
            facts |= {
                key: value
                for key, value in made.effects.items()
                if not key.subject.startswith("?") and not str(value).startswith("?")
            }
    return tasks


HOUSEHOLD_GOALS = tuple(data()["goals"])
"""Those that RobotFleet (Gupta et al. 2025) measures its planners with."""
TASKS = [task.name for task in load_all_tasks()]


@pytest.mark.parametrize("task", TASKS)
def test_a_shipped_task_is_a_sentence_of_the_suite_and_planned_there(task: str) -> None:
    world, meant = missions()[task]
    assert planned(world, meant)


@cache
def _read_in_the_house(goal: str) -> Reading:
    found = read(goal.replace("_", " "), vocabulary_of("house"), NOW)
    assert isinstance(found, Reading)
    return found


@pytest.mark.parametrize("goal", HOUSEHOLD_GOALS)
def test_the_papers_household_goals_are_understood_by_name_and_planned(goal: str) -> None:
    """By each strategy; but the least work of all for a dozen things takes long to be found."""
    meant = _read_in_the_house(goal)
    few = all(len(stage) < 6 for wanted in meant.goals for stage in wanted.stages)
    for strategy in SymbolicPlanner.strategies:
        if few or strategy != LEAST_WORK:
            assert planned("house", meant, strategy=strategy)


def breakfast(*skill_files: Path) -> Reading:
    skills = load_all_skills(skill_files)
    words = changed(
        vocabulary_of("apartment"),
        skill_phrases=phrases_of(skills),
        state_words=state_words_of(skills),
        tasks=load_all_tasks((EXAMPLE / "tasks.yaml",)),
    )
    found = read("Make breakfast, please.", words, NOW)
    assert isinstance(found, Reading)
    return found


def test_an_example_with_skills_of_its_own_as_timed_processes_is_planned() -> None:
    own = load_skills(EXAMPLE / "skills.yaml")
    meant = breakfast(EXAMPLE / "skills.yaml")
    assert meant.methods[0].number == 1
    skills = planned("apartment", meant, own)
    assert {"cook", "pour", "switch_on", "switch_off"} <= set(skills)


def test_without_those_skills_the_example_is_a_colder_breakfast() -> None:
    meant = breakfast()
    (use,) = meant.methods
    assert (use.number, use.passed_over[0][1]) == (2, "no skill cook is known")
    assert planned("apartment", meant)
