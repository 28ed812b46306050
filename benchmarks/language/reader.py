"""The one place where the suite meets the product: sentences in, comparable meanings out."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from benchmarks.language.meanings import Meaning, Wanted, WantedMeaning
from benchmarks.language.worlds import World, load_language_world, skill_data
from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.skills import SkillModel, phrases_of
from fleet.errors import NotUnderstood
from fleet.language import Reading, Vocabulary, read_goal, statement_facts
from fleet.service.skill_models import load_skills
from keyexpr_schema.config_files import config_file
from keyexpr_schema.facts import Literal
from keyexpr_schema.payloads.goals import Condition

_WHICH = re.compile(r"could be (?P<names>[^:]+): (?:say which|call it by|name)")


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
    words = _vocabulary(world)
    try:
        return Read(_meaning(read_goal(text, words)))
    except NotUnderstood as refused_as_goal:
        try:
            return Read(Meaning(facts=_facts(statement_facts(text, words))))
        except NotUnderstood:
            sentence = str(refused_as_goal)
    which = _WHICH.search(sentence)
    if which is None:
        return Refused(sentence)
    return AskedBack(sentence, names=frozenset(re.split(r", | or ", which["names"])))


@cache
def _vocabulary(name: str) -> Vocabulary:
    world = load_language_world(name)
    carriers = {thing: world.carriers(thing) for thing in (*world.objects, *world.robots)}
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
        skill_phrases=phrases_of(skills_of(world)),
        carriers=carriers,
        speaker=world.speaker,
    )


def skills_of(world: World) -> dict[str, SkillModel]:
    """The household's skills and those of the world."""
    skills = dict(load_skills(config_file("skills", "household")))
    for path in world.skill_files:
        skills |= skills_from_data(_without_words(skill_data(path)), str(path))
    return skills


def _without_words(data: Mapping[str, Any]) -> dict[str, Any]:
    return {
        part: {
            name: {field: value for field, value in row.items() if field != "says"}
            for name, row in rows.items()
        }
        for part, rows in data.items()
    }


def _meaning(reading: Reading) -> Meaning:
    stages = tuple(frozenset(map(_wanted, stage)) for stage in reading.stages)
    return Meaning(goals=frozenset({WantedMeaning(stages=stages).canonical()}))


def _wanted(condition: Condition) -> Wanted:
    return Wanted(condition.relation, frozenset(condition.subjects), frozenset({condition.value}))


def _facts(literals: Iterable[Literal]) -> frozenset[Wanted]:
    return frozenset(
        Wanted(key.relation, frozenset({key.subject}), frozenset({value}))
        for key, value in literals
    )
