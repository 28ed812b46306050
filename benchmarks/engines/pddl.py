"""Household problems in PDDL, made from the skill models, specs and facts that our planner has.

Every relation becomes a predicate `(is-relation subject value)`; a skill that overwrites a variable
gets one more parameter, its old value. Capabilities become static predicates, the room in a basket
so many slots. What is unknown is left out, so every fact that a skill needs must be known. Types of
things are static predicates. Skills with formulas, and those that need what is read off other
variables, are left out; that nothing is closed is taken for granted.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from fleet.core.model.derived import DERIVED
from fleet.core.model.parameter_types import BASE_TYPES
from fleet.core.model.skills import Action, Need, SkillModel
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import AT, HOLDING, IN, NOTHING, ON, REACHABLE, FactKey, Literal, Value
from keyexpr_schema.payloads.goals import Condition

Step = tuple[str, tuple[str, ...]]
"""A step of a plan: the action's name and its arguments, as PDDL has them."""


def domain(world: WorldModel) -> str:
    """The skills as a typed STRIPS domain."""
    skills = _plain(world)
    relations = sorted(
        {row.variable.relation for skill in skills for row in (*_before(skill), *skill.after)}
        | {AT, HOLDING}
    )
    predicates = [f"(is-{relation} ?subject - thing ?value - thing)" for relation in relations]
    predicates += ["(slot ?slot - thing ?robot - thing)", "(empty ?slot - thing)"]
    predicates += ["(other ?one - thing ?two - thing)"]
    statics = {_static(need): need for _, need in _needs(skills)}
    predicates += [
        f"({name} ?robot - thing{' ?of - thing' if need.of else ''})"
        for name, need in sorted(statics.items())
    ]
    predicates += [f"(skilled-{skill.name} ?robot - thing)" for skill in skills]
    predicates += [f"({_type(kind)} ?name - thing)" for kind in sorted(_kinds(skills))]
    words = sorted(
        {
            _word(row.value)
            for s in skills
            for row in (*_before(s), *s.after)
            if row.value not in s.parameters
        }
    )
    return "\n".join(
        [
            "(define (domain household)",
            "(:requirements :strips :typing)",
            "(:types a-robot a-object a-place a-word a-slot - thing)",
            f"(:constants {' '.join(words)} - a-word)",
            f"(:predicates {' '.join(predicates)})",
            *(_action(skill) for skill in skills),
            ")",
        ]
    )


def problem(world: WorldModel, conditions: Iterable[Condition]) -> str:
    """The facts, what robots can do, and the conditions that must all hold."""
    slots = [
        (f"slot-{robot}-{number}", robot)
        for robot in world.team
        for number in range(int(world.capability(robot, "basket") or 0))
    ]
    known = [
        f"(is-{variable.relation} {variable.subject} {_word(value)})"
        for variable, value in world.facts.items()
        if value is not None
    ]
    known += [f"(slot {slot} {robot}) (empty {slot})" for slot, robot in slots]
    known += [f"(other {a} {b})" for a in world.team for b in world.team if a != b]
    known += _abilities(world)
    known += [
        f"({_type(kind)} {name})"
        for kind in sorted(_kinds(_plain(world)))
        for name in world.of_type(kind)
    ]
    goals = " ".join(f"(is-{c.relation} {c.subject} {_word(c.value)})" for c in conditions)
    names = [
        f"{' '.join(world.team)} - a-robot",
        f"{' '.join(world.objects)} - a-object",
        f"{' '.join(world.places)} - a-place",
        f"{' '.join(slot for slot, _ in slots)} - a-slot" if slots else "",
    ]
    return "\n".join(
        [
            "(define (problem mission) (:domain household)",
            f"(:objects {' '.join(names)})",
            f"(:init {' '.join(known)})",
            f"(:goal (and {goals})))",
        ]
    )


def actions(steps: Sequence[Step], world: WorldModel) -> list[Action]:
    """The ground actions of a plan; parameters that were added for PDDL are left out."""
    found = []
    for name, values in steps:
        skill = world.skills[name]
        found.append(skill.ground(dict(zip(skill.parameters, values, strict=False))))
    return found


def _plain(world: WorldModel) -> list[SkillModel]:
    """The skills that can be said in STRIPS."""
    return [
        skill
        for _, skill in sorted(world.skills.items())
        if not skill.conditions
        and not skill.conditional
        and {row.variable.relation for row in _before(skill)}.isdisjoint((*DERIVED, ON, IN))
    ]


def _before(skill: SkillModel) -> list[Literal]:
    return [row for row in skill.before if row.variable.relation != REACHABLE]


def _kinds(skills: Iterable[SkillModel]) -> set[str]:
    return {kind for skill in skills for kind in skill.parameters.values()} - set(BASE_TYPES)


def _type(kind: str) -> str:
    return "kind-" + re.sub(r"\W+", "-", kind)


def _action(skill: SkillModel) -> str:
    parameters = [f"?{name} - a-{kind.bases[0]}" for name, kind in skill.types.items()]
    known = dict(_before(skill))
    before = [f"(is-{r} ?{s} {_term(v, skill)})" for (r, s), v in _before(skill)]
    before += [
        f"({_type(kind)} ?{name})"
        for name, kind in skill.parameters.items()
        if kind not in BASE_TYPES
    ]
    before += [f"(skilled-{skill.name} ?{skill.actor_parameter})"]
    robots = skill.robot_parameters
    before += [f"(other ?{a} ?{b})" for i, a in enumerate(robots) for b in robots[i + 1 :]]
    for parameter, need in _needs([skill]):
        of = f" ?{need.of}" if need.of else ""
        before.append(f"({_static(need)} ?{parameter}{of})")
    after = []
    for (relation, subject), value in skill.after:
        old = known.get(FactKey(relation, subject))
        if old is None:
            name = f"old-{relation}-{subject}"
            parameters.append(f"?{name} - thing")
            before.append(f"(is-{relation} ?{subject} ?{name})")
            term = f"?{name}"
        else:
            term = _term(old, skill)
        after.append(f"(not (is-{relation} ?{subject} {term}))")
        after.append(f"(is-{relation} ?{subject} {_term(value, skill)})")
    for carrier in skill.space_in:
        parameters.append(f"?slot-{carrier} - a-slot")
        before += [f"(slot ?slot-{carrier} ?{carrier})", f"(empty ?slot-{carrier})"]
        after.append(f"(not (empty ?slot-{carrier}))")
    return (
        f"(:action {skill.name} :parameters ({' '.join(parameters)}) "
        f":precondition (and {' '.join(before)}) :effect (and {' '.join(after)}))"
    )


def _abilities(world: WorldModel) -> list[str]:
    plain = {skill.name for skill in _plain(world)}
    found = [
        f"(skilled-{skill} {robot})"
        for robot in world.team
        for skill in world.robots[robot].skills
        if skill in plain
    ]
    for need in {need for _, need in _needs(_plain(world))}:
        for robot in world.team:
            has = world.capability(robot, need.capability)
            if has is None:
                continue
            if need.measure is None:
                found.append(f"({_static(need)} {robot})")
                continue
            things = world.objects if need.measure == "mass" else world.places
            found += [
                f"({_static(need)} {robot} {thing})"
                for thing in things
                if world.measure(need.measure, thing) <= has
            ]
    return sorted(found)


def _needs(skills: Iterable[SkillModel]) -> list[tuple[str, Need]]:
    return [(p, need) for skill in skills for p, needs in skill.needs.items() for need in needs]


def _static(need: Need) -> str:
    return f"can-{need.capability}" + (f"-{need.measure}" if need.measure else "")


def _term(value: str | Value, skill: SkillModel) -> str:
    return f"?{value}" if value in skill.parameters else _word(value)


def _word(value: Value) -> str:
    return f"w-{str(value).lower()}" if value in (True, False, NOTHING) else str(value)
