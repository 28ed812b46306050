"""Who gets a lease of a planner, and that it fits with how long a robot is waited for."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import pytest

from fleet.errors import BadLease
from fleet.service import leases
from fleet.service.leases import Leases, check_lease
from keyexpr_schema.errors import NoReply
from keyexpr_schema.keyspace import LEASE, PLANNER_STATUS, ROBOT_ALIVE
from keyexpr_schema.payloads.leases import LeaseQuery
from keyexpr_schema.payloads.robots import AliveAddress
from keyexpr_schema.payloads.system import PlannerAddress, PlannerStatus
from keyexpr_schema.transport.session import Session, open_session
from tests.support.planner_process import planner
from tests.support.polling import until
from tests.support.robotctl import Robotctl
from tests.support.router_process import RouterProcess

LENGTH_S = 7.0


async def granted(session: Session, **robots: str) -> dict[str, float]:
    with suppress(NoReply):
        asked = LeaseQuery(robots=robots)
        return dict((await session.query(LEASE, PlannerAddress(), asked)).granted)
    return {}


async def test_a_run_that_is_connected_gets_a_lease_and_no_other(
    router: RouterProcess, tmp_path: Path, session_config
) -> None:
    async with (
        planner(router.endpoint, tmp_path, "--lease", f"{LENGTH_S:g}"),
        open_session(session_config(realm="test")) as session,
    ):
        async with open_session(session_config(realm="test")) as robot:
            async with robot.token(ROBOT_ALIVE, AliveAddress("hsr", "run-1")):
                given = await until(lambda: granted(session, hsr="run-1"), "a lease")
                assert given == {"hsr": LENGTH_S}
                assert await granted(session, hsr="run-0", locobot="run-1") == {}
            await until(lambda: none(session), "no lease for one that is gone")


async def none(session: Session) -> bool:
    return not await granted(session, hsr="run-1")


@asynccontextmanager
async def giving(session: Session, incarnation: str) -> AsyncIterator[Leases]:
    """Leases of a planner, served, for a robot that is seen as connected."""
    given = Leases(session, incarnation, LENGTH_S, not_said=lambda: None)
    given.seen("hsr", "run-1", alive=True)
    keeping = asyncio.create_task(given.keep_charge())
    try:
        async with session.serve(LEASE, given.give):
            yield given
    finally:
        keeping.cancel()
        await asyncio.gather(keeping, return_exceptions=True)


async def test_a_planner_that_cannot_say_that_it_is_in_charge_gives_none(
    router: RouterProcess, session_config, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(leases, "CHARGE_S", 0.5)
    monkeypatch.setattr(leases, "ASK_S", 0.05)
    async with open_session(session_config()) as session, giving(session, "planner-1") as given:
        asked = LeaseQuery(robots={"hsr": "run-1"})

        async def gives() -> bool:
            return bool((await given.give(PlannerAddress(), asked)).granted)

        async def gives_none() -> bool:
            return not await gives()

        assert not await gives()
        for incarnation, expected in (("planner-1", gives), ("planner-2", gives_none)):
            status = PlannerStatus(epoch=1, incarnation=incarnation)
            await session.confirm(PLANNER_STATUS, PlannerAddress(), status)
            await until(expected)
        status = PlannerStatus(epoch=2, incarnation="planner-1")
        await session.confirm(PLANNER_STATUS, PlannerAddress(), status)
        await until(gives)
        router.kill()
        await until(gives_none)


def test_a_lease_is_over_before_a_robot_is_lost() -> None:
    check_lease(leases.LEASE_S, 30.0)
    check_lease(0.0, 0.5)
    with pytest.raises(BadLease, match=r"at rest after 20 s; give a lease of 3 s at most, or at l"):
        check_lease(8.0, 15.0)
    with pytest.raises(BadLease, match=r"at rest after 20 s; give at least 20 s for lost-after"):
        check_lease(8.0, 1.0)


def test_a_planner_refuses_a_lease_that_does_not_fit(tmp_path: Path) -> None:
    said = Robotctl("tcp/127.0.0.1:1", tmp_path)("planner", "--lost-after", "10")
    assert said.code == 1
    assert said.err.startswith("Error: a robot that is lost after 10 s may still move")
    assert said.err.count("\n") == 1
