"""Robots that are to charge: whom the planner has sent, and for which plan they are free then."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

from fleet.core.model.endurance import shortfall
from fleet.core.model.energy import charging_s, chargings, drive_s, percent_at_least, soonest
from fleet.core.model.parameter_types import OBJECT
from fleet.core.model.preconditions import action_of
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel
from fleet.core.plan_entry import PlanEntry
from fleet.core.state import State
from keyexpr_schema.facts import AT, CHARGE
from keyexpr_schema.payloads.robots import CHARGE_STEP, FULL
from keyexpr_schema.payloads.tasks import TaskRecord

MORE_S = 1.0
"""How much longer a charger that is as good as another counts as taken."""


def charging_goal(state: State, robot: str) -> str | None:
    """The open goal by which a robot charges itself: until it is reached, it does nothing else."""
    for goal in sorted(state.index.goals_about.get(robot, ())):
        spec, status = state.goals.get(goal), state.goal_states[goal]
        wanted = (c for c in status.conditions if c.relation == CHARGE)
        own = spec is not None and spec.by == (robot,)
        if own and any(condition.subjects == (robot,) for condition in wanted):
            return goal
    return None


def is_charging(state: State, goal: str) -> bool:
    """Whether a goal is that of a robot which the planner sends to charge."""
    own, by = state.goal_states[goal].own, state.goals[goal].by
    return own and any(charging_goal(state, robot) == goal for robot in by)


def is_low(state: State, robot: str) -> bool:
    """Whether a robot's battery is below its reserve."""
    spec = state.robots.get(robot)
    if spec is None or spec.battery is None or (fact := state.fact(CHARGE, robot)) is None:
        return False
    known = isinstance(fact.value, int | float) and not isinstance(fact.value, bool)
    return known and fact.value < spec.battery.reserve_percent  # type: ignore[operator]


def can_charge(state: State, robot: str) -> bool:
    """Whether there is a charger for a robot."""
    return bool(chargings(state.world(), robot))


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


def taken_s(state: State, plan: str) -> dict[str, float]:
    """By charger, for how long other robots than those that a plan sends there are at it, or on
    their way to it [s from now]. For those whose plans were begun before and are still being made,
    it is found out where they will go."""
    if all(spec.battery is None for spec in state.robots.values()):
        return {}
    world, found = state.world(), dict[str, float]()
    sent = {robot: goal for robot in state.robots if (goal := charging_goal(state, robot))}
    jobs: list[tuple[float, str]] = []
    for name in state.index.active:
        if name == plan:
            continue
        entry = state.plans[name]
        charges = {robot for robot, goal in sent.items() if goal in entry.plan.goals}
        for action in _about_to_charge(state, entry, at_once=bool(charges)):
            robot = action.actor
            if robot in sent and robot not in charges:
                continue  # it has charged by then
            for charger in chargers_of(action):
                takes_s = action.skill.duration_s + charging_s(world, robot)
                found[charger] = found.get(charger, 0.0) + takes_s
        jobs += [(_job(state, name), robot) for robot in charges if not entry.plan.tasks]
    for job, robot in sorted(jobs):
        taken = {charger: ((0.0, until_s),) for charger, until_s in found.items()}
        turn = soonest(world, robot, world.value(AT, robot), 0.0, taken)
        if job < _job(state, plan) and turn is not None:
            found[turn.charging.charger] = turn.full_s + turn.charging.skill.duration_s
    own = state.plans[plan].plan.goals if plan in state.plans else ()
    for robot in (robot for robot, goal in sent.items() if goal in own):
        _prefer_soonest(found, world, robot)
    return found


def _prefer_soonest(taken: dict[str, float], world: WorldModel, robot: str) -> None:
    """Of chargers that are as good as each other, have the planner take the one that is expected of
    it where others are planned for meanwhile."""
    here = world.value(AT, robot)
    turns = {charger: ((0.0, until_s),) for charger, until_s in taken.items()}
    expected = soonest(world, robot, here, 0.0, turns)
    for each in chargings(world, robot):
        if expected is not None and each.charger != expected.charging.charger:
            way_s = drive_s(world, robot, here, each.place)
            taken[each.charger] = max(taken.get(each.charger, 0.0), way_s) + MORE_S


def _about_to_charge(state: State, entry: PlanEntry, at_once: bool) -> Iterator[Action]:
    """What robots of a plan do at chargers, or will as soon as they are there; with `at_once`, all
    that they will do there."""
    under_way, befores = entry.index.outstanding, entry.index.graph.befores
    for task in (*under_way, *entry.index.open):
        record = entry.records[task]
        skill = state.skills.get(record.skill)
        if skill is None or not skill.recharges or record.robot is None:
            continue
        next_ = at_once or task in under_way
        next_ = next_ or not any(before in entry.index.open for before in befores.get(task, ()))
        if next_ and (action := action_of(record, state.skills)):
            yield action


def _job(state: State, plan: str) -> float:
    """The number of the job by which a plan is made now."""
    entry = state.plans.get(plan)
    return inf if entry is None or entry.job is None else entry.job.job


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
