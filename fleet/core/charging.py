"""Robots that are to charge: whom the planner has sent, and for which plan they are free then."""

from __future__ import annotations

from collections.abc import Iterator

from fleet.core.model.energy import chargings, percent_at_least, shortfall
from fleet.core.model.parameter_types import OBJECT
from fleet.core.model.preconditions import action_of
from fleet.core.model.skills import Action
from fleet.core.state import State
from keyexpr_schema.facts import AT, CHARGE
from keyexpr_schema.payloads.robots import CHARGE_STEP, FULL
from keyexpr_schema.payloads.tasks import TaskRecord


def charging_goal(state: State, robot: str) -> str | None:
    """The open goal by which a robot charges itself: until it is reached, it does nothing else."""
    for goal in sorted(state.index.goals_about.get(robot, ())):
        spec, status = state.goals.get(goal), state.goal_states[goal]
        wanted = (c for c in status.conditions if c.relation == CHARGE)
        own = spec is not None and spec.by == (robot,)
        if own and any(condition.subjects == (robot,) for condition in wanted):
            return goal
    return None


def is_low(state: State, robot: str) -> bool:
    """Whether a robot's battery is below its reserve."""
    spec, fact = state.robots.get(robot), state.fact(CHARGE, robot)
    if spec is None or spec.battery is None or fact is None:
        return False
    known = isinstance(fact.value, int | float) and not isinstance(fact.value, bool)
    return known and fact.value < spec.battery.reserve_percent  # type: ignore[operator]


def can_charge(state: State, robot: str) -> bool:
    """Whether there is a charger for a robot."""
    return any(True for _ in chargings(state.world(), robot))


def is_worth_charging(state: State, robot: str) -> bool:
    """Whether a robot has more after charging than now, and can be charged."""
    fact = state.fact(CHARGE, robot)
    known = FULL if fact is None else percent_at_least(fact.value)
    return known < percent_at_least(FULL - CHARGE_STEP) and can_charge(state, robot)


def lacks_charge(state: State, plan: str, action: Action) -> str | None:
    """Why a robot's charge is not enough for a task and for the way to a charger after it; nobody
    asks that of one which is on its way to charge."""
    robot = action.actor
    spec, goal = state.robots.get(robot), charging_goal(state, robot)
    if spec is None or spec.battery is None or action.skill.recharges:
        return None
    if goal is not None and plan in state.index.plans_of.get(goal, ()):
        return None
    here = state.fact(AT, robot)
    return shortfall(state.world(), robot, action, None if here is None else here.value)


def charging_at(state: State, chargers: frozenset[str]) -> Iterator[tuple[str, str]]:
    """The tasks under way that charge at any of some chargers."""
    for robot in sorted(state.index.work):
        for plan, task in sorted(state.index.work[robot]):
            if _is_at(state, state.plans[plan].records[task], chargers):
                yield plan, task


def wanting(state: State, chargers: frozenset[str]) -> Iterator[TaskRecord]:
    """The tasks that would charge there now, if somebody let them."""
    for plan in state.index.active:
        entry = state.plans[plan]
        for tasks in entry.index.ready.values():
            for task in tasks:
                if _is_at(state, entry.records[task], chargers):
                    yield entry.records[task]


def charging_turn(state: State, record: TaskRecord) -> tuple[float, str, str]:
    """Who comes first at a charger: the robot with the least charge. Of equals it is the name of
    the plan that decides."""
    fact = None if record.robot is None else state.fact(CHARGE, record.robot)
    return percent_at_least(FULL if fact is None else fact.value), record.plan, record.task


def chargers_of(action: Action) -> frozenset[str]:
    """The things that a task charges at, which only one robot at a time can."""
    types = action.skill.types
    return frozenset(action.args[name] for name, kind in types.items() if kind.bases == (OBJECT,))


def _is_at(state: State, record: TaskRecord, chargers: frozenset[str]) -> bool:
    action = action_of(record, state.skills)
    if action is None or not action.skill.recharges:
        return False
    return not chargers.isdisjoint(chargers_of(action))
