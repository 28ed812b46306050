"""What the planner publishes, as a function of its state: documents by key, and orders.

What is over in a state is of its view for the last time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from msgspec.structs import asdict, replace

from fleet.core.indexes.plan_index import OUTSTANDING
from fleet.core.indexes.touches import Part
from fleet.core.plan_entry import SAYS_WHY_SINCE_LOGIC, PlanEntry
from fleet.core.state import State
from fleet.core.waiting.reasons import waits_of_goal, waits_of_plan, waits_of_task
from keyexpr_schema.key import Key, Payload
from keyexpr_schema.keyspace import (
    ANSWER,
    DURATIONS,
    GOAL_STATUS,
    STATEMENT_STATUS,
)
from keyexpr_schema.payloads.goals import OVER_GOALS, GoalStatus
from keyexpr_schema.payloads.history import GoalRecord, PlanRecord, RequestRecord
from keyexpr_schema.payloads.plans import PlanStatus
from keyexpr_schema.payloads.requests import Answer
from keyexpr_schema.payloads.tasks import Order, TaskRecord

DEADLINE_FACTOR = 6.0
DEADLINE_MARGIN_S = 180.0
"""An attempt may take this many times its predicted duration, and this long [s] besides: enough for
three tries and for waiting at doors, little enough that a stuck robot is noticed."""


@dataclass(frozen=True)
class Over:
    """What is over in an event, by the names that its documents go by."""

    goals: dict[str, GoalStatus]
    answers: dict[str, Answer]
    plans: dict[str, PlanRecord]

    @classmethod
    def of(cls, state: State) -> Over:
        """What is over in a state."""
        plans = {r.spec.plan: r for r in state.over if isinstance(r, PlanRecord)}
        goals = [r for r in state.over if isinstance(r, GoalRecord) and not r.deleted]
        goals += [goal for plan in plans.values() for goal in plan.goals]
        answers = [r.answer for r in state.over if isinstance(r, RequestRecord)]
        return cls(
            {goal.spec.goal: goal.status for goal in goals if goal.status.state in OVER_GOALS},
            {answer.request: answer for answer in answers},
            plans,
        )


@dataclass(frozen=True)
class DocumentTable:
    """Documents that the state has by name, each on a key of its own."""

    part: Part
    key: Key[Any, Any]
    of: Callable[[State], Mapping[str, Payload]]
    over: Callable[[Over], Mapping[str, Payload]] = lambda over: {}


class GoalDocuments(Mapping[str, GoalStatus]):
    """What is published of goals: how each stands, with what it waits for."""

    def __init__(self, state: State) -> None:
        self._state = state

    def __getitem__(self, goal: str) -> GoalStatus:
        status = self._state.goal_states[goal]
        waits = waits_of_goal(self._state, status)
        return status if waits == status.waits_for else replace(status, waits_for=waits)

    def __iter__(self) -> Iterator[str]:
        return iter(self._state.goal_states)

    def __len__(self) -> int:
        return len(self._state.goal_states)


TABLES = (
    DocumentTable(Part.GOAL, GOAL_STATUS, GoalDocuments, lambda over: over.goals),
    DocumentTable(Part.STATEMENT, STATEMENT_STATUS, lambda state: state.statement_states),
    DocumentTable(Part.ANSWER, ANSWER, lambda state: state.answers, lambda over: over.answers),
    DocumentTable(Part.DURATIONS, DURATIONS, lambda state: state.durations),
)
"""All but plans, whose documents are many."""


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
        wall_time_s=entry.changed_wall_s,
        approved_by=entry.approved_by,
        **asdict(entry.outcome),
    )


def plan_document(state: State, plan: str) -> PlanStatus | None:
    """What is published of a plan, with what holds it up as a whole."""
    entry = state.plans.get(plan)
    if entry is None:
        return None
    status = replace(status_of(entry), waits_for=waits_of_plan(state, entry))
    if entry.cancelling and state.logic >= SAYS_WHY_SINCE_LOGIC:
        return replace(status, reason=entry.reason or status.reason)  # whatever fails meanwhile
    return status


def task_document(state: State, plan: str, task: str) -> TaskRecord | None:
    """What is published of a task: its record, with what it waits for."""
    entry = state.plans.get(plan)
    record = entry.records.get(task) if entry is not None else None
    if entry is None or record is None:
        return None
    waits = waits_of_task(state, entry, record)
    return record if waits == record.waits_for else replace(record, waits_for=waits)


def order_of(entry: PlanEntry | None, task: str, epoch: int, lease_s: float = 0.0) -> Order | None:
    """The order of a task, while a robot has one."""
    record = entry.records.get(task) if entry is not None else None
    if entry is None or record is None or record.state not in OUTSTANDING or record.robot is None:
        return None
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
        cancelled=entry.cancelling
        or entry.ended
        or record.task in entry.unwanted
        or record.task in entry.halting,
        planner=entry.lineage,
        serial=record.serial,
        program=record.program,
        lease_s=lease_s,
    )
