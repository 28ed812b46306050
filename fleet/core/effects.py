"""What the planner wants done: derived from how the state changed, never ordered by hand.

Every document that the planner writes is a function of its state. So the effects of an event are
the difference between two views, and after a crash the whole view of the replayed state puts right
whatever was lost.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from msgspec.structs import asdict

from fleet.core.plan_entry import OUTSTANDING, PlanEntry
from fleet.core.planning_input import (
    InterpretationInput,
    PlanningInput,
    interpretation_input,
    planning_input,
)
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
from keyexpr_schema.payloads.plans import PlanAddress, PlanStatus
from keyexpr_schema.payloads.tasks import Order, OrderAddress, TaskAddress, TaskRecord
from keyexpr_schema.payloads.world import FactAddress

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

    given: PlanningInput


@dataclass(frozen=True)
class Interpret:
    """Have a goal's sentence read by a language model, and say what it means as an event."""

    given: InterpretationInput


@dataclass(frozen=True)
class DropJob:
    """Nobody waits any more for this planning job's answer; it may have been given."""

    job: int


Effect = Publish | Retract | MakePlan | Interpret | DropJob


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
    views: tuple[tuple[Key[Any, Any], Mapping[str, Payload], Mapping[str, Payload]], ...] = (
        (GOAL_STATUS, old.goal_states, new.goal_states),
        (STATEMENT_STATUS, old.statement_states, new.statement_states),
        (ANSWER, old.answers, new.answers),
        (DURATIONS, old.durations, new.durations),
    )
    for key, before, after in views:
        if before is not after:
            yield from _difference(key, key.address, before, after)
    for plan in {**old.plans, **new.plans}:
        if old.plans.get(plan) is not new.plans.get(plan) or old.epoch != new.epoch:
            yield from _plan_documents(plan, old, new)


def _plan_documents(plan: str, old: State, new: State) -> Iterator[Effect]:
    before, after = old.plans.get(plan), new.plans.get(plan)
    yield from _difference(
        PLAN_SPEC,
        PlanAddress,
        {plan: before.plan} if before and before.plan.tasks else {},
        {plan: after.plan} if after and after.plan.tasks else {},
    )
    yield from _difference(
        PLAN_STATUS,
        PlanAddress,
        {plan: status_of(before)} if before else {},
        {plan: status_of(after)} if after else {},
    )
    yield from _difference(
        TASK_RECORD,
        partial(TaskAddress, plan),
        before.records if before else {},
        after.records if after else {},
    )
    orders = _orders(before, old.epoch), _orders(after, new.epoch)
    yield from _difference(ORDER, lambda address: address, *orders)


def _difference(
    key: Key[Any, Any],
    address: Callable[[Any], Address],
    old: Mapping[Any, Payload],
    new: Mapping[Any, Payload],
) -> Iterator[Effect]:
    for name in old:
        if name not in new:
            yield Retract(key, address(name))
    for name, payload in new.items():
        known = old.get(name)
        # Of a thousand records one has changed: the others are the very same objects.
        if payload is not known and payload != known:
            yield Publish(key, address(name), payload)


def status_of(entry: PlanEntry) -> PlanStatus:
    """What is published of a plan."""
    return PlanStatus(
        plan=entry.plan.plan,
        revision=entry.plan.revision,
        state=entry.state,
        goals=entry.plan.goals,
        made_by=entry.plan.made_by,
        allocator=entry.plan.allocator,
        making=entry.plan.making,
        change=entry.change,
        reason=(entry.replan and entry.replan.sentence) or entry.reason,
        violations=entry.violations,
        time_s=entry.changed_s,
        **asdict(entry.outcome),
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
    for plan, before in old.plans.items():
        after = new.plans.get(plan)
        if before.job is not None and (after is None or after.job != before.job):
            yield DropJob(before.job.job)
    for request, job in old.previews.items():
        if request not in new.previews:
            yield DropJob(job.job)
    for plan, entry in new.plans.items():
        known = old.plans.get(plan)
        if entry.job is not None and (known is None or known.job != entry.job):
            yield MakePlan(planning_input(new, entry.job))
    for request, job in new.previews.items():
        if request not in old.previews:
            yield MakePlan(planning_input(new, job))
    for goal in new.interpreting:
        if goal not in old.interpreting and goal in new.goals:
            yield Interpret(interpretation_input(new, goal))
