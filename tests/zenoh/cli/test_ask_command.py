"""Questions by robotctl, and goals that ask back, with a real planner."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from keyexpr_schema.keyspace import FACT, ORDER
from keyexpr_schema.payloads.world import FactAddress
from tests.support.household import fact
from tests.support.planner_process import carry_out, next_order, person, planner
from tests.support.robotctl import Robotctl
from tests.support.router_process import RouterProcess


@pytest.fixture
def robotctl(router: RouterProcess, tmp_path: Path) -> Robotctl:
    return Robotctl(router.endpoint, tmp_path, "test")


async def test_questions_are_answered_from_what_is_believed(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    async with person(router.endpoint), planner(router.endpoint, tmp_path / "planner"):
        told = await robotctl.soon("world", "add", "Cup 1 is in the hallway")
        where = await robotctl.soon("ask", "Where is cup 1?")
        data = (await robotctl.soon("ask", "Is cup 1 in the hallway?", "--json")).data
        unclear = await robotctl.soon("ask", "Where is the unicorn?")
    assert told.code == 0, told.err
    assert where.code == 0, where.err
    assert "hallway" in where.out.casefold()
    assert data["holds"] is True
    assert data["facts"][0]["value"] == "hallway"
    assert unclear.code == 1
    assert "unicorn" in unclear.err


async def test_what_nobody_knows_is_looked_for(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    async with person(router.endpoint) as session, planner(router.endpoint, tmp_path / "planner"):
        lost = fact("cup_1", "at", None)
        await session.confirm(FACT, FactAddress.of(lost.key), lost)
        offered = await robotctl.soon("ask", "Where is cup 1?")
        asking = asyncio.create_task(robotctl.soon("ask", "Where is cup 1?", "--look"))
        await next_order(session, set())
        found = fact("cup_1", "at", "hallway", "hsr")
        await session.confirm(FACT, FactAddress.of(found.key), found)
        done: set[str] = set()
        while not asking.done():
            for order in (await session.list(ORDER, robot="hsr")).values():
                if order.task not in done:
                    done.add(order.task)
                    await carry_out(session, order)
            await asyncio.wait([asking], timeout=0.05)
        said = await asking
    assert "nobody knows where cup 1 is" in offered.out
    assert "ask again with --look" in offered.out
    assert said.code == 0, said.err
    assert "cup 1 is in the hallway" in said.out


async def test_without_a_planner_questions_are_not_answered(
    router: RouterProcess, robotctl: Robotctl
) -> None:
    said = await robotctl.soon("ask", "Where is cup 1?")
    assert said.code == 1
    assert "no planner is running" in said.err


async def test_a_goal_that_can_mean_several_things_is_answered(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    async with person(router.endpoint, cups=2), planner(router.endpoint, tmp_path / "planner"):
        asked = await robotctl.soon("goal", "add", "Bring the cup to the hallway", "--id", "g")
        row = (await robotctl.soon("goal", "show", "g", "--json")).data
        none = await robotctl.soon("goal", "answer", "g", "7")
        said = await robotctl.soon("goal", "answer", "g", "2")
        again = await robotctl.soon("goal", "answer", "g", "1")
    first, second = row["status"]["candidates"]
    assert asked.code == 1
    assert "cup_1" in asked.err
    assert f"`robotctl goal answer g NUMBER`: 1 ({first}); 2 ({second})" in asked.err
    assert none.code != 0
    assert first in none.err
    assert second in none.err
    assert said.code == 0, said.err
    assert second in said.out
    assert "does not ask anything" in again.err
