"""What is over, with the planner and a router as processes: archived, answered for, forgotten."""

from __future__ import annotations

import asyncio
import sqlite3
from contextlib import closing
from pathlib import Path

from keyexpr_schema.keyspace import (
    ANSWER,
    CONTROL_REQUEST,
    GOAL_SPEC,
    GOAL_STATUS,
    ORDER,
    PLAN_PROPOSAL,
    PLAN_REQUEST,
    PLAN_SPEC,
    PLAN_STATUS,
    REPORT,
    TASK_RECORD,
)
from keyexpr_schema.payloads.goals import Goal, GoalAddress, GoalState
from keyexpr_schema.payloads.plans import Plan, PlanAddress, PlanState
from keyexpr_schema.payloads.requests import (
    Control,
    ControlRequest,
    PlanRequest,
    RequestAddress,
)
from keyexpr_schema.payloads.tasks import OrderAddress, Report, ReportAddress, ReportState
from keyexpr_schema.transport.session import Session
from tests.support.planner_process import (
    ask_for_plan,
    carry_out,
    next_order,
    person,
    planner,
    value,
)
from tests.support.polling import until
from tests.support.robotctl import Robotctl
from tests.support.router_process import RouterProcess

ROOMS = ("hallway", "kitchen")


async def mission(session: Session, number: int) -> None:
    """A goal `gN` is brought about by a plan `pN`."""
    goal, plan = f"g{number}", f"p{number}"
    text = f"Bring cup 1 to the {ROOMS[(number - 1) % 2]}"
    await session.confirm(GOAL_SPEC, GoalAddress(goal), Goal(goal=goal, text=text))
    await value(session, GOAL_STATUS, GoalAddress(goal), state=GoalState.WAITING)
    request = PlanRequest(request=f"r{number}", plan=plan)
    await session.confirm(PLAN_REQUEST, RequestAddress(request.request), request)
    await value(session, ANSWER, RequestAddress(request.request), accepted=True)
    done: set[str] = set()
    while True:
        status = await session.get(PLAN_STATUS, PlanAddress(plan))
        if status is not None and status.state is PlanState.SUCCEEDED:
            break
        orders = await session.list(ORDER, robot="hsr", plan=plan)
        for order in orders.values():
            if order.task not in done:
                done.add(order.task)
                await carry_out(session, order, took_s=10.0)
    await value(session, GOAL_STATUS, GoalAddress(goal), state=GoalState.REACHED)


async def keys_about(session: Session, number: int) -> set[str]:
    """Names of the keys that have something about a mission."""
    plan, goal, request = f"p{number}", f"g{number}", f"r{number}"
    found = {
        key.name
        for key in (PLAN_SPEC, PLAN_STATUS, PLAN_PROPOSAL, TASK_RECORD, REPORT, ORDER)
        if await session.list(key, plan=plan)
    }
    found |= {key.name for key in (GOAL_SPEC, GOAL_STATUS) if await session.list(key, goal=goal)}
    return found | {
        key.name for key in (PLAN_REQUEST, ANSWER) if await session.list(key, request=request)
    }


ALL = {
    key.name for key in (PLAN_SPEC, PLAN_STATUS, TASK_RECORD, REPORT, GOAL_SPEC, GOAL_STATUS)
} | {PLAN_REQUEST.name, ANSWER.name}


async def all_about(session: Session, number: int) -> bool:
    return await keys_about(session, number) == ALL


async def test_keys_go_after_the_retention_and_the_history_stays(
    router: RouterProcess, tmp_path: Path
) -> None:
    robotctl = Robotctl(router.endpoint, tmp_path, realm="test")
    async with (
        person(router.endpoint) as session,
        planner(router.endpoint, tmp_path / "planner", "--keep", "1"),
    ):
        await mission(session, 1)
        await until(lambda: all_about(session, 1), "the keys of the first mission")
        await mission(session, 2)

        async def gone() -> bool:
            return not await keys_about(session, 1)

        await until(gone, "the keys of the first mission to go")
        await until(lambda: all_about(session, 2), "the keys of the second mission")
        listed = (await robotctl.soon("plan", "list", "--json")).data
        assert [each["plan"] for each in listed] == ["p2"]
        entries = (await robotctl.soon("history", "--json")).data
        assert [entry["plan"] for entry in entries] == ["p2", "p1"]
        (goal,) = entries[1]["goals"]
        assert (goal["goal"], goal["outcome"]) == ("g1", "reached")
        (share,) = entries[1]["robots"]
        assert (share["robot"], share["tasks"]) == ("hsr", 4)
        table = (await robotctl.soon("history", "--goal", "g1")).out
        assert "Bring cup 1 to the hallway" in table
        assert "p2" not in table
        stats = (await robotctl.soon("history", "stats", "--json")).data
        assert stats["total"]["goals"] == {"reached": 2}
        assert [use["robot"] for use in stats["total"]["robots"]] == ["hsr"]
        assert "reached" in (await robotctl.soon("history", "stats")).out
    down = await robotctl.soon("history")
    assert down.code == 1
    assert down.err.startswith("Error: no planner is running")


async def test_nothing_that_is_over_is_done_again_after_a_kill(
    router: RouterProcess, tmp_path: Path
) -> None:
    """The keys still say that the goal is wanted and that the plan is asked for."""
    async with person(router.endpoint) as session:
        async with planner(router.endpoint, tmp_path) as process:
            await mission(session, 1)
            process.kill()
        async with planner(router.endpoint, tmp_path, "--auto-plan"):
            again = Goal(goal="g2", text="Bring cup 1 to the kitchen")
            await session.confirm(GOAL_SPEC, GoalAddress("g2"), again)
            order = await next_order(session, set())
            assert order.plan == "plan-1"
            status = await session.get(GOAL_STATUS, GoalAddress("g1"))
            assert status is not None
            assert status.state is GoalState.REACHED
            assert {a.plan for a in await session.list(PLAN_STATUS)} == {"p1", "plan-1"}


async def test_what_ended_at_the_moment_of_a_kill_is_so_on_its_keys_afterwards(
    router: RouterProcess, tmp_path: Path
) -> None:
    """The archive has it, and the keys may not: the next run publishes what is unsettled."""
    async with person(router.endpoint) as session:
        async with planner(router.endpoint, tmp_path) as process:
            await mission(session, 1)
            process.kill()
            status = await session.get(PLAN_STATUS, PlanAddress("p1"))
            assert status is not None
            await session.delete(PLAN_STATUS, PlanAddress("p1"))
            with closing(sqlite3.connect(tmp_path / "archive.db")) as db, db:
                db.execute("UPDATE ended SET settled = 0 WHERE name = 'p1'")
            await process.start()
            assert await value(session, PLAN_STATUS, PlanAddress("p1")) == status


async def test_a_plan_that_ended_is_answered_for_and_deleted_with_its_reports(
    router: RouterProcess, tmp_path: Path
) -> None:
    robotctl = Robotctl(router.endpoint, tmp_path, realm="test")
    async with person(router.endpoint) as session, planner(router.endpoint, tmp_path / "data"):
        await mission(session, 1)
        replan = await robotctl.soon("replan", "p1")
        assert replan.code == 1
        assert "plan p1 is not running: it succeeded" in replan.err
        cancel = ControlRequest(request="c", control=Control.CANCEL, plan="p1")
        await session.confirm(CONTROL_REQUEST, RequestAddress("c"), cancel)
        answer = await value(session, ANSWER, RequestAddress("c"), accepted=False)
        assert "it succeeded" in answer.sentence
        made = await robotctl.soon("plan", "create", "big-dag", "makespan", "g1")
        assert "goal g1 is reached" in made.err
        taken = PlanRequest(request="r2", plan="p1", goals=("g1",))
        await session.confirm(PLAN_REQUEST, RequestAddress("r2"), taken)
        answer = await value(session, ANSWER, RequestAddress("r2"), accepted=False)
        assert "there has been a plan p1 already" in answer.sentence
        deleted = await robotctl.soon("plan", "delete", "p1")
        assert deleted.out.strip() == "plan p1 is deleted"
        assert await keys_about(session, 1) == {PLAN_REQUEST.name, ANSWER.name}
        entries = (await robotctl.soon("history", "--json")).data
        assert [entry["plan"] for entry in entries] == ["p1"]


async def test_all_that_ended_is_deleted_at_a_word(router: RouterProcess, tmp_path: Path) -> None:
    robotctl = Robotctl(router.endpoint, tmp_path, realm="test")
    async with person(router.endpoint) as session, planner(router.endpoint, tmp_path / "data"):
        await mission(session, 1)
        dragon = Goal(goal="dragon", text="Bring the dragon to the hallway")
        await session.confirm(GOAL_SPEC, GoalAddress("dragon"), dragon)
        await value(session, GOAL_STATUS, GoalAddress("dragon"), state=GoalState.REJECTED)
        young = await robotctl.soon("goal", "delete", "--ended", "--older-than", "1h")
        assert young.out.strip() == "there is nothing such that has ended"
        goals = await robotctl.soon("goal", "delete", "--ended", "--json")
        assert goals.data == {"plans": 0, "goals": 2, "left": False}
        assert await session.list(GOAL_SPEC) == {}
        assert PLAN_STATUS.name in await keys_about(session, 1)
        plans = await robotctl.soon("plan", "delete", "--ended")
        assert plans.out.startswith("deleted 1 plan; ")
        assert await session.list(PLAN_STATUS) == {}

        async def told() -> bool:
            entries = (await robotctl.soon("history", "--goal", "dragon", "--json")).data
            return [entry["outcome"] for entry in entries] == ["rejected"]

        await until(told, "the rejected goal to be in the history")


async def test_a_goal_of_the_same_name_is_a_new_one_when_the_old_one_was_deleted(
    router: RouterProcess, tmp_path: Path
) -> None:
    async with person(router.endpoint) as session, planner(router.endpoint, tmp_path):
        await mission(session, 1)
        await session.delete(GOAL_SPEC, GoalAddress("g1"))

        async def gone() -> bool:
            return await session.get(GOAL_STATUS, GoalAddress("g1")) is None

        await until(gone, "the status of the deleted goal to go")
        again = Goal(goal="g1", text="Bring cup 1 to the kitchen")
        await session.confirm(GOAL_SPEC, GoalAddress("g1"), again)
        await value(session, GOAL_STATUS, GoalAddress("g1"), state=GoalState.WAITING)


async def test_the_name_of_a_plan_that_was_deleted_is_not_used_again(
    router: RouterProcess, tmp_path: Path
) -> None:
    """Its orders would be taken for those of the plan before: the robot has done them."""
    async with (
        person(router.endpoint) as session,
        planner(router.endpoint, tmp_path / "planner"),
    ):
        await mission(session, 1)
        delete = ControlRequest(request="d", control=Control.DELETE, plan="p1")
        await session.confirm(CONTROL_REQUEST, RequestAddress("d"), delete)
        await value(session, ANSWER, RequestAddress("d"), accepted=True)
        assert not await session.list(PLAN_STATUS)
        goal = Goal(goal="g9", text="Bring cup 1 to the kitchen")
        await session.confirm(GOAL_SPEC, GoalAddress("g9"), goal)
        await value(session, GOAL_STATUS, GoalAddress("g9"), state=GoalState.WAITING)
        again = PlanRequest(request="again", plan="p1")
        await session.confirm(PLAN_REQUEST, RequestAddress("again"), again)
        answer = await value(session, ANSWER, RequestAddress("again"), accepted=False)
        assert answer.sentence.startswith("there has been a plan p1 already: it succeeded")
        proposal = Plan(plan="p1", goals=("g9",), conditions=(), tasks=())
        await session.confirm(PLAN_PROPOSAL, PlanAddress("p1"), proposal)
        status = await value(session, PLAN_STATUS, PlanAddress("p1"), state=PlanState.REJECTED)
        assert status.reason == answer.sentence


async def test_a_plan_that_is_being_cancelled_is_deleted_once_its_robots_have_spoken(
    router: RouterProcess, tmp_path: Path
) -> None:
    """Also when the planner is killed in between."""
    robotctl = Robotctl(router.endpoint, tmp_path, realm="test")
    async with person(router.endpoint) as session:
        async with planner(router.endpoint, tmp_path / "data") as process:
            await ask_for_plan(session)
            order = await next_order(session, set())
            assert (await robotctl.soon("plan", "cancel", "p")).code == 0
            await value(session, ORDER, OrderAddress.of(order), cancelled=True)
            deleting = asyncio.create_task(robotctl.soon("plan", "delete", "p"))

            async def asked() -> bool:
                wanted = (await session.list(CONTROL_REQUEST)).values()
                return any(ask.control is Control.DELETE for ask in wanted)

            await until(asked, "the request")
            process.kill()
            await process.start()
            report = Report(
                robot="hsr", plan="p", revision=1, task=order.task, attempt=1, epoch=order.epoch,
                incarnation="i1", state=ReportState.CANCELLED, planner=order.planner,
            )  # fmt: skip
            await session.confirm(REPORT, ReportAddress.of(report), report)
            deleted = await deleting
            assert (deleted.code, deleted.out.strip()) == (0, "plan p is deleted"), deleted.err
            assert await session.list(PLAN_STATUS) == {}
            assert await session.list(REPORT) == {}
            (entry,) = (await robotctl.soon("history", "--json")).data
            assert (entry["plan"], entry["outcome"]) == ("p", "cancelled")
