"""What the chaos run takes for a violation: from the store's journal, and from what is stored."""

from __future__ import annotations

import random
from collections.abc import Iterable

import pytest

from benchmarks.chaos.agreement import contradictions
from benchmarks.chaos.journal import Cancelled, done_twice, reports_in
from benchmarks.chaos.plans import KINDS, drawn, found, one_after_another
from keyexpr_schema.key import Address, Key, Payload
from keyexpr_schema.keyspace import (
    ANSWER,
    CONTROL_REQUEST,
    GOAL_SPEC,
    GOAL_STATUS,
    ORDER,
    PLAN_SPEC,
    PLAN_STATUS,
    REPORT,
)
from keyexpr_schema.payloads.goals import Goal, GoalAddress
from keyexpr_schema.payloads.plans import Plan, PlanAddress, PlanState, PlanStatus, Task
from keyexpr_schema.payloads.requests import Answer, Control, ControlRequest, RequestAddress
from keyexpr_schema.payloads.system import JournalEntry
from keyexpr_schema.payloads.tasks import (
    Order,
    OrderAddress,
    Report,
    ReportAddress,
    ReportState,
    TaskRecord,
    TaskState,
)

Said = tuple[Key, Address, Payload | None]  # type: ignore[type-arg]
GOAL, ROBOT = GoalAddress("g"), "hsr"
PLANNED = Plan(
    plan="p", goals=("g",), conditions=(),
    tasks=tuple(Task(task=t, skill="pick", args={}, actor="a1", goal="g") for t in ("t1", "t2")),
)  # fmt: skip
WANTED: tuple[Said, ...] = (
    (GOAL_SPEC, GOAL, Goal(goal="g", text="Bring the cup.")),
    (PLAN_SPEC, PlanAddress("p"), PLANNED),
)
TAKEN_BACK: tuple[Said, ...] = ((GOAL_SPEC, GOAL, None), (GOAL_STATUS, GOAL, None))
CANCELLING: tuple[Said, ...] = (
    (
        CONTROL_REQUEST,
        RequestAddress("r"),
        ControlRequest(request="r", control=Control.CANCEL, plan="p"),
    ),
    (ANSWER, RequestAddress("r"), Answer(request="r", accepted=True, sentence="it is", plan="p")),
)


def order(task: str, attempt: int = 1, *, cancelled: bool = False) -> Said:
    told = Order(
        robot=ROBOT, plan="p", revision=1, task=task, attempt=attempt, epoch=1, skill="pick",
        args={}, deadline_s=9.0, cancelled=cancelled,
    )  # fmt: skip
    return ORDER, OrderAddress.of(told), told


def report(state: ReportState, started_s: float, task: str = "t1", attempt: int = 1) -> Said:
    told = Report(
        robot=ROBOT, plan="p", revision=1, task=task, attempt=attempt, epoch=1, incarnation="i",
        state=state, started_s=started_s,
    )  # fmt: skip
    return REPORT, ReportAddress.of(told), told


def cancelled_at(time_s: float) -> Said:
    status = PlanStatus(
        plan="p", revision=1, state=PlanState.CANCELLED, goals=("g",), made_by="symbolic",
        allocator="makespan", time_s=time_s,
    )  # fmt: skip
    return PLAN_STATUS, PlanAddress("p"), status


def journal(*said: Said) -> list[JournalEntry]:
    return [
        JournalEntry(
            number=number, wall_time_s=0.0, keyexpr=key.build(address), deleted=value is None,
            timestamp="", value=None if value is None else key.encode(value).decode(),
        )
        for number, (key, address, value) in enumerate(said, 1)
    ]  # fmt: skip


def wrong(*said: Said) -> list[str]:
    return Cancelled.of(journal(*WANTED, *said)).wrong


def test_what_is_ordered_for_a_goal_that_was_taken_back_is_wrong() -> None:
    assert wrong(order("t1"), *TAKEN_BACK, order("t1", cancelled=True)) == []
    assert wrong(order("t1"), *TAKEN_BACK, order("t1")) == []  # by another run of the planner
    assert len(wrong(*TAKEN_BACK, order("t1"))) == 1
    assert len(wrong(order("t1"), *TAKEN_BACK, order("t1", attempt=2))) == 1
    again = (GOAL_SPEC, GOAL, Goal(goal="g", text="Bring the cup."))
    assert wrong(*TAKEN_BACK, again, order("t1")) == []


def test_what_is_ordered_or_begun_of_a_cancelled_plan_is_wrong() -> None:
    started = ReportState.STARTED
    assert wrong(order("t1"), *CANCELLING, report(started, 5.0), cancelled_at(6.0)) == []
    assert len(wrong(order("t1"), *CANCELLING, order("t2"))) == 1
    assert wrong(*CANCELLING, cancelled_at(6.0), report(started, 5.0)) == []  # told late
    assert len(wrong(*CANCELLING, cancelled_at(6.0), report(started, 7.0))) == 1
    assert Cancelled.of(journal(*WANTED, *CANCELLING, cancelled_at(6.0))).plans == 1


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ([report(ReportState.STARTED, 1.0), report(ReportState.SUCCEEDED, 1.0)], 0),
        ([report(ReportState.STARTED, 1.0), report(ReportState.STARTED, 2.0)], 1),
        ([report(ReportState.SUCCEEDED, 1.0), report(ReportState.SUCCEEDED, 1.0, attempt=2)], 1),
    ],
)
def test_what_begins_twice_or_is_done_twice_is_wrong(said: list[Said], expected: int) -> None:
    assert len(done_twice(reports_in(journal(*said)))) == expected


def record(state: TaskState, reason: str | None = None) -> TaskRecord:
    return TaskRecord(
        plan="p", revision=1, task="t1", skill="pick", args={}, actor="a1", robot=ROBOT,
        state=state, attempt=1, reason=reason,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("state", "reason", "said", "expected"),
    [
        (TaskState.SUCCEEDED, None, ReportState.SUCCEEDED, 0),
        (TaskState.SUCCEEDED, None, ReportState.INTERRUPTED, 1),
        (TaskState.SUCCEEDED, "it is so already", ReportState.INTERRUPTED, 0),
        (TaskState.CANCELLED, None, ReportState.SUCCEEDED, 1),
        (TaskState.RUNNING, None, ReportState.INTERRUPTED, 1),
        (TaskState.CANCELLED, None, ReportState.STARTED, 1),
    ],
)
def test_planner_and_worker_say_the_same_of_a_task(
    state: TaskState, reason: str | None, said: ReportState, expected: int
) -> None:
    plan = cancelled_at(6.0)[2]
    assert isinstance(plan, PlanStatus)
    told = report(said, 1.0)[2]
    assert isinstance(told, Report)
    assert len(contradictions([record(state, reason)], [plan], [], [told])) == expected


def test_the_same_chance_draws_the_same_faults_of_every_kind() -> None:
    def draw(seed: int) -> Iterable[object]:
        return drawn(random.Random(seed), 200, 5.0, KINDS, ("hsr", "locobot"))

    assert draw(1) == draw(1) != draw(2)
    assert {fault.kind for fault in drawn(random.Random(1), 200, 5.0, KINDS, ("r",))} == set(KINDS)


def test_what_was_found_is_done_again_one_after_the_other() -> None:
    violations = found()
    faults = one_after_another(violations)
    assert len(faults) == sum(len(each.faults) for each in violations) > 0
    assert {fault.kind for fault in faults} <= set(KINDS)
    first = len(violations[0].faults)
    over_s = max(fault.after_s + fault.lasts_s for fault in faults[:first])
    assert all(fault.after_s >= over_s for fault in faults[first:])
