"""What an earlier planner left on the keys, for one that has neither its journal nor its archive.

What is over there is over here as well, so that nothing is done a second time. A plan that was
under way has nobody who follows it up: it counts as cancelled, and its goals are planned anew.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from msgspec.structs import replace

from keyexpr_schema.keyspace import (
    ANSWER,
    GOAL_SPEC,
    GOAL_STATUS,
    PLAN_SPEC,
    PLAN_STATUS,
    TASK_RECORD,
)
from keyexpr_schema.payloads.goals import OVER_GOALS, Goal, GoalStatus
from keyexpr_schema.payloads.history import Ended, GoalRecord, PlanRecord, RequestRecord
from keyexpr_schema.payloads.plans import ENDED_PLANS, Plan, PlanState, PlanStatus
from keyexpr_schema.payloads.tasks import TaskRecord
from keyexpr_schema.transport.session import Session

ABANDONED = "its planner has lost its journal"


async def inherited(session: Session, wall_time_s: float) -> list[Ended]:
    """Everything on the keys that is over, as of now where its time is not known."""
    specs = {a.goal: spec for a, spec in (await session.list(GOAL_SPEC)).items()}
    goals = {
        a.goal: _goal_record(status, specs, wall_time_s)
        for a, status in (await session.list(GOAL_STATUS)).items()
        if status.state in OVER_GOALS
    }
    plans = {a.plan: spec for a, spec in (await session.list(PLAN_SPEC)).items()}
    tasks: dict[str, list[TaskRecord]] = {}
    for task in (await session.list(TASK_RECORD)).values():
        tasks.setdefault(task.plan, []).append(task)
    records: list[Ended] = []
    for status in (await session.list(PLAN_STATUS)).values():
        own = [goals.pop(goal) for goal in status.goals if goal in goals]
        records.append(
            _plan_record(
                status, plans.get(status.plan), tasks.get(status.plan, ()), own, wall_time_s
            )
        )
    records += goals.values()
    records += [
        RequestRecord(answer=answer, ended_s=0.0, ended_wall_s=wall_time_s)
        for answer in (await session.list(ANSWER)).values()
    ]
    return records


def _goal_record(status: GoalStatus, specs: Mapping[str, Goal], wall_time_s: float) -> GoalRecord:
    return GoalRecord(
        spec=specs.get(status.goal) or Goal(goal=status.goal, text=""),
        status=status,
        ended_s=status.time_s,
        ended_wall_s=status.wall_time_s or wall_time_s,
    )


def _plan_record(
    status: PlanStatus,
    spec: Plan | None,
    tasks: Iterable[TaskRecord],
    goals: Iterable[GoalRecord],
    wall_time_s: float,
) -> PlanRecord:
    if status.state not in ENDED_PLANS:
        status = replace(status, state=PlanState.CANCELLED, reason=ABANDONED)
    tasks = tuple(tasks)
    ordered_s = (task.ordered_s for task in tasks if task.ordered_s is not None)
    return PlanRecord(
        spec=spec or Plan(plan=status.plan, goals=status.goals, conditions=(), tasks=()),
        status=status,
        tasks=tasks,
        goals=tuple(goals),
        begun_s=min(ordered_s, default=status.time_s),
        begun_wall_s=wall_time_s,
        ended_s=status.time_s,
        ended_wall_s=wall_time_s,
    )
