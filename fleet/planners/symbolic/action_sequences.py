"""Action sequences that reach one subgoal, or that look for what it needs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

from msgspec.structs import replace

from fleet.core.model.parameter_types import OBJECT
from fleet.core.model.world import WorldModel, condition_holds
from fleet.jobshop.time_budget import TimeBudget
from fleet.planners.base import PlanningProblem
from fleet.planners.deordering import ActionSequence
from fleet.planners.symbolic.search import (
    Facts,
    Solution,
    ground_actions,
    relaxed_reachable,
    uniform_cost_search,
)
from keyexpr_schema.facts import AT, HELD, HOLDING, NOTHING, SEARCHED, FactKey, Value
from keyexpr_schema.payloads.goals import Condition

ALTERNATIVES = 4
"""Different sequences sought for each condition."""
UNLOADING_S = 30.0
"""What it counts for, in seconds, that an object ends in a basket and not on a table: somebody
still has to take it out, which is about one more task for a hand."""
MAX_FULL_HANDS = 2
"""Robots of a kind looked at that would have to put something down first."""
MAX_OBJECTS = 8
"""Objects looked at as possible tools where a subgoal cannot be reached without one."""
REUSE_CHARGE_S = 200.0
"""What an action costs more for each sequence that already uses it; more than any task takes."""


@dataclass(frozen=True)
class Subgoal:
    """One condition of one goal."""

    goal: str
    condition: Condition

    def subjects(self) -> list[Condition]:
        """The condition for each of those for whom it may hold."""
        return [
            replace(self.condition, subject=subject, any_of=())
            for subject in self.condition.subjects
        ]


@dataclass(frozen=True)
class Exploration:
    """Action sequences that are all needed to find one of `seeks`, and what they make true."""

    sequences: tuple[ActionSequence, ...]
    conditions: tuple[Condition, ...]
    seeks: tuple[str, ...]


def subgoals_in_order(problem: PlanningProblem, facts: Mapping[FactKey, Value]) -> list[Subgoal]:
    """Conditions that do not hold in `facts`: first those whose object a hand holds already, last
    those that leave an object in a hand.
    """
    held = {facts.get(FactKey(HOLDING, robot)) for robot in problem.world.team}
    subgoals = [
        Subgoal(goal.goal, condition)
        for goal in sorted(problem.goals, key=lambda g: (-g.priority, g.ordinal, g.goal))
        for condition in goal.conditions
        if not condition_holds(facts, condition, problem.world)
    ]
    return sorted(
        subgoals,
        key=lambda subgoal: (
            subgoal.condition.relation == HELD,
            held.isdisjoint(subgoal.condition.subjects),
        ),
    )


def alternatives_for(
    subgoal: Subgoal,
    facts: Facts,
    world: WorldModel,
    budget: TimeBudget,
    settled: frozenset[str] = frozenset(),
) -> tuple[tuple[ActionSequence, ...], Facts] | None:
    """Different sequences for a subgoal, the cheapest first, and the facts after that one; `None`
    where there is none, or none was found within the `budget`.

    Where a robot stands is left open at the start, so that every actor begins with the way to its
    work, whatever its robot does before; `settled` robots are taken to be where `facts` say.
    """
    found = [
        (result, condition)
        for condition in subgoal.subjects()
        for result in _different_solutions(condition, facts, world, settled, budget)
    ]
    if not found:
        return None
    found.sort(key=lambda pair: pair[0].cost_s + _unloading_s(pair[0], pair[1], world))
    sequences: dict[object, ActionSequence] = {}
    for result, condition in found:
        # What rides in a basket already rides with a certain robot.
        rides_with = world.value(AT, condition.subject)
        spoken_of = (condition.subject, condition.value, rides_with)
        named = frozenset(robot for robot in world.robots if robot in spoken_of)
        content = tuple((action.skill.name, *action.args.values()) for action in result.actions)
        sequences.setdefault(content, ActionSequence(subgoal.goal, result.actions, named))
    return tuple(sequences.values())[:ALTERNATIVES], found[0][0].facts


def _unloading_s(found: Solution, condition: Condition, world: WorldModel) -> float:
    """The charge for an object that ends in a basket."""
    where = found.facts.get(FactKey(AT, condition.subject))
    wanted = where == condition.value or condition.relation == HELD
    return 0.0 if wanted or where not in world.robots else UNLOADING_S


def _different_solutions(
    condition: Condition,
    facts: Facts,
    world: WorldModel,
    settled: frozenset[str],
    budget: TimeBudget,
) -> list[Solution]:
    """The cheapest sequence, and others made different by charging for what was used before."""
    subject = condition.subject
    robots = _representatives(condition, facts, world)
    start: Facts = dict(facts)
    for robot in world.robots.keys() - settled:
        start[FactKey(AT, robot)] = None
    objects = sorted(_held(robots, facts) | ({subject} & world.objects.keys()))
    results = _cheapest_few(condition, robots, objects, start, facts, world, budget)
    if results or not _needs_a_tool(condition, world):
        return results
    # Something else may be needed for it, such as a tool.
    known = [thing for thing in world.objects if facts.get(FactKey(AT, thing)) is not None]
    robots = _representatives(condition, facts, world, tools=True)
    wider = sorted({*objects, *_held(robots, facts), *known[:MAX_OBJECTS]})
    return _cheapest_few(condition, robots, wider, start, facts, world, budget)


def _needs_a_tool(condition: Condition, world: WorldModel) -> bool:
    """Whether a skill for it takes more objects than the one that the condition is about."""
    own = condition.subject in world.objects
    return any(
        sum(kind.bases == (OBJECT,) for kind in skill.types.values()) > own
        for skill in world.skills.values()
        if any(row.variable.relation == condition.relation for row in skill.after)
    )


def _cheapest_few(
    condition: Condition,
    robots: Sequence[str],
    objects: Sequence[str],
    start: Facts,
    facts: Facts,
    world: WorldModel,
    budget: TimeBudget,
) -> list[Solution]:
    grounded = ground_actions(world, robots, objects, condition)
    actions = relaxed_reachable(grounded, start, condition, world)
    if not actions:
        return []  # nothing that these objects are good for makes it true
    stands = [FactKey(AT, action.actor) for action in actions]
    numbers = {id(action): number for number, action in enumerate(actions)}
    charge_s = [0.0] * len(actions)

    @cache
    def duration_s(number: int, origin: Value) -> float:
        return world.duration_s(actions[number], origin, actions[number].actor)

    def cost_s(number: int, now: Mapping[FactKey, Value]) -> float:
        origin = now.get(stands[number]) or facts.get(stands[number])
        return duration_s(number, origin) + charge_s[number]

    solutions: list[Solution] = []
    for _ in range(ALTERNATIVES):
        found = uniform_cost_search(actions, start, condition, world, cost_s, budget)
        if found is None:
            break
        used = [numbers[id(action)] for action in found.actions]
        true_cost_s = found.cost_s - sum(charge_s[number] for number in used)
        solutions.append(Solution(found.actions, round(true_cost_s, 6), found.facts))
        for number in used:
            charge_s[number] += REUSE_CHARGE_S
    return solutions


def _representatives(
    condition: Condition, facts: Facts, world: WorldModel, tools: bool = False
) -> list[str]:
    """One robot of each kind that is interchangeable now, and those that are spoken of.

    What a hand holds, if not the subject, only has to be put down, and each thing more would
    multiply the states to be looked at: a few such robots stand for all. With `tools` what they
    hold may be of use.
    """
    subject = condition.subject
    kinds: dict[object, str] = {}
    full: Counter[object] = Counter()
    for robot in world.team:
        spec = world.robots[robot]
        holds = facts.get(FactKey(HOLDING, robot))
        named = robot in (subject, condition.value) or facts.get(FactKey(AT, subject)) == robot
        able = spec.skills, tuple(sorted(spec.capabilities.items()))
        if not (named or tools or holds in (None, NOTHING, subject)):
            full[able] += 1
            if full[able] > MAX_FULL_HANDS:
                continue
        alone = named or robot in world.marked
        kinds.setdefault((able, holds, robot if alone else None), robot)
    return sorted(kinds.values())


def _held(robots: Sequence[str], facts: Facts) -> set[str]:
    """What these robots have in their hands."""
    values = (facts.get(FactKey(HOLDING, robot)) for robot in robots)
    return {value for value in values if isinstance(value, str) and value != NOTHING}


def exploration_for(
    subgoals: Sequence[Subgoal], problem: PlanningProblem, budget: TimeBudget
) -> Exploration | None:
    """Looking around in every place where nobody has looked yet, for all that the subgoals lack.

    `None` where nothing is left to look for, or nobody can look. Places that the `budget` does not
    suffice for are left to a later revision.
    """
    world = problem.world
    seeks = tuple(
        dict.fromkeys(
            subject
            for subgoal in subgoals
            for subject in subgoal.condition.subjects
            if subject in world.objects and world.value(AT, subject) is None
        )
    )
    if not seeks:
        return None
    facts: Facts = dict(world.facts)
    sequences: list[ActionSequence] = []
    conditions: list[Condition] = []
    for place in world.places:
        if place in problem.searched:
            continue
        facts[FactKey(SEARCHED, place)] = False
        condition = Condition(relation=SEARCHED, subject=place, value=True)
        found = alternatives_for(Subgoal(subgoals[0].goal, condition), facts, world, budget)
        if found is not None:
            sequences.append(found[0][0])
            conditions.append(condition)
    return Exploration(tuple(sequences), tuple(conditions), seeks) if sequences else None
