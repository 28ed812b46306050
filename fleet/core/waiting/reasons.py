"""What is waited for: a pure function of the state, and the one place where a reason is made.

A task is ordered when nothing is yielded here, so that one which is not ordered always says why.
What else comes to hold tasks back is yielded by `holding_back`, too; where it can change while the
plan does not, `fleet.core.waiting.touched` has to know whom that concerns.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from fleet.core.charging import chargers_of, charging_at, charging_turn, wanting
from fleet.core.dispatch.while_replanning import stands_still, waits_for_new_plan
from fleet.core.holds import plan_paused
from fleet.core.indexes.fact_views import FactValues
from fleet.core.indexes.plan_index import OUTSTANDING, robots_of
from fleet.core.model.derived import carriers
from fleet.core.model.preconditions import action_of, variables_of
from fleet.core.model.skills import Action
from fleet.core.own_waiting import AT_ONCE
from fleet.core.plan_entry import PlanEntry
from fleet.core.state import State
from fleet.core.waiting.robots import held_up, not_free
from keyexpr_schema.payloads.goals import GoalState, GoalStatus
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState
from keyexpr_schema.payloads.waits import WaitKind, WaitReason

LISTED = 8
"""So many tasks that one waits for are named, of more the last ones: those which end first
change nothing then."""


def waits_of_task(state: State, entry: PlanEntry, record: TaskRecord) -> tuple[WaitReason, ...]:
    """What a task waits for, also one that a robot has an order for and does not work on."""
    if record.state in OUTSTANDING:
        robots = (name for name in sorted(robots_of(record)) if _is_robot(state, name))
        return tuple(reason for robot in robots for reason in held_up(state, robot))
    if record.state is not TaskState.WAITING or record.task not in entry.index.open:
        return ()
    if entry.index.open[record.task]:
        unmet = (
            before
            for before in reversed(entry.index.graph.befores[record.task])
            if entry.records[before].state is not TaskState.SUCCEEDED
        )
        last = reversed(list(islice(unmet, LISTED)))
        plan = record.plan
        return tuple(WaitReason(kind=WaitKind.TASK, plan=plan, task=task) for task in last)
    action = action_of(record, state.skills)
    if action is None:
        return ()
    found = (
        *waits_of_plan(state, entry),
        *_closed_ways(state, record, action),
        *holding_back(state, entry, record, action),
    )
    return tuple(dict.fromkeys(found))


def holding_back(
    state: State, entry: PlanEntry, record: TaskRecord, action: Action, reservations: bool = True
) -> Iterator[WaitReason]:
    """What else holds back a task whose predecessors are done, in a plan that goes on.

    See `fleet.core.waiting.robots.not_free` for `reservations`.
    """
    if waits_for_new_plan(state, entry, record, action):
        yield _no_robot(entry) if _waits_for_team(entry) else _revision(entry)
    for robot in action.participants:
        yield from not_free(state, robot, record.plan, reservations)
    yield from _unwanted_work(state, action)
    yield from _at_charger(state, record, action)


def waits_of_plan(state: State, entry: PlanEntry) -> tuple[WaitReason, ...]:
    """What holds up a plan as a whole."""
    return tuple(_holding_plan(state, entry))


def _holding_plan(state: State, entry: PlanEntry) -> Iterator[WaitReason]:
    plan = entry.plan.plan
    if entry.ended:
        return
    if entry.cancelling:
        yield WaitReason(kind=WaitKind.CANCELLING, plan=plan)
        return
    if entry.state is PlanState.PLANNING:
        yield _revision(entry)
    elif entry.state is PlanState.PROPOSED:
        yield WaitReason(kind=WaitKind.APPROVAL, plan=plan)
    elif entry.state is PlanState.READY:
        yield WaitReason(kind=WaitKind.START, plan=plan)
    elif stands_still(state, entry):
        yield _revision(entry)
    if (hold := plan_paused(state, plan)) is not None:
        why = hold.reason or None
        yield WaitReason(kind=WaitKind.PAUSED, plan=plan, hold=hold.hold, sentence=why)
    if _waits_for_team(entry):
        yield _no_robot(entry)


def _waits_for_team(entry: PlanEntry) -> bool:
    return entry.job is None and entry.waits_for_team is not None


def _no_robot(entry: PlanEntry) -> WaitReason:
    return WaitReason(kind=WaitKind.NO_ROBOT, plan=entry.plan.plan, sentence=entry.reason)


def _closed_ways(state: State, record: TaskRecord, action: Action) -> Iterator[WaitReason]:
    """Closures that a robot does not get through. They hold nothing back by themselves: the plan
    is made again, and waits if there is no other way."""
    robot, target = record.robot, action.skill.travel_to
    if not state.closures or robot is None or robot not in state.robots or target is None:
        return
    for closure in state.world().kept_by(robot, action.args[target]):
        yield WaitReason(
            kind=WaitKind.CLOSED, closure=closure.closure, robot=robot, sentence=str(closure)
        )


def _revision(entry: PlanEntry) -> WaitReason:
    """That a plan is made, and why it is made again."""
    taken_up = entry.job.reason if entry.job is not None else None
    why = taken_up or entry.replan
    number = entry.plan.revision
    if entry.state is not PlanState.PLANNING:
        number += 1
    return WaitReason(
        kind=WaitKind.REVISION,
        plan=entry.plan.plan,
        revision=number,
        sentence=None if why is None else why.sentence,
    )


def _at_charger(state: State, record: TaskRecord, action: Action) -> Iterator[WaitReason]:
    """Robots that charge where a task wants to, and those that are to be there before it."""
    if not action.skill.recharges:
        return
    at = chargers_of(action)
    for plan, task in charging_at(state, at):
        if (plan, task) != (record.plan, record.task):
            robot = state.plans[plan].records[task].robot
            yield WaitReason(kind=WaitKind.CHARGING, robot=robot, plan=plan, task=task)
            return
    mine = charging_turn(state, record)
    for other in wanting(state, at):
        entry = state.plans[other.plan]
        if charging_turn(state, other) < mine and _may_go(state, entry, other):
            robot, plan, task = other.robot, other.plan, other.task
            yield WaitReason(kind=WaitKind.CHARGING, robot=robot, plan=plan, task=task)


def _may_go(state: State, entry: PlanEntry, record: TaskRecord) -> bool:
    """Whether a task that wants to a charger waits for nothing but that."""
    action = action_of(record, state.skills)
    if action is None or waits_of_plan(state, entry):
        return False
    robots = (r for name in action.participants for r in not_free(state, name, record.plan))
    return not any(robots) and not waits_for_new_plan(state, entry, record, action)


def _unwanted_work(state: State, action: Action) -> Iterator[WaitReason]:
    """Tasks that are being cancelled, and have not confirmed it, and are about the same facts.

    That of a robot that is lost, or of a plan that is over, may be carried out as well.
    """
    if not state.index.dropping:
        return
    world = state.world()
    for plan in sorted(state.index.dropping):
        entry = state.plans[plan]
        for task in entry.unwanted:
            if task not in entry.index.outstanding:
                continue
            record = entry.records[task]
            other = action_of(record, state.skills)
            if other is None or variables_of(action, world) & variables_of(other, world):
                gone = record.robot is None or not state.connected.get(record.robot)
                kind = WaitKind.LOST if gone else WaitKind.CANCELLING
                yield WaitReason(kind=kind, robot=record.robot, plan=plan, task=task)


def _is_robot(state: State, name: str) -> bool:
    return name in state.robots or name in state.gone_since


def waits_of_goal(state: State, status: GoalStatus) -> tuple[WaitReason, ...]:
    """What a goal waits for; of one that is pending, as it was when that was last looked at."""
    goal = status.goal
    match status.state:
        case GoalState.READING:
            return (WaitReason(kind=WaitKind.READING, goal=goal),)
        case GoalState.REJECTED if status.candidates:
            asked = status.paraphrase is not None
            kind = WaitKind.CONFIRMATION if asked else WaitKind.QUESTION
            return (WaitReason(kind=kind, goal=goal, sentence=status.reason),)
        case GoalState.PENDING:
            return (*status.waits_for, *_who_wants_that(state, status))
        case GoalState.STANDING if status.parts:
            parts = status.parts[:LISTED]
            return tuple(WaitReason(kind=WaitKind.GOAL, goal=part) for part in parts)
        case GoalState.STANDING if status.paused:
            return (WaitReason(kind=WaitKind.PAUSED, goal=goal),)
        case GoalState.STANDING if status.next_s is not None:
            return (WaitReason(kind=WaitKind.DUE, due_s=status.next_s),)
        case GoalState.WAITING | GoalState.PLANNED:
            if plans := state.index.plans_of.get(goal):
                return (WaitReason(kind=WaitKind.PLAN, plan=plans[0]),)
            return (*_closed_to_all(state, status), _unplanned(state, status))
    return ()


def _who_wants_that(state: State, status: GoalStatus) -> Iterator[WaitReason]:
    """Goals that want what a goal waits for: it waits for these, and perhaps they for it."""
    spec, about = state.goals.get(status.goal), state.index.goals_about
    if spec is None or not any(each.kind is WaitKind.CONDITION for each in status.waits_for):
        return
    others = {goal for row in spec.when for name in row.subjects for goal in about.get(name, ())}
    for goal in sorted(others - {status.goal}):
        other = state.goal_states[goal]
        if any(row in stage for row in spec.when for stage in (other.conditions, *other.stages)):
            yield WaitReason(kind=WaitKind.GOAL, goal=goal)


def _unplanned(state: State, status: GoalStatus) -> WaitReason:
    """Why no plan works on a goal. One that is planned by itself waits for what is being planned;
    for others somebody has to ask."""
    number = state.waiting_for_robots.get(status.goal)
    if number is not None and number != AT_ONCE:
        return WaitReason(kind=WaitKind.NO_ROBOT, sentence=status.reason)
    if number == AT_ONCE and (made := planning(state)):
        return WaitReason(kind=WaitKind.PLAN, plan=made[0])
    return WaitReason(kind=WaitKind.NO_PLAN, sentence=status.reason)


def planning(state: State) -> list[str]:
    """The plans that are being made for the first time."""
    active = state.index.active
    return sorted(plan for plan in active if state.plans[plan].state is PlanState.PLANNING)


def _closed_to_all(state: State, status: GoalStatus) -> Iterator[WaitReason]:
    """Closures that keep every robot which is there from a place that a goal is about."""
    team = sorted(state.index.team)
    if not state.closures or not team:
        return
    world, value_of = state.world(), FactValues(state.facts).get
    names = dict.fromkeys(
        name
        for row in status.conditions
        for subject in row.subjects
        for name in (str(row.value), *carriers(subject, value_of, state, aboard=True))
    )
    found: dict[str, WaitReason] = {}
    for place in (name for name in names if name in state.places):
        kept = [world.kept_by(robot, place) for robot in team]
        for closure in kept[0] if all(kept) else ():
            found[closure.closure] = WaitReason(
                kind=WaitKind.CLOSED, closure=closure.closure, sentence=str(closure)
            )
    yield from found.values()
