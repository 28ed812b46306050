"""What people do to a fleet that works, by robotctl: one planner, robots that the test plays."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest
from msgspec.structs import replace

from cli.client.goal_changes import goals_named, want_again
from cli.errors import Unknown
from keyexpr_schema.keyspace import (
    DELETION,
    FACT,
    GOAL_SPEC,
    GOAL_STATUS,
    HOLD,
    ORDER,
    RETIREMENT,
    ROBOT_SPEC,
    SCHEDULE_SPEC,
    TASK_RECORD,
)
from keyexpr_schema.payloads.goals import Condition, Goal, GoalAddress, GoalState, GoalStatus
from keyexpr_schema.payloads.history import Retired, RetireQuery
from keyexpr_schema.payloads.schedules import Schedule, ScheduleAddress
from keyexpr_schema.payloads.system import PlannerAddress
from keyexpr_schema.payloads.tasks import OrderAddress, ReportState, TaskAddress, TaskState
from keyexpr_schema.transport.session import SessionConfig, open_session
from tests.support.planner_process import (
    ask_for_plan,
    carry_out,
    next_order,
    person,
    planner,
    report,
    value,
)
from tests.support.polling import until
from tests.support.robotctl import Robotctl
from tests.support.router_process import RouterProcess

OTHER = "Bring cup 1 to the living room"


async def test_a_task_done_by_hand_a_goal_wanted_again_and_sooner(
    router: RouterProcess, tmp_path: Path
) -> None:
    robotctl = Robotctl(router.endpoint, tmp_path, "test")
    data = tmp_path / "planner"
    async with person(router.endpoint) as session, planner(router.endpoint, data) as process:
        await ask_for_plan(session)
        sooner = await robotctl.soon("goal", "set", "g", "--priority", "3", "--due", "20min")
        await carry_out(session, await next_order(session, set()))
        pick = await next_order(session, {"t1"})
        await report(session, pick, ReportState.FAILED, reason="no finger", retryable=False)
        await value(session, GOAL_STATUS, GoalAddress("g"), state=GoalState.FAILED)
        again = await robotctl.soon("--as", "ana", "goal", "retry", "g")
        page = (await robotctl.soon("goal", "show", "g")).out
        done = await robotctl.soon("task", "done", "plan-1", "t4", "--why", "it was easy")
        address = OrderAddress("hsr", "plan-1", "t1")
        left = await value(session, ORDER, address, cancelled=True)
        await report(session, left, ReportState.CANCELLED)
        await value(session, GOAL_STATUS, GoalAddress("g"), state=GoalState.REACHED)
        record = await value(
            session, TASK_RECORD, TaskAddress("plan-1", "t4"), state=TaskState.SUCCEEDED
        )
        await session.confirm(GOAL_SPEC, GoalAddress("h"), Goal(goal="h", text=OTHER))
        await robotctl.soon("plan", "create")
        order = await next_order(session, set())
        leaving = asyncio.create_task(robotctl.soon("unregister", "hsr", "--why", "sold"))
        order = await value(session, ORDER, OrderAddress.of(order), cancelled=True)
        (hold,) = (await session.list(HOLD)).values()
        await report(session, order, ReportState.CANCELLED)
        left = await leaving
        robots = await session.list(ROBOT_SPEC)
        orders = await session.list(ORDER)
        facts = {fact.subject for fact in (await session.list(FACT)).values()}
        log = (data / "audit.jsonl").read_bytes()
        deeds = (await robotctl.soon("audit", "--json")).data["entries"]
        about = (await robotctl.soon("audit", "--about", "g", "--by", "ana")).out
        process.kill()
        await process.start()
        await session.delete(GOAL_SPEC, GoalAddress("h"))
        await until(lambda: b"deleted goal h" in (data / "audit.jsonl").read_bytes(), "that")
        gone = RetireQuery(goals=True, plans=True, by="bob")
        retired: Retired = await session.query(RETIREMENT, PlannerAddress(), gone)

        async def written_down() -> bool:
            return not await session.list(DELETION)

        await until(written_down, "announced deletions to be gone")
        after = (data / "audit.jsonl").read_bytes()
    assert after.startswith(log) and after[len(log) :].count(b"\n") == 2, "nothing stands twice"
    assert retired.plans and b'"by":"bob"' in after
    by = {deed["summary"]: deed["by"] for deed in deeds}
    me = by["deleted robot hsr"]
    assert "@" in me
    assert [words.partition(": ")[2] for words in by if by[words] == "ana"] == [
        "plan for g",
        next(words for words in by if "priority 3, due" in words and by[words] == "ana")[8:],
    ]
    for words in ("was done by hand (it was easy)", "hsr drained by", "deleted hold"):
        assert {who for summary, who in by.items() if words in summary} == {me}, words
    assert not any("holding(hsr)" in words for words in by), "what robots say is not in it"
    assert any(words.endswith(" hsr: model hsr") for words in by), by
    assert "ana" in about and "goal g" in about and "robot hsr" not in about
    assert str(hold).endswith("(it is being unregistered: sold)")
    assert (left.code, left.out) == (0, "unregistered hsr\n"), left.err
    assert not robots and not orders and facts == {"cup_1"}
    assert (sooner.code, sooner.out) == (0, "goal g has priority 3 and is due in 20 min\n")
    assert again.out == "plan plan-1 has 4 tasks for 1 goal\ngoal g is wanted again\n"
    assert "put by      ana" in page and "priority    3" in page and "due         " in page
    assert done.code == 0 and " is done by hand by " in done.out
    assert record.reason is not None and record.reason.endswith("(it was easy)")


async def test_what_the_planner_wanted_itself_can_be_wanted_again_by_a_person(
    session_config: Callable[..., SessionConfig],
) -> None:
    wanted = (Condition(relation="at", subject="cup_1", value="kitchen"),)
    failed = GoalStatus(
        goal="put-down-cup_1",
        state=GoalState.FAILED,
        own=True,
        understood="Put cup 1 down in the kitchen",
        conditions=wanted,
    )
    address = GoalAddress(failed.goal)
    async with open_session(session_config(component="person")) as session:
        await session.confirm(GOAL_STATUS, address, failed)
        with pytest.raises(Unknown):
            await goals_named(session, [failed.goal])
        specs, status = await goals_named(session, [failed.goal], own=True)
        await want_again(session, specs, status, "ana")
        spec = await session.get(GOAL_SPEC, address)
    assert spec is not None
    assert (spec.text, spec.conditions, spec.said_by) == (failed.understood, wanted, "ana")


async def test_a_run_of_a_schedule_can_be_wanted_again(
    session_config: Callable[..., SessionConfig],
) -> None:
    text, wanted = "Search the kitchen", Condition(relation="at", subject="cup_1", value="kitchen")
    goal = Goal(goal="daily", text=text, every="PT2H", said_s=10.0, due_s=70.0, priority=2)
    failed = GoalStatus(
        goal="daily.1", state=GoalState.FAILED, part_of="daily", conditions=(wanted,)
    )
    two_stages = replace(failed, goal="daily.2", stages=((wanted,), (wanted,)))
    async with open_session(session_config(component="person")) as session:
        schedule = Schedule(schedule="daily", goal=goal)
        await session.confirm(SCHEDULE_SPEC, ScheduleAddress("daily"), schedule)
        for one in (failed, two_stages):
            await session.confirm(GOAL_STATUS, GoalAddress(one.goal), one)
        specs, status = await goals_named(session, ["daily.1", "daily.2"], own=True)
        await want_again(session, specs, status, "ana")
        once = await session.get(GOAL_SPEC, GoalAddress("daily.1"))
        assert await session.get(SCHEDULE_SPEC, ScheduleAddress("daily")) == schedule
    assert once is not None and specs["daily.2"].conditions == ()
    assert (once.text, once.every, once.conditions) == (text, None, (wanted,))
    assert (once.priority, once.due_s, once.said_by) == (2, once.said_s + 60.0, "ana")
