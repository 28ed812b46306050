"""Records of plans, goals and requests that are over, for tests of the archive."""

from __future__ import annotations

from keyexpr_schema.payloads.goals import Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.history import GoalRecord, PlanRecord, RequestRecord
from keyexpr_schema.payloads.plans import Plan, PlanState, PlanStatus
from keyexpr_schema.payloads.requests import Answer
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState

DAY_S = 86_400.0


def past_goal(
    name: str,
    state: GoalState = GoalState.REACHED,
    *,
    given_s: float = 0.0,
    ended_s: float = 10.0,
    wall_s: float = 0.0,
    reason: str | None = None,
    plan: str | None = None,
    deleted: bool = False,
) -> GoalRecord:
    status = GoalStatus(
        goal=name,
        state=state,
        plan=plan,
        reason=reason,
        given_s=given_s,
        given_wall_s=wall_s,
        time_s=ended_s,
        wall_time_s=wall_s + ended_s,
    )
    return GoalRecord(
        spec=Goal(goal=name, text=f"Do {name}."),
        status=status,
        ended_s=ended_s,
        ended_wall_s=wall_s + ended_s,
        deleted=deleted,
    )


def past_task(plan: str, task: str, robot: str, started_s: float, ended_s: float) -> TaskRecord:
    return TaskRecord(
        plan=plan,
        revision=1,
        task=task,
        skill="navigate",
        args={"robot": robot},
        actor="a1",
        robot=robot,
        state=TaskState.SUCCEEDED,
        started_s=started_s,
        ended_s=ended_s,
    )


def past_plan(
    name: str,
    *goals: GoalRecord,
    state: PlanState = PlanState.SUCCEEDED,
    robot: str = "hsr",
    begun_s: float = 0.0,
    took_s: float = 20.0,
    busy_s: float = 10.0,
    wall_s: float = 0.0,
    revision: int = 1,
) -> PlanRecord:
    return PlanRecord(
        spec=Plan(
            plan=name, goals=tuple(goal.spec.goal for goal in goals), conditions=(), tasks=()
        ),
        status=PlanStatus(
            plan=name,
            revision=revision,
            state=state,
            goals=tuple(goal.spec.goal for goal in goals),
            allocation={"a1": robot},
        ),
        tasks=(past_task(name, "t1", robot, begun_s, begun_s + busy_s),),
        goals=goals,
        begun_s=begun_s,
        begun_wall_s=wall_s,
        ended_s=begun_s + took_s,
        ended_wall_s=wall_s + took_s,
    )


def past_request(name: str, wall_s: float = 0.0, plan: str | None = None) -> RequestRecord:
    answer = Answer(request=name, accepted=True, sentence="done", plan=plan)
    return RequestRecord(answer=answer, ended_s=0.0, ended_wall_s=wall_s)
