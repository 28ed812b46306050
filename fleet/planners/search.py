"""Cheapest sequence of ground actions to a condition: A* over the variables that matter.

State variables that no relevant action writes keep their value and are left out of the state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count, product

from fleet.core.skills import Action, Variable
from fleet.core.world_model import (
    HELD,
    LOCATED,
    WorldModel,
    condition_holds,
    first_unmet,
    room_left,
)
from keyexpr_schema.goals import Condition
from keyexpr_schema.world import Value

DERIVED_FROM = {LOCATED: {"at"}, HELD: {"at", "holding"}}
"""Relations that a derived one is read off."""
MAX_EXPANSIONS = 30_000
"""States looked at before the search gives up."""

Facts = dict[Variable, Value]


@dataclass(frozen=True)
class Found:
    """A sequence of actions, its cost [s], and the facts it leads to."""

    actions: tuple[Action, ...]
    cost_s: float
    facts: Facts


def ground_actions(
    world: WorldModel, robots: Sequence[str], objects: Sequence[str], goal: Condition
) -> list[Action]:
    """Every action of these robots on these objects that can help with the goal's relations."""
    names = {"robot": robots, "object": objects, "place": tuple(world.places)}
    wanted = DERIVED_FROM.get(goal.relation, {goal.relation})
    relevant: dict[str, None] = {}
    while True:
        more = {
            name: None
            for name, skill in world.skills.items()
            if name not in relevant and wanted & {row[0] for row in skill.after}
        }
        if not more:
            break
        relevant.update(more)
        wanted |= {row[0] for name in more for row in world.skills[name].before}
    found: list[Action] = []
    for name in sorted(relevant):
        skill = world.skills[name]
        for values in product(*(names[kind] for kind in skill.parameters.values())):
            action = skill.ground(dict(zip(skill.parameters, values, strict=True)))
            if len(set(action.participants)) == len(action.participants) and not any(
                world.lacks(action.args[parameter], action, parameter)
                for parameter in skill.robot_parameters
            ):
                found.append(action)
    return found


def cheapest(
    actions: Iterable[Action],
    start: Facts,
    goal: Condition,
    world: WorldModel,
    cost_s: Callable[[Action, Mapping[Variable, Value]], float],
) -> Found | None:
    """The cheapest sequence of `actions` from `start` to a state in which `goal` holds."""
    actions = tuple(actions)
    variables = tuple(
        dict.fromkeys(literal.variable for action in actions for literal in action.after)
    )
    index = {variable: number for number, variable in enumerate(variables)}
    first = tuple(start.get(variable) for variable in variables)
    ticket = count()
    queue: list[tuple[float, int, tuple[Value, ...]]] = [(0.0, next(ticket), first)]
    best: dict[tuple[Value, ...], float] = {first: 0.0}
    came: dict[tuple[Value, ...], tuple[tuple[Value, ...], Action]] = {}
    closed: set[tuple[Value, ...]] = set()
    while queue and len(closed) < MAX_EXPANSIONS:
        spent, _, state = heappop(queue)
        if state in closed:
            continue
        closed.add(state)
        facts = {**start, **dict(zip(variables, state, strict=True))}
        if condition_holds(facts, goal):
            return Found(_path(state, came), spent, facts)
        for action in actions:
            if not applicable(action, facts, world):
                continue
            values = list(state)
            for variable, value in action.after:
                values[index[variable]] = value
            reached = tuple(values)
            total = spent + cost_s(action, facts)
            if total < best.get(reached, float("inf")):
                best[reached] = total
                came[reached] = state, action
                heappush(queue, (total, next(ticket), reached))
    return None


def applicable(action: Action, facts: Mapping[Variable, Value], world: WorldModel) -> bool:
    """Whether the action's preconditions hold in `facts`, room in baskets included."""
    return first_unmet(action, facts, world) is None and all(
        room_left(carrier, facts, world) > 0 for carrier in action.space_in
    )


def _path(
    state: tuple[Value, ...],
    came: Mapping[tuple[Value, ...], tuple[tuple[Value, ...], Action]],
) -> tuple[Action, ...]:
    actions: list[Action] = []
    while state in came:
        state, action = came[state]
        actions.append(action)
    return tuple(reversed(actions))
