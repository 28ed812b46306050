"""What the planner wants done: derived from how the state changed, never ordered by hand.

Every document that the planner writes is a function of its state. So the effects of an event are
the difference between two views, and after a crash the whole view of the replayed state puts right
whatever was lost.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from fleet.core.indexes.touches import Part, Touch
from fleet.core.planning_input import (
    InterpretationInput,
    PlanningInput,
    interpretation_input,
    planning_input,
)
from fleet.core.schedule_view import schedule_status
from fleet.core.state import State
from fleet.core.view import TABLES, Over, order_of, plan_document, task_document
from fleet.core.waiting.touched import WaitsTouched
from keyexpr_schema.key import Address, Key, Payload
from keyexpr_schema.keyspace import (
    ANSWER,
    FACT,
    GOAL_STATUS,
    ORDER,
    PLAN_SPEC,
    PLAN_STATUS,
    SCHEDULE_STATUS,
    TASK_RECORD,
)
from keyexpr_schema.payloads.goals import OVER_GOALS, GoalAddress
from keyexpr_schema.payloads.history import Ended, GoalRecord, PlanRecord, RequestRecord
from keyexpr_schema.payloads.plans import PlanAddress
from keyexpr_schema.payloads.requests import RequestAddress
from keyexpr_schema.payloads.schedules import ScheduleAddress
from keyexpr_schema.payloads.tasks import OrderAddress, TaskAddress
from keyexpr_schema.payloads.world import FactAddress

PLANNER_SOURCE = "planner"
"""`source` of facts that the planner concludes itself; statements add a colon and their id."""


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


def effects_between(old: State, new: State, touches: Iterable[Touch]) -> tuple[Effect, ...]:
    """What to do so that keys and planning jobs follow the state from `old` to `new`.

    Only what `touches` name is looked at. What is over in `new` is of its view for the last time:
    the keys keep their last values. It is archived, and what was over in `old` is none of this.
    """
    scope = _Scope.of(old, new, touches)
    return (
        *_archived(new),
        *_documents(old, new, scope),
        *_own_facts(old, new, scope),
        *_jobs(old, new, scope),
    )


def all_touches(old: State, new: State) -> tuple[Touch, ...]:
    """Touches of everything that is in one of two states, or over in the newer one."""
    over = Over.of(new)
    names: tuple[tuple[Part, Iterable[Any]], ...] = (
        *((t.part, (*t.of(old), *t.of(new), *t.over(over))) for t in TABLES),
        (Part.SCHEDULE, (*old.schedules, *new.schedules)),
        (Part.PLAN, (*old.plans, *new.plans, *over.plans)),
        (Part.RECORDS, (*old.plans, *new.plans, *over.plans)),
        (Part.FACT, (*old.concluded, *new.concluded)),
        (Part.PREVIEW, (*old.previews, *new.previews)),
        (Part.INTERPRETING, new.interpreting),
    )
    return tuple(Touch(part, name) for part, found in names for name in dict.fromkeys(found))


def effects_of(state: State) -> tuple[Effect, ...]:
    """What to do so that keys and planning jobs are as `state` wants them, whatever they are now.

    Facts are left out: other writers may have newer ones.
    """
    empty = State()
    scope = _Scope.of(empty, state, all_touches(empty, state))
    return (
        *_archived(state),
        *_documents(empty, state, scope),
        *_jobs(empty, state, scope),
    )


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


@dataclass(frozen=True)
class _Scope:
    """Which parts of two states to compare."""

    names: Mapping[Part, tuple[Any, ...]]
    tasks: Mapping[str, tuple[str, ...]]
    """Tasks by plan, where not all of a plan's are compared."""
    plans: tuple[str, ...]

    @classmethod
    def of(cls, old: State, new: State, touches: Iterable[Touch]) -> _Scope:
        touches = tuple(touches)
        names: dict[Part, dict[Any, None]] = {}
        tasks: dict[str, dict[str, None]] = {}
        plans: dict[str, None] = {}
        for part, name, task in touches:
            names.setdefault(part, {})[name] = None
            if part is Part.RECORD:
                tasks.setdefault(name, {})[task] = None
            if part in (Part.PLAN, Part.RECORD, Part.RECORDS):
                plans[name] = None
        if Part.EPOCH in names:  # orders carry it
            plans |= dict.fromkeys(new.plans)
        waits = WaitsTouched.of(old, new, touches)
        names.setdefault(Part.GOAL, {}).update(waits.goals)
        for plan, waiting in waits.tasks.items():
            tasks.setdefault(plan, {}).update(waiting)
            plans[plan] = None
        return cls(
            {part: tuple(found) for part, found in names.items()},
            {plan: tuple(found) for plan, found in tasks.items()},
            tuple(plans),
        )

    def has(self, part: Part, name: str) -> bool:
        """Whether a part of this name is to be compared."""
        return name in self.names.get(part, ())


def _documents(old: State, new: State, scope: _Scope) -> Iterator[Effect]:
    over = Over.of(new)
    for table in TABLES:
        before, after, gone = table.of(old), table.of(new), table.over(over)
        for name in scope.names.get(table.part, ()):
            now = after.get(name) or gone.get(name)
            yield from _difference(table.key, table.key.address(name), before.get(name), now)
    of_goals, own = (scope.names.get(part, ()) for part in (Part.GOAL, Part.SCHEDULE))
    for name in dict.fromkeys([*of_goals, *own]):
        was, now = schedule_status(old, name), schedule_status(new, name)
        yield from _difference(SCHEDULE_STATUS, ScheduleAddress(name), was, now)
    for plan in scope.plans:
        yield from _plan_documents(plan, old, new, over.plans.get(plan), scope)


def _plan_documents(
    plan: str, old: State, new: State, over: PlanRecord | None, scope: _Scope
) -> Iterator[Effect]:
    before, after = old.plans.get(plan), new.plans.get(plan)
    if scope.has(Part.PLAN, plan):
        spec = after.plan if after else over.spec if over else None
        status = over.status if over and not after else plan_document(new, plan)
        address = PlanAddress(plan)
        known = before.plan if before and before.plan.tasks else None
        yield from _difference(PLAN_SPEC, address, known, spec if spec and spec.tasks else None)
        yield from _difference(PLAN_STATUS, address, plan_document(old, plan), status)
    past = {task.task: task for task in over.tasks} if over else {}
    tasks: Iterable[str] = scope.tasks.get(plan, ())
    if scope.has(Part.RECORDS, plan):
        records = (entry.records for entry in (before, after) if entry)
        tasks = dict.fromkeys([*(task for each in records for task in each), *past])
    for task in tasks:
        was, now = task_document(old, plan, task), task_document(new, plan, task)
        yield from _difference(TASK_RECORD, TaskAddress(plan, task), was, now or past.get(task))
    if scope.has(Part.PLAN, plan) or Part.EPOCH in scope.names:
        outstanding = [entry.index.outstanding for entry in (before, after) if entry]
        tasks = dict.fromkeys(task for tasks in outstanding for task in tasks)
    for task in tasks:
        first = order_of(before, task, old.epoch, old.policy.lease_s)
        then = order_of(after, task, new.epoch, new.policy.lease_s)
        if first and (not then or then.robot != first.robot):
            yield Retract(ORDER, OrderAddress.of(first))
            first = None
        if then:
            yield from _difference(ORDER, OrderAddress.of(then), first, then)


def _difference(
    key: Key[Any, Any], address: Address, old: Payload | None, new: Payload | None
) -> Iterator[Effect]:
    if new is None:
        if old is not None:
            yield Retract(key, address)
    elif new is not old and new != old:
        yield Publish(key, address, new)


def _own_facts(old: State, new: State, scope: _Scope) -> Iterator[Effect]:
    for key in scope.names.get(Part.FACT, ()):
        fact = new.concluded.get(key)
        if fact is not None and fact is not old.concluded.get(key):
            yield Publish(FACT, FactAddress.of(key), fact)


def _jobs(old: State, new: State, scope: _Scope) -> Iterator[Effect]:
    jobs = [
        (old.plans[plan].job if plan in old.plans else None,
         new.plans[plan].job if plan in new.plans else None)
        for plan in scope.names.get(Part.PLAN, ())
    ]  # fmt: skip
    jobs += [
        (old.previews.get(request), new.previews.get(request))
        for request in scope.names.get(Part.PREVIEW, ())
    ]
    for before, after in jobs:
        if before is not None and before != after:
            yield DropJob(before.job)
    for before, after in jobs:
        if after is not None and before != after:
            yield MakePlan(planning_input(new, after))
    for goal in scope.names.get(Part.INTERPRETING, ()):
        if goal not in new.interpreting or goal not in new.goals:
            continue
        known = old.goals.get(goal) if goal in old.interpreting else None
        if known is None or known.text != new.goals[goal].text:
            yield Interpret(interpretation_input(new, goal))
