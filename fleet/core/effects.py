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
from keyexpr_schema.payloads.goals import OVER_GOALS, GoalAddress, GoalStatus
from keyexpr_schema.payloads.history import Ended, GoalRecord, PlanRecord, RequestRecord
from keyexpr_schema.payloads.plans import PlanAddress, PlanStatus
from keyexpr_schema.payloads.requests import Answer, RequestAddress
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
class Archive:
    """Keep this, which is over, before anything else is done."""

    record: Ended


@dataclass(frozen=True)
class DropJob:
    """Nobody waits any more for this planning job's answer; it may have been given."""

    job: int


Effect = Publish | Retract | MakePlan | Interpret | DropJob | Archive


def effects_between(old: State, new: State) -> tuple[Effect, ...]:
    """What to do so that keys and planning jobs follow the state from `old` to `new`.

    What is over in `new` is of its view for the last time: the keys keep their last values. It is
    archived, and what was over in `old` is none of this any more.
    """
    return (*_archived(new), *_documents(old, new), *_own_facts(old, new), *_jobs(old, new))


def effects_of(state: State) -> tuple[Effect, ...]:
    """What to do so that keys and planning jobs are as `state` wants them, whatever they are now.

    Facts are left out: other writers may have newer ones.
    """
    empty = State()
    return (*_archived(state), *_documents(empty, state), *_jobs(empty, state))


def documents_of(record: Ended) -> Iterator[Publish]:
    """The last values of the keys of something that is over."""
    match record:
        case RequestRecord():
            yield Publish(ANSWER, RequestAddress(record.answer.request), record.answer)
        case GoalRecord():
            if not record.deleted:
                yield Publish(GOAL_STATUS, GoalAddress(record.spec.goal), record.status)
        case PlanRecord():
            plan = record.spec.plan
            for goal in record.goals:
                if goal.status.state in OVER_GOALS:
                    yield from documents_of(goal)
            if record.spec.tasks:
                yield Publish(PLAN_SPEC, PlanAddress(plan), record.spec)
            yield Publish(PLAN_STATUS, PlanAddress(plan), record.status)
            for task in record.tasks:
                yield Publish(TASK_RECORD, TaskAddress(plan, task.task), task)


def _archived(state: State) -> Iterator[Archive]:
    return (Archive(record) for record in state.over)


def _documents(old: State, new: State) -> Iterator[Effect]:
    over = _Over.of(new)
    views: tuple[
        tuple[Key[Any, Any], Mapping[str, Payload], Mapping[str, Payload], Mapping[str, Payload]],
        ...,
    ] = (
        (GOAL_STATUS, old.goal_states, new.goal_states, over.goals),
        (STATEMENT_STATUS, old.statement_states, new.statement_states, {}),
        (ANSWER, old.answers, new.answers, over.answers),
        (DURATIONS, old.durations, new.durations, {}),
    )
    for key, before, after, gone in views:
        if before is not after or gone:
            yield from _difference(key, key.address, before, _with(after, gone))
    for plan in {**old.plans, **new.plans, **over.plans}:
        if old.plans.get(plan) is not new.plans.get(plan) or old.epoch != new.epoch:
            yield from _plan_documents(plan, old, new, over.plans.get(plan))


def _with(some: Mapping[str, Payload], more: Mapping[str, Payload]) -> Mapping[str, Payload]:
    return {**some, **more} if more else some


@dataclass(frozen=True)
class _Over:
    """What is over in an event, by the names that its documents go by."""

    goals: dict[str, GoalStatus]
    answers: dict[str, Answer]
    plans: dict[str, PlanRecord]

    @classmethod
    def of(cls, state: State) -> _Over:
        plans = {r.spec.plan: r for r in state.over if isinstance(r, PlanRecord)}
        goals = [r for r in state.over if isinstance(r, GoalRecord) and not r.deleted]
        goals += [goal for plan in plans.values() for goal in plan.goals]
        answers = [r.answer for r in state.over if isinstance(r, RequestRecord)]
        return cls(
            {goal.spec.goal: goal.status for goal in goals if goal.status.state in OVER_GOALS},
            {answer.request: answer for answer in answers},
            plans,
        )


def _plan_documents(plan: str, old: State, new: State, over: PlanRecord | None) -> Iterator[Effect]:
    before, after = old.plans.get(plan), new.plans.get(plan)
    spec = after.plan if after else over.spec if over else None
    status = status_of(after) if after else over.status if over else None
    yield from _difference(
        PLAN_SPEC,
        PlanAddress,
        {plan: before.plan} if before and before.plan.tasks else {},
        {plan: spec} if spec and spec.tasks else {},
    )
    yield from _difference(
        PLAN_STATUS,
        PlanAddress,
        {plan: status_of(before)} if before else {},
        {plan: status} if status else {},
    )
    records: Mapping[str, TaskRecord] = {task.task: task for task in over.tasks} if over else {}
    yield from _difference(
        TASK_RECORD,
        partial(TaskAddress, plan),
        before.records if before else {},
        after.records if after else records,
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
        cancelled=entry.cancelling or entry.ended or record.task in entry.unwanted,
        planner=entry.lineage,
        serial=record.serial,
    )


def _own_facts(old: State, new: State) -> Iterator[Effect]:
    if old.concluded is new.concluded:
        return
    for key, fact in new.concluded.items():
        if fact is not old.concluded.get(key):
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
