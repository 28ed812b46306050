"""The example of a skill of one's own: its worker as a process, in front of a served world."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable
from pathlib import Path

from msgspec.structs import replace

from keyexpr_schema.keyspace import ROBOT_SPEC
from keyexpr_schema.payloads.robots import RobotAddress
from keyexpr_schema.payloads.tasks import ReportState
from keyexpr_schema.transport.session import SessionConfig, open_session
from sim.files.mission_file import load_mission
from sim.kinematic.backend import KinematicBackend
from sim.server.sim_server import SimServer
from tests.support.child_process import child_process
from tests.support.router_process import RouterProcess
from tests.support.worker_world import DEADLINE_S, Planner

EXAMPLE = Path(__file__).parents[3] / "examples" / "custom_skill.py"


async def test_the_example_counts_two_cups_in_the_kitchen(
    session_config: Callable[..., SessionConfig], router: RouterProcess, tmp_path: Path
) -> None:
    mission = load_mission("two-cups")
    robots = [(r.spec, r.start_m_rad) for r in mission.robots]
    async with open_session(session_config(component="sim")) as session:
        serving = asyncio.create_task(
            SimServer(session, KinematicBackend(mission.world, robots), None).run()
        )
        try:
            planner = Planner(session, mission)
            await planner.register()
            spec = next(r.spec for r in mission.robots if r.spec.robot == "locobot")
            spec = replace(spec, skills=(*spec.skills, "count"))
            await session.confirm(ROBOT_SPEC, RobotAddress("locobot"), spec)
            command = (str(EXAMPLE), "locobot", router.endpoint, str(tmp_path / "data"))
            async with child_process(sys.executable, *command) as worker:
                order = await planner.order("locobot", "t1", "count", place="kitchen")
                report = await planner.report(order)
                assert report.state is ReportState.SUCCEEDED, report.reason
                fact = await planner.fact("count_cup", "kitchen")
                assert fact is not None and fact.value == 2 and fact.source == "locobot"
                worker.terminate()
                out, err = await asyncio.wait_for(worker.communicate(), DEADLINE_S)
                assert worker.returncode == 0, err
                assert out.startswith(b"worker locobot ready")
                assert b"sees 2 of kind cup in kitchen" in err
        finally:
            serving.cancel()
            await asyncio.gather(serving, return_exceptions=True)


async def test_without_words_it_says_how_it_is_called() -> None:
    async with child_process(sys.executable, str(EXAMPLE)) as process:
        _, err = await asyncio.wait_for(process.communicate(), DEADLINE_S)
    assert process.returncode == 1 and b"examples/custom_skill.py locobot" in err
