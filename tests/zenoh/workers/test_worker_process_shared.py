"""One process before several robots: what happens to one of them does not happen to the others."""

from __future__ import annotations

import asyncio
import signal
import sqlite3
import subprocess
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from cli.client.presence import robots_alive
from keyexpr_schema.keyspace import ROBOT_SPEC
from keyexpr_schema.payloads.robots import RobotAddress
from keyexpr_schema.payloads.tasks import ReportState
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from sim.files.mission_file import load_mission
from tests.support.held_world import held_world
from tests.support.polling import until
from tests.support.router_process import RouterProcess
from tests.support.worker_processes import Processes, kill, line, ready_line
from tests.support.worker_world import DEADLINE_S, Planner

STUMBLING = """
import sys
from pathlib import Path
from sim.embodiment import sim_embodiment
from workers import run_workers

falls = ["the first time"]

def factory(session, spec, incarnation):
    if spec.robot == "locobot" and falls:
        raise RuntimeError(f"no driver {falls.pop()}")
    return sim_embodiment(session, spec, incarnation)

endpoint, data, *robots = sys.argv[1:]
run_workers({robot: Path(data) for robot in robots}, (endpoint,), "robotfleet", factory)
"""


@pytest.fixture
def processes(router: RouterProcess, tmp_path: Path) -> Iterator[Processes]:
    started = Processes(router, tmp_path / "workers")
    try:
        yield started
    finally:
        started.end()


async def ready(process: subprocess.Popen[str], robots: int = 1) -> list[str]:
    """Waits until so many robots are served; their names, sorted."""
    said = [await ready_line(process) for _ in range(robots)]
    if not all(said):  # it ended
        assert process.stderr is not None
        pytest.fail(await asyncio.to_thread(process.stderr.read))
    assert all(" ready (incarnation " in each for each in said), said
    return sorted(each.split()[1] for each in said)


async def registered(session: Session) -> Planner:
    planner = Planner(session, load_mission("two-cups"))
    await planner.register()
    return planner


async def drive(planner: Planner, robot: str, task: str, to: str) -> None:
    report = await planner.report(await planner.order(robot, task, "navigate", to=to))
    assert report.state is ReportState.SUCCEEDED, report.reason


async def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Exit code, and what was said on stderr."""
    process.send_signal(signal.SIGTERM)
    _, errors = await asyncio.to_thread(process.communicate, timeout=DEADLINE_S)
    return process.returncode, errors


async def test_one_process_serves_two_robots_and_a_kill_interrupts_what_both_did(
    processes: Processes, session_config: Callable[..., SessionConfig]
) -> None:
    async with (
        held_world(session_config) as world,
        open_session(session_config(component="test")) as session,
    ):
        planner = await registered(session)
        first = processes.workers("hsr", "locobot")
        assert await ready(first, 2) == ["hsr", "locobot"]
        world.stands = True  # nobody arrives
        orders = [
            await planner.order("hsr", "t1", "navigate", to="kitchen"),
            await planner.order("locobot", "t2", "navigate", to="kitchen"),
        ]
        for order in orders:
            await planner.report(order, ReportState.STARTED)
        await kill(first)
        world.let_go()
        # The same files: each robot may have a process of its own now.
        both = [processes.worker(robot, after_a_kill=True) for robot in ("hsr", "locobot")]
        for process in both:
            await ready(process)
        for order in orders:
            assert (await planner.report(order)).state is ReportState.INTERRUPTED
        assert [code for code, _ in [await ended(process) for process in both]] == [0, 0]


async def test_a_robot_whose_journal_is_held_is_served_when_it_is_free(
    processes: Processes, session_config: Callable[..., SessionConfig]
) -> None:
    processes.sim(speed=10.0)
    processes.data_dir.mkdir(parents=True)
    async with open_session(session_config(component="test")) as session:
        planner = await registered(session)
        with closing(sqlite3.connect(processes.data_dir / "locobot.journal")) as holder:
            holder.execute("PRAGMA journal_mode=WAL")
            holder.execute("BEGIN EXCLUSIVE")
            workers = processes.workers("hsr", "locobot")
            assert await ready(workers) == ["hsr"]
            await drive(planner, "hsr", "t1", "kitchen")
        assert await ready(workers) == ["locobot"]
        await drive(planner, "locobot", "t2", "kitchen")
        code, errors = await ended(workers)
        assert code == 0, errors
        assert "locobot: ERROR: " in errors and "is in use: another worker runs" in errors
        assert "Traceback" not in errors


async def test_a_robot_that_cannot_be_served_shows_in_the_exit_code(
    processes: Processes, session_config: Callable[..., SessionConfig]
) -> None:
    processes.sim(speed=10.0)
    processes.data_dir.mkdir(parents=True)
    (processes.data_dir / "locobot.journal").write_bytes(b"no journal, " * 400)
    async with open_session(session_config(component="test")) as session:
        planner = await registered(session)
        workers = processes.workers("locobot", "hsr")
        assert await ready(workers) == ["hsr"]
        await drive(planner, "hsr", "t1", "kitchen")
        code, errors = await ended(workers)
        assert code == 1
        assert "1 of 2 robots were not served: locobot: " in errors
        assert errors.count("is not an order journal") == 2
        assert "Traceback" not in errors


async def test_a_driver_that_cannot_be_made_is_tried_again(
    processes: Processes, session_config: Callable[..., SessionConfig]
) -> None:
    processes.sim(speed=10.0)
    async with open_session(session_config(component="test")) as session:
        planner = await registered(session)
        workers = processes.workers("locobot", "hsr", program=STUMBLING)
        assert await ready(workers, 2) == ["hsr", "locobot"]
        await drive(planner, "locobot", "t1", "kitchen")
        code, errors = await ended(workers)
        assert code == 0, errors
        assert "locobot: ERROR: RuntimeError: no driver the first time" in errors


async def test_a_robot_is_named_once(processes: Processes) -> None:
    workers = processes.workers("hsr", "hsr")
    _, errors = await asyncio.to_thread(workers.communicate, timeout=DEADLINE_S)
    assert workers.returncode != 0
    assert "hsr is named twice: a robot has one worker" in errors


async def test_who_is_registered_later_has_a_worker_until_it_is_unregistered(
    processes: Processes, session_config: Callable[..., SessionConfig]
) -> None:
    processes.sim(speed=10.0)
    async with open_session(session_config(component="test")) as session:
        workers = processes.workers("--all", "--follow")
        planner = await registered(session)
        assert await ready(workers, 2) == ["hsr", "locobot"]
        await drive(planner, "locobot", "t1", "kitchen")
        address = RobotAddress("locobot")
        spec = await session.get(ROBOT_SPEC, address)
        assert spec is not None
        # What it has begun it ends.
        begun = await planner.order("locobot", "t2", "navigate", to="hallway")
        await planner.report(begun, ReportState.STARTED)
        await session.delete(ROBOT_SPEC, address)
        assert (await planner.report(begun)).state is ReportState.SUCCEEDED
        assert await line(workers) == "worker locobot leaves: the robot is not registered any more"

        async def gone() -> bool:
            return await robots_alive(session) == {"hsr"}

        await until(gone, "the token of the one that has left to go")
        await session.confirm(ROBOT_SPEC, address, spec)
        assert await ready(workers) == ["locobot"]
        await drive(planner, "locobot", "t3", "kitchen")
        await drive(planner, "hsr", "t4", "kitchen")
    code, errors = await ended(workers)
    assert code == 0 and "ERROR" not in errors and "Traceback" not in errors, errors
