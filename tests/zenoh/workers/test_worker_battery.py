"""A worker tells how full its robot's battery is, and charges it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from msgspec.structs import replace

from keyexpr_schema.facts import CHARGE
from keyexpr_schema.keyspace import ROBOT_STATE
from keyexpr_schema.payloads.robots import Battery, RobotAddress, charge_step
from keyexpr_schema.payloads.tasks import ReportState
from keyexpr_schema.transport.session import SessionConfig
from sim.backend import Backend
from sim.files.mission_file import Mission
from sim.kinematic.backend import KinematicBackend
from tests.support.polling import until
from tests.support.worker_world import running_fleet

SMALL = Battery(capacity_wh=10, idle_w=0.5, driving_w=60, working_w=40, charging_w=60)


async def test_charging_is_told_can_be_cancelled_and_goes_on_until_it_is_full(
    session_config: Callable[..., SessionConfig], tmp_path: Path
) -> None:
    def backend(mission: Mission) -> Backend:
        robots = [(replace(r.spec, battery=SMALL), r.start_m_rad) for r in mission.robots]
        return KinematicBackend(mission.world, robots, step_s=0.05, charge={"locobot": 40.0})

    async with running_fleet(session_config, tmp_path / "workers", backend) as fleet:
        specs = (
            replace(robot, spec=replace(robot.spec, battery=SMALL))
            for robot in fleet.mission.robots
        )
        fleet.mission = replace(fleet.mission, robots=tuple(specs))
        await fleet.register()
        world = fleet.world.backend

        async def told() -> bool:
            """Whether the fact says what is so."""
            fact, percent = await fleet.fact(CHARGE, "locobot"), world.batteries.charge("locobot")
            return fact is not None and percent is not None and fact.value == charge_step(percent)

        async with fleet.worker("locobot"):
            await until(told, "the charge at the start")
            where = {"charger": "charger", "place": "hallway"}
            order = await fleet.order("locobot", "t1", "charge", **where)

            async def charging() -> bool:
                return (world.batteries.charge("locobot") or 0.0) > 45.0

            await until(charging, "charging")
            fleet.world.paused = True  # it is not full before the word has come
            await fleet.order("locobot", "t1", "charge", cancelled=True, **where)
            await until(lambda: not world.is_running("locobot"), "it to leave off")
            fleet.world.paused = False
            report = await fleet.report(order)
            assert report.state is ReportState.CANCELLED
            assert (world.batteries.charge("locobot") or 0.0) < 100.0

            order = await fleet.order("locobot", "t2", "charge", **where)
            report = await fleet.report(order)
            assert report.state is ReportState.SUCCEEDED
            assert {f.relation: f.value for f in report.facts}[CHARGE] == 100
            state = await fleet.session.get(ROBOT_STATE, RobotAddress("locobot"))
            assert state is not None and state.charge is not None and state.charge > 95.0
