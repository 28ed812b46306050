"""What an earlier planner has left, as one finds it that has no journal of it."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from fleet.core.effects import all_touches
from fleet.core.handlers.requests import plan_number
from fleet.core.plan_entry import PlanEntry
from fleet.core.state import State
from fleet.core.state_updates import (
    set_entry,
    touch,
)
from fleet.core.table import Table
from keyexpr_schema.payloads.goals import ENDED_GOALS, GoalState
from keyexpr_schema.payloads.plans import Plan, PlanState
from keyexpr_schema.payloads.tasks import Order, TaskRecord, TaskState


def prior_state_loaded(state: State, event: events.PriorStateLoaded) -> State:
    """Take over what an earlier planner left, so that nothing is done a second time."""
    answers = {answer.request: answer for answer in event.answers}
    goals = {status.goal: status for status in event.goals if status.state in ENDED_GOALS}
    goals |= {
        status.goal: replace(status, parts=())
        for status in event.goals
        if status.state is GoalState.STANDING
    }
    plans = dict.fromkeys([*event.plans, *(order.plan for order in event.orders)])
    state = replace(
        state,
        answers=Table({**answers, **state.answers}),
        durations={**{known.model: known for known in event.durations}, **state.durations},
        goal_states=Table({**goals, **state.goal_states}),
        statement_states=Table(
            {**{status.statement: status for status in event.statements}, **state.statement_states}
        ),
        past_plans=(*state.past_plans, *(p for p in plans if p not in state.plans)),
        plans_made=max([state.plans_made, *map(plan_number, plans)]),
    ).reindexed()
    for plan in dict.fromkeys(order.plan for order in event.orders):
        if plan not in state.plans:
            orders = [order for order in event.orders if order.plan == plan]
            state = set_entry(state, _without_its_planner(orders))
    for touched in all_touches(State(), state):
        state = touch(state, touched)
    return state


def _without_its_planner(orders: list[Order]) -> PlanEntry:
    """A plan that nobody follows up any more. Its orders may be carried out all the same: they are
    cancelled, and what they handle is reserved until their workers have spoken."""
    latest = max(orders, key=lambda order: (order.epoch, order.serial))
    records = {
        order.task: TaskRecord(
            plan=order.plan,
            revision=order.revision,
            task=order.task,
            skill=order.skill,
            args=order.args,
            actor=order.robot,
            robot=order.robot,
            state=TaskState.ORDERED,
            attempt=order.attempt,
            serial=order.serial,
        )
        for order in orders
        if order.planner == latest.planner
    }
    return PlanEntry(
        plan=Plan(plan=latest.plan, revision=latest.revision, goals=(), conditions=(), tasks=()),
        state=PlanState.CANCELLED,
        lineage=latest.planner,
        records=Table(records),
        unwanted=tuple(records),
        reason="its planner has lost its journal",
    )
