"""Goals for later by robotctl, and a planner process that sees to them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from keyexpr_schema.keyspace import FACT, GOAL_STATUS, ORDER, SCHEDULE_STATUS
from keyexpr_schema.payloads.goals import GoalAddress, GoalState
from keyexpr_schema.payloads.schedules import ScheduleAddress, ScheduleState
from keyexpr_schema.payloads.tasks import Order
from keyexpr_schema.payloads.world import FactAddress
from keyexpr_schema.transport.session import Session
from tests.support.household import fact
from tests.support.planner_process import person, planner, value
from tests.support.polling import until
from tests.support.robotctl import Robotctl
from tests.support.router_process import RouterProcess


async def _put(robotctl: Robotctl, text: str, *options: str) -> dict[str, Any]:
    said = await robotctl.soon("goal", "add", text, "--id", "g", "--json", *options)
    assert said.code == 0, said.err
    return dict(said.data)


async def _an_order(session: Session) -> Order:
    async def look() -> Order | None:
        return next(iter((await session.list(ORDER)).values()), None)

    order = await until(look, "an order")
    assert isinstance(order, Order)
    return order


@pytest.fixture
def robotctl(router: RouterProcess, tmp_path: Path) -> Robotctl:
    return Robotctl(router.endpoint, tmp_path, realm="test")


async def test_a_goal_waits_for_its_time_through_a_crash(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    async with (
        person(router.endpoint) as session,
        planner(router.endpoint, tmp_path / "data") as process,
    ):
        row = await _put(robotctl, "Bring cup 1 to the hallway", "--at", "3s")
        assert row["spec"]["not_before_s"] == row["spec"]["said_s"] + 3.0
        process.kill()
        await process.start()
        await value(session, GOAL_STATUS, GoalAddress("g"), state=GoalState.RUNNING)
        assert (await _an_order(session)).robot == "hsr"


async def test_a_goal_waits_for_a_fact_and_is_not_needed_for_lack_of_one(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    async with person(router.endpoint, cups=2) as session, planner(router.endpoint, tmp_path / "d"):
        row = await _put(robotctl, "When cup 2 is in the hallway, bring cup 1 to the hallway")
        assert row["status"]["reason"] == "it waits until cup 2 is in the hallway"
        known = fact("cup_2", "at", "hallway")
        await session.confirm(FACT, FactAddress.of(known.key), known)
        await _an_order(session)
        over = await robotctl.soon(
            *("goal", "add", "If cup 2 is in the kitchen, bring cup 1 to the kitchen", "--id", "h")
        )
        assert over.code == 0
        assert "is not-needed" in over.out
        assert "it is not needed, since it is not so that cup 2 is in the kitchen" in over.out


async def test_what_is_kept_or_repeated_is_shown_with_what_it_makes(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    async with person(router.endpoint) as session, planner(router.endpoint, tmp_path / "d"):
        said = await robotctl.soon("goal", "add", "Keep cup 1 in the kitchen", "--id", "k")
        assert "goal k is standing, understood as always: cup 1 is in the kitchen" in said.out
        gone = fact("cup_1", "at", "hallway")
        await session.confirm(FACT, FactAddress.of(gone.key), gone)
        await value(session, GOAL_STATUS, GoalAddress("k.1"), state=GoalState.RUNNING)
        page = (await robotctl.soon("goal", "show", "k")).out
        assert "parts       k.1 running, at(cup_1) = kitchen" in page
        assert (await robotctl.soon("goal", "delete", "k")).code == 0

        async def gone_too() -> bool:
            return await session.get(GOAL_STATUS, GoalAddress("k.1")) is None

        await until(gone_too, "the goal that it made to go with it")
        text, option = "Bring cup 1 to the kitchen", "--whenever"
        added = await robotctl.soon(
            *("goal", "add", text, "--id", "w", option, "at(cup_1) != hallway", "--json")
        )
        assert (added.data["status"]["state"], added.data["status"]["parts"]) == ("standing", [])
        page = (await robotctl.soon("goal", "show", "w")).out
        assert "whenever    at(cup_1) != hallway" in page
        assert (await robotctl.soon("goal", "delete", "w")).code == 0
        row = await _put(robotctl, "Bring cup 1 to the kitchen", "--every", "PT1H")
        assert row["status"]["parts"] == ["g.1"]
        listed = await robotctl.soon("goal", "list", "--json")
        assert [part["goal"] for part in listed.data[0]["parts"]] == ["g.1"]
        said = await robotctl.soon("goal", "show", "g")
        assert "every       PT1H" in said.out
        assert "next        " in said.out


async def test_a_schedule_runs_through_a_crash_is_paused_and_deleted(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    async def of(name: str, *words: str) -> Any:
        said = await robotctl.soon("schedule", name, *words, "--json")
        assert said.code == 0, said.err
        return said.data

    async with (
        person(router.endpoint) as session,
        planner(router.endpoint, tmp_path / "data") as process,
    ):
        zone = ("--every", "2h", "--zone", "Europe/Berlin", "--missed", "all")
        row = await _put(robotctl, "Bring cup 1 to the hallway", *zone)
        assert row["status"]["parts"] == ["g.1"]
        process.kill()
        await process.start()
        taken = await robotctl.soon("goal", "add", "Bring cup 1 to the kitchen", "--id", "g.1")
        assert "there is a goal 'g.1' already, a part of g; use another --id" in taken.err
        (paused,) = await of("pause", "g", "--why", "holidays")
        await value(session, SCHEDULE_STATUS, ScheduleAddress("g"), state=ScheduleState.PAUSED)
        (listed,) = await of("list")
        status = listed["status"]
        assert (status["runs"], status["latest"], status["every"]) == (1, "g.1", "PT2H")
        assert (listed["holds"], listed["spec"]["missed"]) == ([paused], "all")
        runs = [run["at_s"] for run in await of("next", "g", "-n", "2")]
        assert runs == [status["next_s"], status["next_s"] + 7200.0]
        assert [hold["hold"] for hold in await of("resume", "g")] == [paused["hold"]]
        assert (await of("delete", "g", "--with-runs"))["taken_back"] == {"g": ["g.1"]}
        assert await session.list(GOAL_STATUS) == {}
        assert await session.list(SCHEDULE_STATUS) == {}
        text, beyond_calendars = "Bring cup 1 to the kitchen", "P3650000D"
        done = await robotctl.soon("goal", "add", text, "--every", beyond_calendars, "--id", "o")
        assert done.code == 0
        await value(session, GOAL_STATUS, GoalAddress("o"), state=GoalState.REACHED)
        assert (await of("delete", "o", "--with-runs"))["deleted"] == ["o"]
        assert await session.get(GOAL_STATUS, GoalAddress("o")) is None


async def test_a_text_can_be_several_goals(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    async with person(router.endpoint, cups=2) as session, planner(router.endpoint, tmp_path / "d"):
        text = "Bring cup 1 to the hallway. In two hours, bring cup 2 to the hallway"
        row = await _put(robotctl, text, "--plan")
        assert row["status"]["parts"] == ["g.1", "g.2"]
        assert (await _an_order(session)).robot == "hsr"
        second = await value(session, GOAL_STATUS, GoalAddress("g.2"), state=GoalState.PENDING)
        assert second.part_of == "g"


async def test_who_cannot_do_it_is_said(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    async with person(router.endpoint) as session, planner(router.endpoint, tmp_path / "d"):
        await _put(robotctl, "Bring cup 1 to the hallway", "--by", "hsr", "--plan")
        assert (await _an_order(session)).robot == "hsr"
        refused = await robotctl.soon(
            *("goal", "add", "Bring cup 1 to the kitchen", "--by", "marvin")
        )
        assert refused.code == 1
        assert "'marvin', who shall do it, is no robot; known are hsr" in refused.err
