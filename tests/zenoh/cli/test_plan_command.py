"""Plans by robotctl: refused with every reason, shown as a tree."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from keyexpr_schema.keyspace import (
    ANSWER,
    PLAN_REQUEST,
    PLAN_SPEC,
    PLAN_STATUS,
    PLANNER_ALIVE,
    TASK_RECORD,
)
from keyexpr_schema.payloads.plans import Plan, PlanAddress, PlanState, PlanStatus, Task, Violation
from keyexpr_schema.payloads.requests import Answer, RequestAddress
from keyexpr_schema.payloads.system import PlannerAliveAddress
from keyexpr_schema.payloads.tasks import TaskAddress, TaskRecord, TaskState
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from tests.support.robotctl import Robotctl

MakeConfig = Callable[..., SessionConfig]


async def test_a_refused_plan_says_every_reason(
    robotctl: Robotctl, session_config: MakeConfig
) -> None:
    async def refuse(session: Session) -> None:
        async with session.watch(PLAN_REQUEST) as watch:
            async for change in watch:
                request = change.address.request
                answer = Answer(
                    request=request,
                    accepted=False,
                    sentence="the plan was rejected",
                    violations=(Violation(code="grip", sentence="nobody can grip 9 kg"),),
                )
                await session.confirm(ANSWER, RequestAddress(request), answer)

    async with (
        open_session(session_config(component="planner")) as session,
        session.token(PLANNER_ALIVE, PlannerAliveAddress("run1")),
    ):
        refusing = asyncio.create_task(refuse(session))
        try:
            said = await robotctl.soon("plan", "create", "big-dag", "milp")
        finally:
            refusing.cancel()
    assert said.code == 1
    assert said.err.strip() == "Error: the plan was rejected; nobody can grip 9 kg"


async def test_a_plan_is_shown_as_a_tree(robotctl: Robotctl, session_config: MakeConfig) -> None:
    plan = Plan(
        plan="p1",
        goals=("g1",),
        conditions=(),
        tasks=(
            Task(task="t1", skill="navigate", args={"place": "kitchen"}, actor="a1", goal="g1"),
            Task(
                task="t2", skill="search", args={"x": "cup_1"}, actor="a1", after=("t1",), goal="g1"
            ),
        ),
    )
    status = PlanStatus(
        plan="p1", revision=1, state=PlanState.RUNNING, allocation={"a1": "hsr"}, time_s=1.0
    )
    record = TaskRecord(
        plan="p1",
        revision=1,
        task="t1",
        skill="navigate",
        args={"place": "kitchen"},
        actor="a1",
        robot="hsr",
        state=TaskState.SUCCEEDED,
        started_s=1.0,
        ended_s=5.5,
    )
    async with open_session(session_config(component="planner")) as session:
        await session.confirm(PLAN_SPEC, PlanAddress("p1"), plan)
        await session.confirm(PLAN_STATUS, PlanAddress("p1"), status)
        await session.confirm(TASK_RECORD, TaskAddress("p1", "t1"), record)
        tree = (await robotctl.soon("plan", "show")).out
        data = (await robotctl.soon("plan", "show", "p1", "--json")).data
        tasks = (await robotctl.soon("task", "list", "p1", "--json")).data
        task = (await robotctl.soon("task", "show", "p1", "t1", "--json")).data
        in_one = (await robotctl.soon("task", "show", "p1/t1", "--json")).data
        wrong = await robotctl.soon("task", "show", "p1", "t9")
    assert "t1 navigate(place=kitchen)  a1→hsr  succeeded 4.5 s" in tree
    assert "t2 search(x=cup_1)  a1→hsr  waiting  after t1" in tree
    assert data["status"]["allocation"] == {"a1": "hsr"}
    assert [each["task"] for each in tasks] == ["t1"]
    assert task["task"]["state"] == "succeeded"
    assert task["reports"] == [] and in_one == task
    assert "there is no task of plan p1 't9'; known are: t1" in wrong.err
