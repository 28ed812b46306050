"""What keeps robots from orders that they have, as planner and workers say."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from keyexpr_schema.keyspace import ORDER
from keyexpr_schema.payloads.robots import RobotState
from keyexpr_schema.payloads.system import UndecodableValue
from keyexpr_schema.payloads.tasks import (
    ENDED_TASKS,
    OrderAddress,
    TaskRecord,
    TaskState,
)
from keyexpr_schema.payloads.waits import WaitKind, WaitReason


def order_key(record: TaskRecord) -> str | None:
    """Where the order of a task stands; `None`: no robot has it."""
    if record.robot is None:
        return None
    return ORDER.build(OrderAddress(record.robot, record.plan, record.task))


def waits_of_order(
    record: TaskRecord,
    states: Mapping[str, RobotState],
    rejects: Iterable[UndecodableValue],
) -> tuple[WaitReason, ...]:
    """What an ordered task waits for: what the planner says of it, that its order is among the
    `rejects` (values that nobody can read, and that still stand), and what the robot says itself.

    Of a robot that the planner sees held up, its own last word counts no more.
    """
    if record.robot is None or record.state is TaskState.WAITING or record.state in ENDED_TASKS:
        return record.waits_for
    robot, plan, task = record.robot, record.plan, record.task
    unreadable = (
        WaitReason(
            kind=WaitKind.UNREADABLE,
            robot=robot,
            plan=plan,
            task=task,
            sentence=f"{each.component} says: {each.reason}",
        )
        for each in rejects
        if each.keyexpr == order_key(record)
    )
    state = None if record.waits_for else states.get(robot)
    said = state.waits_for if state is not None else ()
    own = (reason for reason in said if (reason.plan, reason.task) == (plan, task))
    return (*record.waits_for, *unreadable, *own)
