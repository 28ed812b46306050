"""What the planner wants done: derived from how the state changed, never ordered by hand.

Every document that the planner writes is a function of its state. So the effects of an event are
the difference between two views, and after a crash the whole view of the replayed state puts right
whatever was lost.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from fleet.core.plan_entry import OUTSTANDING, PlanEntry, PlanningJob
from fleet.core.state import State
from keyexpr_schema.key import Address, Key, Payload
from keyexpr_schema.keyspace import (
    ANSWER,
    DURATIONS,
    FACT,
    GOAL_STATUS,
    ORDER,
    PLAN_SPEC,
    PLAN_STATUS,
    STATEMENT_STATUS,
    TASK_RECORD,
)
from keyexpr_schema.payloads.durations import DurationsAddress
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.payloads.plans import PlanAddress, PlanStatus
from keyexpr_schema.payloads.requests import RequestAddress
from keyexpr_schema.payloads.tasks import Order, OrderAddress, TaskAddress, TaskRecord
from keyexpr_schema.payloads.world import FactAddress, StatementAddress

PLANNER_SOURCE = "planner"
"""`source` of facts that the planner concludes itself; statements add a colon and their id."""

DEADLINE_FACTOR = 6.0
DEADLINE_MARGIN_S = 180.0
"""An attempt may take this many times its predicted duration, and this long [s] besides: enough for
three tries and for waiting at doors, little enough that a stuck robot is noticed."""


@dataclass(frozen=True)
class Publish:
    """Make the value at a key this one, for good."""

    key: Key[Any, Any]
    address: Address
    payload: Payload


@dataclass(frozen=True)
class Retract:
    """Delete the value at a key, for good."""

    key: Key[Any, Any]
    address: Address


@dataclass(frozen=True)
class MakePlan:
    """Do this planning job, and say how it ended as an event."""

    job: PlanningJob


@dataclass(frozen=True)
class Interpret:
    """Have a goal's sentence read by a language model, and say what it means as an event."""

    goal: str
    text: str


Effect = Publish | Retract | MakePlan | Interpret


def effects_between(old: State, new: State) -> tuple[Effect, ...]:
    """What to do so that keys and planning jobs follow the state from `old` to `new`."""
    return (*_documents(old, new), *_own_facts(old, new), *_jobs(old, new))


def effects_of(state: State) -> tuple[Effect, ...]:
    """What to do so that keys and planning jobs are as `state` wants them, whatever they are now.

    Facts are left out: other writers may have newer ones.
    """
    empty = State()
    return (*_documents(empty, state), *_jobs(empty, state))


def _documents(old: State, new: State) -> Iterator[Effect]:
    if old.goal_states is not new.goal_states:
        yield from _difference(
            GOAL_STATUS,
            {GoalAddress(goal): status for goal, status in old.goal_states.items()},
            {GoalAddress(goal): status for goal, status in new.goal_states.items()},
        )
    if old.statement_states is not new.statement_states:
        yield from _difference(
            STATEMENT_STATUS,
            {StatementAddress(name): status for name, status in old.statement_states.items()},
            {StatementAddress(name): status for name, status in new.statement_states.items()},
        )
    if old.answers is not new.answers:
        yield from _difference(
            ANSWER,
            {RequestAddress(name): answer for name, answer in old.answers.items()},
            {RequestAddress(name): answer for name, answer in new.answers.items()},
        )
    if old.durations is not new.durations:
        yield from _difference(
            DURATIONS,
            {DurationsAddress(model): known for model, known in old.durations.items()},
            {DurationsAddress(model): known for model, known in new.durations.items()},
        )
    for plan in {**old.plans, **new.plans}:
        before, after = old.plans.get(plan), new.plans.get(plan)
        if before is after and old.epoch == new.epoch:
            continue
        yield from _plan_documents(plan, before, after, old.epoch, new.epoch)


def _plan_documents(
    plan: str, before: PlanEntry | None, after: PlanEntry | None, old_epoch: int, epoch: int
) -> Iterator[Effect]:
    address = PlanAddress(plan)
    yield from _difference(
        PLAN_SPEC,
        {address: before.plan} if before and before.plan.tasks else {},
        {address: after.plan} if after and after.plan.tasks else {},
    )
    yield from _difference(
        PLAN_STATUS,
        {address: status_of(before)} if before else {},
        {address: status_of(after)} if after else {},
    )
    old_records = before.records if before else {}
    new_records = after.records if after else {}
    # Of a thousand records one has changed: the others are the very same objects.
    touched = [
        task
        for task in {**old_records, **new_records}
        if old_records.get(task) is not new_records.get(task)
    ]
    yield from _difference(
        TASK_RECORD,
        {TaskAddress(plan, task): old_records[task] for task in touched if task in old_records},
        {TaskAddress(plan, task): new_records[task] for task in touched if task in new_records},
    )
    yield from _difference(ORDER, _orders(before, old_epoch), _orders(after, epoch))


def _difference(
    key: Key[Any, Any], old: Mapping[Any, Payload], new: Mapping[Any, Payload]
) -> Iterator[Effect]:
    for address in old:
        if address not in new:
            yield Retract(key, address)
    for address, payload in new.items():
        if old.get(address) != payload:
            yield Publish(key, address, payload)


def status_of(entry: PlanEntry) -> PlanStatus:
    """What is published of a plan."""
    outcome = entry.outcome
    return PlanStatus(
        plan=entry.plan.plan,
        revision=entry.plan.revision,
        state=entry.state,
        goals=entry.plan.goals,
        allocation=outcome.allocation,
        sequence=outcome.sequence,
        made_by=entry.plan.made_by,
        allocator=entry.plan.allocator,
        predicted_makespan_s=outcome.makespan_s,
        lower_bound_s=outcome.lower_bound_s,
        notes=outcome.notes,
        planning_time_s=outcome.planning_time_s,
        making=entry.plan.making,
        change=entry.change,
        reason=(entry.replan and entry.replan.sentence) or entry.reason,
        violations=entry.violations,
        time_s=entry.changed_s,
    )


def _orders(entry: PlanEntry | None, epoch: int) -> dict[OrderAddress, Order]:
    if entry is None:
        return {}
    return {
        OrderAddress(record.robot, record.plan, record.task): _order(record, entry, epoch)
        for record in entry.records.values()
        if record.state in OUTSTANDING and record.robot is not None
    }


def _order(record: TaskRecord, entry: PlanEntry, epoch: int) -> Order:
    assert record.robot is not None
    return Order(
        robot=record.robot,
        plan=record.plan,
        revision=record.revision,
        task=record.task,
        attempt=record.attempt,
        epoch=epoch,
        skill=record.skill,
        args=record.args,
        deadline_s=DEADLINE_FACTOR * record.duration_s + DEADLINE_MARGIN_S,
        cancelled=entry.cancelling or record.task in entry.unwanted,
    )


def _own_facts(old: State, new: State) -> Iterator[Effect]:
    if old.facts is new.facts:
        return
    for key, fact in new.facts.items():
        if fact is not old.facts.get(key) and fact.source.startswith(PLANNER_SOURCE):
            yield Publish(FACT, FactAddress.of(key), fact)


def _jobs(old: State, new: State) -> Iterator[Effect]:
    for plan, entry in new.plans.items():
        before = old.plans.get(plan)
        if entry.job is not None and (before is None or before.job != entry.job):
            yield MakePlan(entry.job)
    for request, job in new.previews.items():
        if request not in old.previews:
            yield MakePlan(job)
    for goal in new.interpreting:
        if goal not in old.interpreting and goal in new.goals:
            yield Interpret(goal, new.goals[goal].text)
