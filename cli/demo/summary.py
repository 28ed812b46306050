"""What a demo comes to: verdicts from the physics, and the times of its tasks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import msgspec

from cli.demo.verdict import GoalVerdict
from fleet.scheduling.idle_time import measured_idle
from keyexpr_schema.payloads.simulation import ContactCount
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState


class TaskLine(msgspec.Struct, frozen=True, kw_only=True):
    """One task; times are simulated seconds."""

    plan: str
    task: str
    skill: str
    args: dict[str, str]
    robot: str | None
    attempt: int
    tries: int
    start_s: float | None
    end_s: float | None
    duration_s: float | None
    state: TaskState


class Summary(msgspec.Struct, frozen=True, kw_only=True):
    """One demo. `ok`: physics and planner agree that every goal is reached.

    `makespan_s`, `busy_s` and `idle_s` are simulated seconds; `wall_s` is real ones, from the
    start of the first process to the last verdict. `real_time_factor` is simulated over real
    seconds while the plan was carried out.
    """

    mission: str
    backend: str
    ok: bool
    goals: tuple[GoalVerdict, ...]
    tasks: tuple[TaskLine, ...]
    revisions: dict[str, int]
    makespan_s: float
    busy_s: dict[str, float]
    idle_s: dict[str, float]
    contacts: ContactCount | None
    wall_s: float
    real_time_factor: float | None
    out: str
    recording: str | None


def task_lines(records: Iterable[TaskRecord]) -> tuple[TaskLine, ...]:
    """Tasks in the order in which they started; those that never did come last."""
    lines = [
        TaskLine(
            plan=record.plan,
            task=record.task,
            skill=record.skill,
            args=record.args,
            robot=record.robot,
            attempt=record.attempt,
            tries=len(record.tries),
            start_s=record.started_s,
            end_s=record.ended_s,
            duration_s=(
                record.ended_s - record.started_s
                if record.started_s is not None and record.ended_s is not None
                else None
            ),
            state=record.state,
        )
        for record in records
    ]
    return tuple(
        sorted(lines, key=lambda line: (line.start_s is None, line.start_s or 0.0, line.task))
    )


def times(
    records: Sequence[TaskRecord], robots: Sequence[str]
) -> tuple[float, dict[str, float], dict[str, float]]:
    """Makespan, busy time by robot and idle time by robot [s].

    The makespan runs from the first order to the last end. A robot is busy while at least one of
    its tasks runs (tries of earlier attempts count, too); it is idle for the rest of the makespan.
    """
    measured = measured_idle(records, robots)
    busy_s = {robot: measured.busy[robot] for robot in robots}
    idle_s = {robot: max(0.0, measured.makespan - busy) for robot, busy in busy_s.items()}
    return measured.makespan, busy_s, idle_s
