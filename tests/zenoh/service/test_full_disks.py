"""Real disks without room, of the planner and of the router: what is said, and what goes on."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from fleet.service import planner_process, router_process
from fleet.service.router_process import with_port
from keyexpr_schema.keyspace import GOAL_STATUS, PLACE
from keyexpr_schema.payloads.goals import GoalAddress, GoalState
from tests.support.child_process import child_process
from tests.support.full_disk import SmallDisk, no_room
from tests.support.planner_process import person, value, want
from tests.support.polling import DEADLINE_S, until
from tests.support.robotctl import Robotctl


@pytest.mark.slow
async def test_a_fleet_whose_disks_are_full_says_so_and_goes_on_when_there_is_room(
    tmp_path: Path,
) -> None:
    endpoint = with_port("tcp/127.0.0.1:0")
    robotctl = Robotctl(endpoint, tmp_path, "test")
    cli = (sys.executable, "-m", "cli.main")
    of_router, of_planner = SmallDisk(tmp_path / "router"), SmallDisk(tmp_path / "planner")
    router_command = of_router.command(
        *cli, "router", "--listen", endpoint, "--data", str(of_router.folder)
    )
    planner_command = of_planner.command(
        *cli, "planner", "--router", endpoint, "--realm", "test", "--data", str(of_planner.folder)
    )
    async with child_process(*router_command) as router, child_process(*planner_command) as planner:
        async with asyncio.timeout(DEADLINE_S):
            for process in (router, planner):
                assert process.stdout is not None
                await process.stdout.readline()
        async with person(endpoint) as session:
            known = await session.list(PLACE)
            of_planner.fill(planner.pid)
            await want(session, "Bring cup 1 to the hallway")
            needs = await until(
                lambda: _diagnosed(robotctl, "planner: the planner cannot write to"), "the planner"
            )
            why = (await robotctl.soon("why", "g")).out
            of_planner.free(planner.pid)
            await value(session, GOAL_STATUS, GoalAddress("g"), state=GoalState.WAITING)

            of_router.fill(router.pid)
            said = await robotctl.soon("world", "add", "The first cup is in the kitchen.")
            failing = (await session.store_troubles()).failing
            page = (await robotctl.soon("status")).out
            of_router.free(router.pid)
            again = await robotctl.soon("world", "add", "The first cup is in the kitchen.")
            assert await session.list(PLACE) == known
            assert (await session.store_troubles()).failing is None
        router.terminate()
        planner.terminate()
        async with asyncio.timeout(DEADLINE_S):
            (_, from_router), (_, from_planner) = await asyncio.gather(
                router.communicate(), planner.communicate()
            )
    assert f"to {of_planner.folder} (database or disk is full): nothing new is planned" in needs
    assert "goal g has been read by no planner yet" in why and "because planner: the planner" in why
    assert said.code == 1
    assert "was not written: the store could not write: database or disk is full; free" in said.err
    assert failing == "the store could not write: database or disk is full"
    assert "router: the store could not write" in " ".join(page.split())
    assert again.code == 0, again.err
    assert from_router.decode().splitlines() == [
        "the store could not write: database or disk is full; nothing is confirmed until it can",
        "the store can write again",
    ]
    assert b"the planner can write to" in from_planner and b"Traceback" not in from_planner


@pytest.mark.parametrize(
    "start",
    [
        lambda folder: router_process.run(("tcp/127.0.0.1:0",), (), folder),
        lambda folder: planner_process.run(("tcp/127.0.0.1:1",), "test", folder),
    ],
    ids=["router", "planner"],
)
def test_what_is_started_on_a_full_disk_says_where_and_ends(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], start: Callable[[Path], None]
) -> None:
    with no_room(), pytest.raises(SystemExit) as ended:
        start(tmp_path / "data")
    assert ended.value.code == 1
    said = capsys.readouterr().err.strip()
    assert said.startswith(
        f"Error: the {'store' if 'sqlite' in said else 'journal'} {tmp_path}/data/"
    )
    assert said.endswith("free some room there, and try again") and "\n" not in said


async def _diagnosed(robotctl: Robotctl, words: str) -> str | None:
    page = " ".join((await robotctl.soon("status")).out.split())
    return page if words in page else None
