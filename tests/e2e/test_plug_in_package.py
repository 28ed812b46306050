"""The template of a plug-in package: built, installed, and used by a real planner and worker."""

from __future__ import annotations

import asyncio
import shutil
import subprocess
import sys
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from keyexpr_schema.keyspace import (
    ANSWER,
    FACT,
    GOAL_SPEC,
    GOAL_STATUS,
    OBJECT,
    PLACE,
    PLAN_REQUEST,
    PLAN_SPEC,
    PLAN_STATUS,
    ROBOT_SPEC,
)
from keyexpr_schema.payloads.goals import Goal, GoalAddress, GoalState
from keyexpr_schema.payloads.plans import PlanAddress, PlanState
from keyexpr_schema.payloads.requests import PlanRequest, RequestAddress
from keyexpr_schema.payloads.robots import RobotAddress, RobotSpec
from keyexpr_schema.payloads.world import FactAddress, ObjectAddress, PlaceAddress
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from tests.support.child_process import child_process
from tests.support.household import PLACES, cup, fact
from tests.support.planner_process import planner, value
from tests.support.polling import DEADLINE_S

EXAMPLE = Path(__file__).parents[2] / "examples" / "stocktaking"
ROBOTS = ("clerk_1", "clerk_2")
ROOMS = ("kitchen", "hallway")


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The package, built from its source and installed where child processes find it."""
    source, site = tmp_path / "stocktaking", tmp_path / "site"
    shutil.copytree(EXAMPLE, source, ignore=shutil.ignore_patterns("__pycache__"))
    offline = ("--no-deps", "--no-build-isolation", "--no-index", "--quiet")
    command = [sys.executable, "-m", "pip", "install", *offline, "--target", str(site), str(source)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    monkeypatch.setenv("PYTHONPATH", str(site))


async def set_up(session: Session) -> None:
    """Rooms, two cups in the kitchen, two robots that can audit."""
    for number, place in enumerate(PLACES):
        region = (4.0 * number, 0.0, 4.0 * number + 4.0, 4.0)
        with_region = replace(place, region_m=(region,))
        await session.confirm(PLACE, PlaceAddress(place.place), with_region)
    for number in (1, 2):
        await session.confirm(OBJECT, ObjectAddress(f"cup_{number}"), cup(number))
        known = fact(f"cup_{number}", "at", "kitchen")
        await session.confirm(FACT, FactAddress.of(known.key), known)
    for robot in ROBOTS:
        spec = RobotSpec(
            robot=robot,
            model="clerk",
            skills=("navigate", "audit"),
            capabilities={"drive": 0.5, "see": 4.0},
        )
        await session.confirm(ROBOT_SPEC, RobotAddress(robot), spec)


@asynccontextmanager
async def worker(robot: str, endpoint: str, data: Path) -> AsyncIterator[None]:
    command = (
        "-m", "cli.main", "worker", robot, "--embodiment", "rehearsal",
        "--data", str(data), "--router", endpoint, "--realm", "test",
    )  # fmt: skip
    async with child_process(sys.executable, *command, stderr=None) as process:
        async with asyncio.timeout(DEADLINE_S):
            assert process.stdout is not None
            assert (await process.stdout.readline()).startswith(f"worker {robot} ready".encode())
        yield
        process.terminate()
        async with asyncio.timeout(DEADLINE_S):
            assert await process.wait() == 0


@pytest.mark.slow
@pytest.mark.e2e
async def test_a_plan_of_its_planner_and_allocator_is_carried_out_by_its_robots(
    installed: None, router: Any, tmp_path: Path
) -> None:
    config = SessionConfig(endpoints=(router.endpoint,), realm="test", component="person")
    async with AsyncExitStack() as stack:
        session = await stack.enter_async_context(open_session(config))
        await set_up(session)
        for robot in ROBOTS:
            await stack.enter_async_context(worker(robot, router.endpoint, tmp_path / robot))
        await stack.enter_async_context(planner(router.endpoint, tmp_path / "planner"))
        for room in ROOMS:
            goal = Goal(goal=room, text=f"Audit the {room}")
            await session.confirm(GOAL_SPEC, GoalAddress(room), goal)
            await value(session, GOAL_STATUS, GoalAddress(room), state=GoalState.WAITING)
        request = PlanRequest(
            request="r", plan="p", goals=ROOMS, planner="rounds", allocator="nearest"
        )
        await session.confirm(PLAN_REQUEST, RequestAddress("r"), request)
        await value(session, ANSWER, RequestAddress("r"), accepted=True)
        status = await value(session, PLAN_STATUS, PlanAddress("p"), state=PlanState.SUCCEEDED)
        assert set(status.allocation.values()) == set(ROBOTS)
        plan = await session.get(PLAN_SPEC, PlanAddress("p"))
        assert plan is not None and (plan.made_by, plan.allocator) == ("rounds", "nearest")
        for room, count in zip(ROOMS, (2, 0), strict=True):
            stock = await session.get(FACT, FactAddress(room, "stock"))
            assert stock is not None and stock.value == count and stock.source in ROBOTS
