"""Robots that are interchangeable now: of each class, as many as one skill takes are looked at."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from fleet.core.model.eligibility import mark
from fleet.core.model.parameter_types import OBJECT
from fleet.core.model.preconditions import spoken_of
from fleet.core.model.skills import SkillModel
from fleet.core.model.world import WorldModel
from fleet.planners.symbolic.engine.relevance import related_skills
from fleet.planners.symbolic.engine.travel import can_be_put_off
from keyexpr_schema.facts import AT, HOLDING, NOTHING, FactKey, Literal, Value
from keyexpr_schema.payloads.goals import Condition
from keyexpr_schema.payloads.robots import RobotSpec

MAX_FULL_HANDS = 2
"""Robots of a kind looked at that would have to put something down first."""


def representatives(
    conditions: Sequence[Condition],
    facts: Mapping[FactKey, Value],
    world: WorldModel,
    on_the_way: Sequence[Condition] = (),
    thorough: bool = False,
) -> list[str]:
    """One robot of each kind that is interchangeable now, as many where a skill takes several of
    the kind, and those that are spoken of. Robots of which the facts say different things that
    skills ask for are of different kinds, and so are those at different places that cannot drive.

    What a hand holds, if not the subject, only has to be put down, and each thing more would
    multiply the states to be looked at: a few such robots stand for all, unless it may be a tool,
    or the search is `thorough`.
    """
    subjects = {condition.subject for condition in conditions}
    spoken_of = subjects | {condition.value for condition in conditions}
    spoken_of |= {name for c in on_the_way for name in (*c.subjects, c.value)}
    spoken_of |= {facts.get(FactKey(AT, subject)) for subject in subjects}
    tools = thorough or any(_needs_a_tool(condition, world) for condition in conditions)
    kinds: dict[object, list[str]] = {}
    full: Counter[object] = Counter()
    together: dict[object, int] = {}
    goal = [Literal(FactKey(c.relation, c.subject), c.value) for c in conditions]
    skills = related_skills(world, goal)
    asked = _asked_of_robots(skills)
    for robot in world.team:
        spec = world.robots[robot]
        holds = facts.get(FactKey(HOLDING, robot))
        named = robot in spoken_of
        able = spec.skills, tuple(sorted(spec.offers.items()))
        if not (named or tools or holds in (None, NOTHING) or holds in subjects):
            full[able] += 1
            if full[able] > MAX_FULL_HANDS:
                continue
        drives = any(
            name in world.skills and can_be_put_off(world.skills[name]) for name in spec.skills
        )
        relations = asked - {AT} if drives else asked
        known = tuple(facts.get(FactKey(relation, robot)) for relation in sorted(relations))
        same = kinds.setdefault((able, holds, known, robot if named else mark(world, robot)), [])
        if able not in together:
            together[able] = max([1, *(_places_for(skill, spec) for skill in skills)])
        if len(same) < together[able]:
            same.append(robot)
    return sorted(robot for same in kinds.values() for robot in same)


def _asked_of_robots(skills: Sequence[SkillModel]) -> frozenset[str]:
    """The relations that skills ask of their robots, but for what they hold."""
    asked = set[str]()
    for skill in skills:
        formulas = (*skill.conditions, *(effect.when for effect in skill.conditional))
        read = [row.variable for row in skill.before]
        read += [key for formula in formulas for key in spoken_of(formula)]
        asked |= {key.relation for key in read if key.subject in skill.robot_parameters}
    return frozenset(asked - {HOLDING})


def _needs_a_tool(condition: Condition, world: WorldModel) -> bool:
    """Whether a skill for it takes more objects than the one that the condition is about."""
    own = condition.subject in world.objects
    return any(
        sum(kind.bases == (OBJECT,) for kind in skill.types.values()) > own
        for skill in world.skills.values()
        if any(row.variable.relation == condition.relation for row in skill.after)
    )


def _places_for(skill: SkillModel, spec: RobotSpec) -> int:
    """How many of a skill's robots could be like this one."""
    return sum(
        all(need.capability in spec.offers for need in skill.needs.get(parameter, ()))
        and (parameter != skill.actor_parameter or skill.name in spec.skills)
        for parameter in skill.robot_parameters
    )
