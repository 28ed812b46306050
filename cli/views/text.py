"""Small pieces of text that many views share."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil

from keyexpr_schema.ids import actor_arg, actor_in
from keyexpr_schema.payloads.goals import Condition, GoalStatus
from keyexpr_schema.payloads.plans import PlanStatus, Task
from keyexpr_schema.payloads.robots import RobotSpec, RobotState
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState
from keyexpr_schema.payloads.world import StatementStatus

STATE_STYLE = {
    "waiting": "dim",
    "reading": "dim",
    "pending": "dim",
    "standing": "cyan",
    "not-needed": "dim",
    "planned": "cyan",
    "proposed": "yellow",
    "planning": "cyan",
    "ready": "cyan",
    "ordered": "cyan",
    "running": "yellow",
    "succeeded": "green",
    "reached": "green",
    "failed": "red",
    "rejected": "red",
    "cancelled": "magenta",
}
"""rich style by the value of a goal's, plan's or task's state."""


def seconds(duration_s: float | None) -> str:
    """`12.3 s`; nothing for `None`."""
    return "" if duration_s is None else f"{duration_s:.1f} s"


def counted(count: int, word: str) -> str:
    """`1 goal`, `3 goals`."""
    return f"{count} {word}{'' if count == 1 else 's'}"


def skill_call(skill: str, args: Mapping[str, str], leave_out: str | None = None) -> str:
    """`pick(object=cup_1)`; arguments equal to `leave_out` (the robot itself) are not shown."""
    inner = ", ".join(f"{name}={arg}" for name, arg in args.items() if arg != leave_out)
    return f"{skill}({inner})"


def task_call(task: Task, status: PlanStatus | None, robot: str | None = None) -> str:
    """The call of a task without who does it (`robot`), with robots in place of actors."""
    allocation = status.allocation if status else {}
    return skill_call(
        task.skill,
        {
            name: allocation.get(actor_in(arg) or "", arg)
            for name, arg in task.args.items()
            if arg not in (actor_arg(task.actor), robot)
        },
    )


def performer(task: Task, status: PlanStatus | None, record: TaskRecord | None) -> str | None:
    """The robot that does a task, as far as that is decided."""
    allocated = status.allocation.get(task.actor) if status else None
    return (record.robot if record else None) or allocated


def spent_s(record: TaskRecord, now_s: float | None) -> float | None:
    """Seconds from the start of a task to its end, or to now while it runs."""
    if record.started_s is None:
        return None
    until = record.ended_s
    if until is None and record.state is TaskState.RUNNING:
        until = now_s
    return None if until is None else max(0.0, until - record.started_s)


def last_s(record: TaskRecord) -> float | None:
    """When a task came to stand as it does, on the fleet's clock [s]."""
    times = (record.ended_s, record.started_s, record.ordered_s)
    return next((at_s for at_s in times if at_s is not None), None)


def doing(state: RobotState | None) -> str:
    """What a robot is at, e.g. `plan-1/t3`."""
    if state is None or state.task is None:
        return ""
    return f"{state.plan}/{state.task}" if state.plan else state.task


def stages(status: GoalStatus) -> tuple[tuple[Condition, ...], ...]:
    """What must hold for a goal, stage by stage."""
    return status.stages or ((status.conditions,) if status.conditions else ())


def meaning(status: GoalStatus) -> str:
    """What a goal was understood as: its conditions, stage by stage."""
    found = ", then ".join(" and ".join(str(each) for each in stage) for stage in stages(status))
    return found or status.understood or ""


def statement_means(status: StatementStatus | None) -> str:
    """What the planner read out of a statement, to go on with behind it; empty: nobody read it."""
    if status is None:
        return ""
    if not status.facts:
        return f", not understood: {status.reason or 'it says nothing of the world'}"
    facts = " and ".join(str(fact.literal) for fact in status.facts)
    return f", understood as {facts}"


def carried(state: RobotState | None) -> str:
    """What a robot has in its hand and basket."""
    if state is None:
        return ""
    parts = [state.holding] if state.holding and state.holding != "nothing" else []
    if state.basket:
        parts.append(f"basket: {', '.join(state.basket)}")
    return "; ".join(parts)


def charge(state: RobotState | None) -> str:
    """How full a robot's battery is; of one that has none, nothing."""
    if state is None or state.charge is None:
        return ""
    return "empty" if state.charge <= 0.0 else f"{ceil(state.charge)} %"


def capabilities(spec: RobotSpec) -> str:
    """`drive 0.6, grip 1.2`."""
    return ", ".join(f"{name} {amount:g}" for name, amount in spec.capabilities.items())


def outcome(status: PlanStatus) -> str:
    """Why a plan stands as it does: its reason and every violation, or nothing."""
    parts = [status.reason] if status.reason else []
    for each in status.violations:
        if not any(each.sentence in part for part in parts):
            parts.append(each.sentence)
    return "; ".join(parts)


def refusal(status: GoalStatus) -> str:
    """Why a goal was not taken, or failed; what it asks, and how that is answered."""
    reason = status.reason or "no reason given"
    if not status.candidates or status.paraphrase is not None:
        return f"goal {status.goal} {status.state.value}: {reason}"
    listed = "; ".join(f"{i} ({words})" for i, words in enumerate(status.candidates, 1))
    return (
        f"goal {status.goal} asks: {reason}, with `robotctl goal answer {status.goal} NUMBER`: "
        f"{listed}"
    )
