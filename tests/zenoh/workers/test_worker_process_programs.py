"""Programs and `kill -9`: one goes on at the call that had not ended, or is told as interrupted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from keyexpr_schema.keyspace import ORDER
from keyexpr_schema.payloads.programs import ProgramEnd
from keyexpr_schema.payloads.tasks import OrderAddress, ReportState
from keyexpr_schema.transport.session import SessionConfig, open_session
from sim.files.mission_file import load_mission
from tests.support.held_world import held_world
from tests.support.router_process import RouterProcess
from tests.support.worker_processes import Processes, kill, ready
from tests.support.worker_world import Planner

BRING = """
navigate(to="kitchen")
pick(object="cup_1", place="kitchen")
held = ask("holding", "hsr")
navigate(to="living_room")
place(object="cup_1", place="living_room")
learn("brought", "cup_1", held)
"""


@pytest.fixture
def processes(router: RouterProcess, tmp_path: Path) -> Iterator[Processes]:
    started = Processes(router, tmp_path / "workers")
    try:
        yield started
    finally:
        started.end()


async def test_a_program_of_a_killed_worker_goes_on_at_the_call_that_had_not_ended(
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
        order = await planner.programmed("hsr", BRING)
        await world.until_on_the_way_with("cup_1")
        on_the_way_s = world.time_s
        await kill(first)
        world.let_go()
        second = processes.worker(after_a_kill=True)
        incarnation = await ready(second)
        report = await planner.report(order)
        assert report.state is ReportState.SUCCEEDED, report.reason
        assert report.incarnation == incarnation != killed
        trace = report.program
        assert trace is not None and trace.end is ProgramEnd.DONE
        names = [call.name for call in trace.calls]
        assert names == ["navigate", "pick", "ask", "navigate", "place", "learn"]
        assert trace.calls[2].ended_s <= on_the_way_s < trace.calls[3].ended_s
        assert report.started_s == trace.calls[0].started_s
        learned = await planner.fact("brought", "cup_1")
        assert learned is not None and learned.value == "cup_1"


async def test_a_program_whose_order_is_gone_when_its_worker_comes_back_is_interrupted(
    processes: Processes, session_config: Callable[..., SessionConfig]
) -> None:
    async with (
        held_world(session_config) as world,
        open_session(session_config(component="test")) as session,
    ):
        planner = Planner(session, load_mission("two-cups"))
        await planner.register()
        first = processes.worker()
        await ready(first)
        order = await planner.programmed("hsr", BRING)
        await world.until_on_the_way_with("cup_1")
        await kill(first)
        world.let_go()
        await session.delete(ORDER, OrderAddress.of(order))
        second = processes.worker(after_a_kill=True)
        await ready(second)
        report = await planner.report(order)
        assert report.state is ReportState.INTERRUPTED
        assert report.program is not None and report.program.end is ProgramEnd.INTERRUPTED
        assert [call.name for call in report.program.calls] == ["navigate", "pick", "ask"]
