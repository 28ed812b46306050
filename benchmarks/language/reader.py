"""The one place where the suite meets the product: sentences in, comparable meanings out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

from benchmarks.language.meanings import Asked, Conditions, Meaning, Wanted, WantedMeaning
from benchmarks.language.worlds import NOW, World, load_language_world
from fleet.core.model.skills import SkillModel, phrases_of, state_words_of
from fleet.errors import NotUnderstood
from fleet.language import Ambiguity, Reading, Vocabulary, WantedGoal, read
from fleet.language.methods.model import CompoundTask
from fleet.service.skill_models import load_skills
from fleet.service.task_files import load_all_tasks
from keyexpr_schema.config_files import config_file
from keyexpr_schema.facts import Literal
from keyexpr_schema.payloads.goals import Condition


@dataclass(frozen=True)
class Read:
    """It was taken for this."""

    meaning: Meaning


@dataclass(frozen=True)
class AskedBack:
    """It could be several things; `names` are told apart where there are no whole meanings."""

    sentence: str
    candidates: tuple[Meaning, ...] = ()
    names: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Refused:
    """It was not understood, and why."""

    sentence: str


Answer = Read | AskedBack | Refused


def answer(text: str, world: str) -> Answer:
    """What the product makes of a text that is said in that world."""
    try:
        found = read(text, vocabulary_of(world), NOW)
    except NotUnderstood as refused:
        return Refused(str(refused))
    if isinstance(found, Ambiguity):
        return AskedBack(found.sentence, tuple(_meaning(each) for _, each in found.candidates))
    return Read(_meaning(found))


@cache
def vocabulary_of(name: str) -> Vocabulary:
    """All that can be spoken of in a world of the suite."""
    world = load_language_world(name)
    carriers = {thing: world.carriers(thing) for thing in (*world.objects, *world.robots)}
    skills = skills_of(world)
    return Vocabulary(
        places=world.places,
        objects=world.objects,
        robots=world.robots,
        whereabouts={
            thing: place
            for thing, found in carriers.items()
            for place in found[-1:]
            if place in world.places
        },
        rests={
            thing: found[0] for thing, found in carriers.items() if found[:1] and len(found) > 1
        },
        skill_phrases=phrases_of(skills),
        carriers=carriers,
        speaker=world.speaker,
        believed=world.facts,
        state_words=state_words_of(skills),
        tasks=_tasks(),
    )


@cache
def _tasks() -> tuple[CompoundTask, ...]:
    return load_all_tasks()


def skills_of(world: World) -> dict[str, SkillModel]:
    """The household's skills and those of the world."""
    skills = dict(load_skills(config_file("skills", "household")))
    for path in world.skill_files:
        skills |= load_skills(path)
    return skills


def _meaning(reading: Reading) -> Meaning:
    question = reading.question
    return Meaning(
        goals=frozenset(_goal(goal).canonical() for goal in reading.goals),
        facts=_facts(reading.facts),
        question=None
        if question is None
        else Asked(question.of, frozenset(question.subjects), _rows(question.holds)).canonical(),
    )


def _goal(goal: WantedGoal) -> WantedMeaning:
    return WantedMeaning(
        stages=tuple(map(_rows, goal.stages)),
        always=_rows(goal.always),
        never=_rows(goal.never),
        when=_rows((*goal.when, *goal.only_if)),
        whenever=_rows(goal.whenever),
        priority=goal.priority,
        due_s=goal.due_s,
        not_before_s=goal.not_before_s,
        every=goal.every,
        by=frozenset(goal.by),
    )


def _rows(conditions: Iterable[Condition]) -> Conditions:
    return frozenset(map(_wanted, conditions))


def _wanted(condition: Condition) -> Wanted:
    relation = f"not {condition.relation}" if condition.negated else condition.relation
    return Wanted(relation, frozenset(condition.subjects), frozenset({condition.value}))


def _facts(literals: Iterable[Literal]) -> Conditions:
    return frozenset(
        Wanted(key.relation, frozenset({key.subject}), frozenset({value}))
        for key, value in literals
    )
