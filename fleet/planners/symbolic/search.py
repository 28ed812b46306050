"""The cheapest sequence of ground actions to a condition, by uniform-cost search (Dijkstra 1959).

State variables that no relevant action writes keep their value and are left out of the state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count, product

from fleet.core.model.preconditions import applicable
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel, condition_holds, known_value
from fleet.jobshop.time_budget import TimeBudget
from keyexpr_schema.facts import AT, HELD, HOLDING, LOCATED, FactKey, Literal, Value
from keyexpr_schema.payloads.goals import Condition

DERIVED_FROM = {LOCATED: {AT}, HELD: {AT, HOLDING}}
"""Relations that a derived one is read off."""
MAX_EXPANSIONS = 30_000
"""States looked at before the search gives up."""

Facts = dict[FactKey, Value]


@dataclass(frozen=True)
class Solution:
    """A sequence of actions, its cost [s], and the facts it leads to."""

    actions: tuple[Action, ...]
    cost_s: float
    facts: Facts


def ground_actions(
    world: WorldModel, robots: Sequence[str], objects: Sequence[str], goal: Condition
) -> list[Action]:
    """Every action of these robots on these objects that can help with the goal.

    An action helps if it makes something true that the goal, or an action that helps, wants. What
    only undoes, or makes true what nobody asks for (that another place was searched), is left out:
    it would never be on a cheapest way, and would multiply the states to be looked at.
    """
    there = (*robots, *objects, *world.places)
    possible: list[Action] = []
    for name in sorted(_related(world, goal)):
        skill = world.skills[name]
        names = (
            [name for name in there if world.is_of_type(name, kind)]
            for kind in skill.types.values()
        )
        for values in product(*names):
            action = skill.ground(dict(zip(skill.parameters, values, strict=True)))
            if len(set(action.participants)) == len(action.participants) and not any(
                world.lacks(action.args[parameter], action, parameter)
                for parameter in skill.robot_parameters
            ):
                possible.append(action)
    makers: dict[Literal, list[int]] = {}
    for number, action in enumerate(possible):
        for literal in action.after:
            makers.setdefault(literal, []).append(number)
    wanted = [literal for literal in makers if _serves(literal, goal, world)]
    helpful: set[int] = set()
    seen = set(wanted)
    while wanted:
        for number in makers.get(wanted.pop(), ()):
            if number in helpful:
                continue
            helpful.add(number)
            action = possible[number]
            needed = [*action.before, *_making_room(action, makers)]
            wanted.extend(literal for literal in needed if literal not in seen)
            seen.update(needed)
    return [possible[number] for number in sorted(helpful)]


def _related(world: WorldModel, goal: Condition) -> set[str]:
    """Skills that write a relation which the goal, or such a skill, reads."""
    wanted = set(DERIVED_FROM.get(goal.relation, {goal.relation}))
    related: set[str] = set()
    while True:
        more = {
            name
            for name, skill in world.skills.items()
            if name not in related and wanted & {row.variable.relation for row in skill.after}
        }
        if not more:
            return related
        related |= more
        wanted |= {row.variable.relation for name in more for row in world.skills[name].before}


def _serves(literal: Literal, goal: Condition, world: WorldModel) -> bool:
    """Whether a literal can be part of what makes the goal hold.

    `at(object) = place` is also reached in the basket of a robot that is there and whose hand holds
    something else; derived relations are read off several variables.
    """
    if goal.relation in DERIVED_FROM:
        return literal.variable.relation in DERIVED_FROM[goal.relation]
    subjects = set(goal.subjects)
    if literal.variable.relation == goal.relation and literal.variable.subject in subjects:
        return literal.value == goal.value or literal.value in world.robots
    return (
        goal.relation == AT
        and not subjects.isdisjoint(world.objects)
        and (
            (
                literal.variable.relation == AT
                and literal.variable.subject in world.robots
                and literal.value == goal.value
            )
            or (literal.variable.relation == HOLDING and literal.value not in subjects)
        )
    )


def _making_room(action: Action, makers: Mapping[Literal, list[int]]) -> list[Literal]:
    """What takes an object out of a basket that must have room."""
    if not action.space_in:
        return []
    return [
        literal
        for literal in makers
        if literal.variable.relation == AT
        and literal.value not in action.space_in
        and literal.variable.subject not in action.args.values()
    ]


def relaxed_reachable(
    actions: Iterable[Action], start: Facts, goal: Condition, world: WorldModel
) -> tuple[Action, ...]:
    """Those actions that can ever be done from `start`; none if the goal is out of reach for them.

    As if nothing that is true ever ceased to be so (the delete relaxation, Bonet and Geffner 2001):
    what is out of reach then is so indeed, and a search would only find that out by looking at
    every state there is.
    """
    true: dict[FactKey, set[Value]] = {}

    def may_hold(literal: Literal) -> bool:
        if literal.variable not in true:
            true[literal.variable] = {known_value(literal.variable, start, world)}
        return literal.value in true[literal.variable]

    left, possible = list(actions), list[Action]()
    grown = True
    while grown:
        grown, waiting = False, left
        left = []
        for action in waiting:
            if not all(may_hold(literal) for literal in action.before):
                left.append(action)
                continue
            possible.append(action)
            grown = True
            for literal in action.after:
                may_hold(literal)
                true[literal.variable].add(literal.value)
    if goal.relation not in DERIVED_FROM and not any(
        _may_hold_for(subject, goal, may_hold, world) for subject in goal.subjects
    ):
        return ()
    return tuple(possible)


def _may_hold_for(
    subject: str, goal: Condition, may_hold: Callable[[Literal], bool], world: WorldModel
) -> bool:
    if may_hold(Literal(FactKey(goal.relation, subject), goal.value)):
        return True
    return goal.relation == AT and any(
        may_hold(Literal(FactKey(AT, subject), robot))
        and may_hold(Literal(FactKey(AT, robot), goal.value))
        for robot in world.robots
    )


def uniform_cost_search(
    actions: Sequence[Action],
    start: Facts,
    goal: Condition,
    world: WorldModel,
    cost_s: Callable[[int, Mapping[FactKey, Value]], float],
    budget: TimeBudget,
) -> Solution | None:
    """The cheapest sequence of `actions` from `start` to a state in which `goal` holds; `None`
    where there is none, or none was found before the `budget` was over.

    `cost_s` is of an action, by its number, in a state.
    """
    variables = tuple(
        dict.fromkeys(literal.variable for action in actions for literal in action.after)
    )
    index = {variable: number for number, variable in enumerate(variables)}
    first = tuple(start.get(variable) for variable in variables)
    # What no action writes is looked up once; the rest is compared as the numbers that it is.
    moves = [
        (
            number,
            action,
            [index[row.variable] for row in action.before if row.variable in index],
            [row.value for row in action.before if row.variable in index],
            [(index[row.variable], row.value) for row in action.after],
        )
        for number, action in enumerate(actions)
        if all(
            known_value(row.variable, start, world) == row.value
            for row in action.before
            if row.variable not in index
        )
    ]
    ticket = count()
    queue: list[tuple[float, int, tuple[Value, ...]]] = [(0.0, next(ticket), first)]
    best: dict[tuple[Value, ...], float] = {first: 0.0}
    came: dict[tuple[Value, ...], tuple[tuple[Value, ...], Action]] = {}
    closed: set[tuple[Value, ...]] = set()
    while queue and len(closed) < MAX_EXPANSIONS and not budget.over:
        spent, _, state = heappop(queue)
        if state in closed:
            continue
        closed.add(state)
        facts = {**start, **dict(zip(variables, state, strict=True))}
        if condition_holds(facts, goal, world):
            return Solution(_path(state, came), spent, facts)
        for number, action, reads, needed, writes in moves:
            if [state[i] for i in reads] != needed:
                continue
            if action.space_in and not applicable(action, facts, world):
                continue
            values = list(state)
            for i, value in writes:
                values[i] = value
            reached = tuple(values)
            total = spent + cost_s(number, facts)
            if total < best.get(reached, float("inf")):
                best[reached] = total
                came[reached] = state, action
                heappush(queue, (total, next(ticket), reached))
    return None


def _path(
    state: tuple[Value, ...],
    came: Mapping[tuple[Value, ...], tuple[tuple[Value, ...], Action]],
) -> tuple[Action, ...]:
    actions: list[Action] = []
    while state in came:
        state, action = came[state]
        actions.append(action)
    return tuple(reversed(actions))
