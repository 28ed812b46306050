"""From records of what is over to lines of the history: the outcome, who did it, how long."""

from __future__ import annotations

from collections.abc import Iterable

from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.history import (
    GoalRecord,
    HistoryOutcome,
    PastEntry,
    PastGoal,
    PlanRecord,
    RobotShare,
)
from keyexpr_schema.payloads.tasks import TaskRecord

_GOAL_OUTCOMES = {
    GoalState.REACHED: HistoryOutcome.REACHED,
    GoalState.FAILED: HistoryOutcome.FAILED,
    GoalState.REJECTED: HistoryOutcome.REJECTED,
    GoalState.NOT_NEEDED: HistoryOutcome.NOT_NEEDED,
}


def past_goal(record: GoalRecord) -> PastGoal:
    """What came of a goal."""
    status = record.status
    outcome = _GOAL_OUTCOMES.get(status.state)
    took_s = None if status.given_s is None else record.ended_s - status.given_s
    return PastGoal(
        goal=record.spec.goal,
        text=record.spec.text,
        outcome=outcome or (HistoryOutcome.DELETED if record.deleted else HistoryOutcome.OPEN),
        reason=status.reason,
        plan=status.plan,
        by=record.spec.said_by,
        # A simulation that began again in the meantime has set the clock back.
        took_s=took_s if took_s is not None and took_s >= 0.0 else None,
    )


def entry_of(record: PlanRecord | GoalRecord, number: int = 0) -> PastEntry:
    """The line of the history that a record is, as the archive's entry of this number."""
    if isinstance(record, GoalRecord):
        goal, status = past_goal(record), record.status
        begun_wall_s = record.ended_wall_s if status.given_wall_s is None else status.given_wall_s
        return PastEntry(
            number=number,
            outcome=goal.outcome,
            reason=goal.reason,
            goals=(goal,),
            begun_s=record.ended_s if status.given_s is None else status.given_s,
            ended_s=record.ended_s,
            begun_wall_s=begun_wall_s,
            ended_wall_s=record.ended_wall_s,
        )
    return PastEntry(
        number=number,
        plan=record.spec.plan,
        outcome=HistoryOutcome(record.status.state.value),
        reason=record.status.reason,
        goals=tuple(past_goal(goal) for goal in record.goals),
        robots=shares(record.tasks, set(record.status.allocation.values())),
        tasks=len(record.tasks),
        replans=record.status.revision - 1,
        begun_s=record.begun_s,
        ended_s=record.ended_s,
        begun_wall_s=record.begun_wall_s,
        ended_wall_s=record.ended_wall_s,
    )


def shares(tasks: Iterable[TaskRecord], robots: set[str]) -> tuple[RobotShare, ...]:
    """What each robot did of these tasks; `robots` tells robots in arguments from other things."""
    counts: dict[str, int] = {}
    busy_s: dict[str, float] = {}
    for task in tasks:
        if task.robot is None or task.started_s is None:
            continue
        took_s = 0.0 if task.ended_s is None else max(0.0, task.ended_s - task.started_s)
        for robot in {task.robot, *(robots.intersection(task.args.values()))}:
            counts[robot] = counts.get(robot, 0) + 1
            busy_s[robot] = busy_s.get(robot, 0.0) + took_s
    return tuple(
        RobotShare(robot=robot, tasks=counts[robot], busy_s=busy_s[robot])
        for robot in sorted(counts)
    )
