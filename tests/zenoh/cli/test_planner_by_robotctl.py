"""A real planner, by robotctl: approval, goals planned at once or unasked, the fleet's time."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from keyexpr_schema.keyspace import (
    FACT,
    PLAN_STATUS,
    SIM_CLOCK,
    SIM_SCENE,
)
from keyexpr_schema.payloads.plans import PlanAddress, PlanState
from keyexpr_schema.payloads.simulation import Scene, SimAddress, SimClock
from keyexpr_schema.payloads.world import FactAddress
from keyexpr_schema.transport.session import Session
from tests.support.planner_process import carry_out, next_order, person, planner
from tests.support.robotctl import Robotctl
from tests.support.router_process import RouterProcess

TEXT = "Bring cup 1 to the hallway"


@pytest.fixture
def robotctl(router: RouterProcess, tmp_path: Path) -> Robotctl:
    return Robotctl(router.endpoint, tmp_path, "test")


@asynccontextmanager
async def fleet(router: RouterProcess, data: Path, *options: str) -> AsyncIterator[Session]:
    """A household with a manipulator that the test plays, and a planner."""
    async with person(router.endpoint) as session, planner(router.endpoint, data, *options):
        yield session


async def test_a_plan_waits_for_approval_if_the_planner_was_told_so(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    async with fleet(router, tmp_path / "planner", "--approval") as session:
        await robotctl.soon("goal", "add", TEXT, "--id", "g")
        await robotctl.soon("plan", "create", "big-dag", "milp", "--id", "p")
        page = (await robotctl.soon("plan", "show", "p")).out
        status = await session.get(PLAN_STATUS, PlanAddress("p"))
        why = (await robotctl.soon("why", "g")).out.splitlines()
        needs = (await robotctl.soon("status", "--needs-me")).out
        as_data = (await robotctl.soon("why", "p/t1", "--json")).data
        early = await robotctl.soon("plan", "start", "p")
        said = await robotctl.soon("--as", "ana@lab", "plan", "approve", "p")
        approved = (await robotctl.soon("plan", "show", "p")).out
        order = await next_order(session, set())
        twice = await robotctl.soon("plan", "approve", "p")
    assert status is not None
    assert status.state is PlanState.PROPOSED
    assert "proposed" in page and "approved" not in page
    assert "approved    by ana@lab\n" in approved
    assert [line.partition(" since ")[0].strip() for line in why[:1]] == ["goal g is planned"]
    assert why[1].startswith("  because plan p (revision 1) is proposed")
    assert why[2].strip() == ("because a person has to approve plan p (`robotctl plan approve p`)")
    assert "plan p waits for approval: 4 tasks for 1 goal (`robotctl plan approve p`)" in needs
    assert [(each["about"], each["state"]) for each in as_data] == [("p/t1", "waiting")]
    assert [each["kind"] for each in as_data[0]["because"]] == ["approval"]
    assert early.code == 1
    assert said.out.strip() == "plan p is running"
    assert order.skill == "navigate"
    assert "only a proposed plan is approved" in twice.err


async def test_waiting_goals_are_planned_unasked_if_the_file_says_so(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = tmp_path / "auto.yaml"
    settings.write_text("planner: {auto_plan: true}")
    monkeypatch.setenv("ROBOTFLEET_CONFIG", str(settings))
    async with fleet(router, tmp_path / "planner") as session:
        added = await robotctl.soon("goal", "add", TEXT, "--id", "g")
        assert (await next_order(session, set())).skill == "navigate"
        # Nobody need ask for a plan, is told to, or hears that it was wrong to ask.
        assert "plan create" not in added.out
        asked = await robotctl.soon("goal", "add", "Send a robot to the hallway", "--plan")
        assert asked.code == 0, asked.err
        assert "is waiting" not in asked.out.splitlines()[-1]


async def test_a_goal_is_planned_and_waited_for_in_one_command(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    async with fleet(router, tmp_path / "planner") as session:
        waiting = asyncio.create_task(
            robotctl.soon("goal", "add", TEXT, "--id", "g", "--plan", "--wait")
        )
        done: set[str] = set()
        while len(done) < 4:
            order = await next_order(session, done)
            done.add(order.task)
            await carry_out(session, order)
        said = await waiting
        page = (await robotctl.soon("goal", "show", "g")).out
        idle = (await robotctl.soon("plan", "show", "--analyze-idle")).out
        data = (await robotctl.soon("plan", "show", "--analyze-idle", "--json")).data
    assert said.code == 0, said.err
    first, second, last = said.out.strip().splitlines()
    assert first == "goal g is waiting, understood as at(cup_1) = hallway (cup 1 is in the hallway)"
    assert second == "plan plan-1 has 4 tasks for 1 goal"
    assert last == "goal g is reached, understood as at(cup_1) = hallway (cup 1 is in the hallway)"
    assert "understood  at(cup_1) = hallway" in page
    assert "Idle time" in idle and "hsr" in idle.partition("Idle time")[2]
    assert data["idle"]["fleet"] == ["hsr"]
    assert data["idle"]["unit_predicted"] == {"makespan": 4.0, "idle": {"hsr": 0.0}, "mean": 0.0}
    assert data["idle"]["measured"] is None  # the hsr of this test tells no times
    assert data["idle"]["predicted"]["makespan"] == data["status"]["predicted_makespan_s"]


async def test_the_page_of_a_plan_and_its_graph(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    async with fleet(router, tmp_path / "planner"):
        await robotctl.soon("goal", "add", TEXT, "--id", "g", "--plan")
        page = (await robotctl.soon("plan", "show")).out
        dot = (await robotctl.soon("plan", "show", "plan-1", "--dot")).out
        both = await robotctl.soon("plan", "show", "plan-1", "--dot", "--json")
        llm = await robotctl.soon("plan", "create", "big-dag", "milp", "g", "--planner", "llm")
    assert "made by     symbolic" in page
    assert "predicted" in page
    assert "· t2 pick(object=cup_1, place=kitchen) hsr" in " ".join(page.split())
    assert dot.startswith('digraph "plan-1" {')
    assert '"t1" -> "t2";' in dot
    assert "choose one" in both.err
    assert "already in plan plan-1" in llm.err


async def test_facts_of_people_carry_the_fleets_time(
    router: RouterProcess, robotctl: Robotctl
) -> None:
    async with person(router.endpoint) as session:
        address = FactAddress("cup_1", "at")
        await robotctl.soon("world", "add", "--fact", "at", "cup_1", "hallway")
        by_the_wall = await session.get(FACT, address)
        scene = Scene(world="home", bodies=(), fixed={})
        await session.confirm(SIM_SCENE, SimAddress(), scene)

        async def tick() -> None:
            while True:
                session.put(
                    SIM_CLOCK, SimAddress(), SimClock(time_s=12.5, wall_time_s=1.0, speed=1.0)
                )
                await asyncio.sleep(0.05)

        ticking = asyncio.create_task(tick())
        await robotctl.soon("world", "add", "--fact", "at", "cup_1", "kitchen")
        ticking.cancel()
        simulated = await session.get(FACT, address)
    assert by_the_wall is not None
    assert by_the_wall.time_s > 1.7e9
    assert simulated is not None
    assert simulated.time_s == 12.5
