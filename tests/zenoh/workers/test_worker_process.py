"""Workers as processes before a simulated world in a process of its own: kill -9 and after."""

from __future__ import annotations

import asyncio
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from keyexpr_schema.facts import NOTHING
from keyexpr_schema.keyspace import ROBOT_STATE
from keyexpr_schema.payloads.robots import RobotActivity
from keyexpr_schema.payloads.tasks import ReportState
from keyexpr_schema.transport.session import SessionConfig, open_session
from sim.files.mission_file import load_mission
from tests.support.child_process import child_process
from tests.support.held_world import held_world
from tests.support.polling import until
from tests.support.router_process import RouterProcess
from tests.support.worker_processes import WORKER, Processes, kill, line, ready
from tests.support.worker_world import DEADLINE_S, Planner


@pytest.fixture
def processes(router: RouterProcess, tmp_path: Path) -> Iterator[Processes]:
    started = Processes(router, tmp_path / "workers")
    try:
        yield started
    finally:
        started.end()


def said(facts: Any) -> dict[tuple[str, str], object]:
    return {(f.relation, f.subject): f.value for f in facts}


async def test_a_worker_killed_with_a_cup_in_its_hand_tells_so_and_begins_nothing_again(
    processes: Processes, session_config: Callable[..., SessionConfig]
) -> None:
    async with (
        held_world(session_config) as world,
        open_session(session_config(component="test")) as session,
    ):
        planner = Planner(session, load_mission("two-cups"))
        await planner.register()
        first = processes.worker()
        killed = await ready(first)
        order = await planner.order("hsr", "t1", "pick", object="cup_1", place="kitchen")
        assert (await planner.report(order)).state is ReportState.SUCCEEDED
        world.stands = True
        order = await planner.order("hsr", "t2", "place", object="cup_1", place="living_room")
        started = await planner.report(order, ReportState.STARTED)
        assert started.incarnation == killed
        await world.until_on_the_way_with("cup_1")
        await kill(first)
        world.let_go()
        second = processes.worker(after_a_kill=True)
        incarnation = await ready(second)
        report = await planner.report(order)
        assert report.state is ReportState.INTERRUPTED and report.incarnation == incarnation
        assert report.retryable and report.tries == ()
        told = said(report.facts)
        assert told["holding", "hsr"] == "cup_1" and told["at", "cup_1"] == "hsr"
        where = told["at", "hsr"]
        held = await planner.fact("holding", "hsr")
        assert held is not None and held.value == "cup_1"
        # The order still stands on its key; the robot stays where it is until it is told more.
        async with session.watch((ROBOT_STATE, {"robot": "hsr"})) as watch:
            async for change in watch:
                assert change.value is None or change.value.task is None
                if change.value is not None and change.value.activity is RobotActivity.IDLE:
                    assert (change.value.place, change.value.holding) == (where, "cup_1")
                    break
        again = await planner.order(
            "hsr", "t2", "place", attempt=2, object="cup_1", place="living_room"
        )
        done = await planner.report(again)
        assert done.state is ReportState.SUCCEEDED, done.reason
        assert said(done.facts)["holding", "hsr"] == NOTHING
        first_attempt = await planner.report(order)
        assert first_attempt == report, "the first attempt was reported on again"


async def test_a_worker_waits_for_its_robot_and_ends_cleanly_when_told(
    processes: Processes, session_config: Callable[..., SessionConfig]
) -> None:
    processes.sim(speed=10.0)
    worker = processes.worker()
    assert await line(worker) == "worker hsr waits: the robot is not registered yet"
    async with open_session(session_config(component="test")) as session:
        planner = Planner(session, load_mission("two-cups"))
        await planner.register()
        await ready(worker)
        order = await planner.order("hsr", "t1", "navigate", to="kitchen")
        await planner.report(order, ReportState.STARTED)
        worker.send_signal(signal.SIGTERM)
        report = await planner.report(order)
        assert report.state is ReportState.INTERRUPTED
        assert report.reason == "the worker of hsr was stopped while it did this"
        assert report.leaving
        _, errors = await asyncio.to_thread(worker.communicate, timeout=DEADLINE_S)
        assert worker.returncode == 0, errors
        assert "Traceback" not in errors


@pytest.mark.parametrize(
    ("data", "why"),
    [
        ("", "another worker runs for this robot with the same data directory"),
        ("elsewhere", "a worker of locobot is connected already (locobot-"),
    ],
)
async def test_a_second_worker_for_a_robot_is_turned_away(
    processes: Processes, session_config: Callable[..., SessionConfig], data: str, why: str
) -> None:
    """Also one that has a journal of its own, as on another host: each order would run twice."""
    processes.sim(speed=10.0)
    async with open_session(session_config(component="test")) as session:
        planner = Planner(session, load_mission("two-cups"))
        await planner.register()
        first = processes.worker("locobot")
        incarnation = await ready(first, "locobot")
        second = processes.worker("locobot", data)
        out, errors = await asyncio.to_thread(second.communicate, timeout=DEADLINE_S)
        assert second.returncode == 1
        assert why in errors
        assert "Traceback" not in errors
        assert "ready" not in out
        assert first.poll() is None
        order = await planner.order("locobot", "t1", "navigate", to="kitchen")
        report = await planner.report(order)
        assert (report.state, report.incarnation) == (ReportState.SUCCEEDED, incarnation)


async def test_of_workers_that_start_at_one_instant_one_stays(
    processes: Processes, session_config: Callable[..., SessionConfig]
) -> None:
    """They all wait for their robot, each with a journal of its own."""
    processes.sim(speed=10.0)
    workers = [processes.worker("locobot", f"host-{n}") for n in range(4)]
    for worker in workers:
        assert "waits" in await line(worker)
    async with open_session(session_config(component="test")) as session:
        planner = Planner(session, load_mission("two-cups"))
        await planner.register()

        async def the_others_have_ended() -> bool:
            return sum(worker.poll() is None for worker in workers) <= 1

        await until(the_others_have_ended, "all but one to end")
        (left,) = [worker for worker in workers if worker.poll() is None]
        incarnation = await ready(left, "locobot")
        order = await planner.order("locobot", "t1", "navigate", to="kitchen")
        report = await planner.report(order)
        assert (report.state, report.incarnation) == (ReportState.SUCCEEDED, incarnation)
    for worker in workers:
        if worker is not left:
            _, errors = await asyncio.to_thread(worker.communicate, timeout=DEADLINE_S)
            assert worker.returncode == 1
            assert "a worker of locobot is connected already (locobot-" in errors
            assert "Traceback" not in errors


async def test_a_worker_without_a_router_says_what_it_waits_for(tmp_path: Path) -> None:
    command = (sys.executable, "-c", WORKER, "tcp/127.0.0.1:9", "hsr", str(tmp_path), "4")
    async with child_process(*command) as worker, asyncio.timeout(DEADLINE_S):
        assert worker.stderr is not None
        said = await worker.stderr.readline()
        assert b"no router answers at tcp/127.0.0.1:9; waiting for one" in said
