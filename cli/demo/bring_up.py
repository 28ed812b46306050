"""Starts the processes of a mission and waits until each shows that it is ready."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cli.client.fleet_view import FleetView
from cli.client.planner_requests import check_skills
from cli.client.world import put_world
from cli.demo.child_processes import ChildProcesses
from cli.errors import TooLate
from keyexpr_schema.errors import NoReply, Unreachable
from keyexpr_schema.facts import AT, HOLDING, FactKey
from keyexpr_schema.key import Key
from keyexpr_schema.keyspace import PLANNER_ALIVE, ROBOT_ALIVE, ROBOT_SPEC, STORE_JOURNAL
from keyexpr_schema.payloads.robots import RobotAddress
from keyexpr_schema.payloads.system import StoreAddress, StoreQuery
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from sim.files.world_payloads import object_payloads, place_payloads

if TYPE_CHECKING:
    from sim.files.mission_file import Mission

READY_S = 60.0
"""How long a process may take until it shows that it is there; a busy machine starts slowly."""
RECORDING = "recording.rrd"


@dataclass(frozen=True)
class DemoOptions:
    """`speed` is simulated seconds a second, or `max`; `timeout_s` bounds the plan's execution.

    All workers are one process, which starts sooner and costs less, or are `apart`, so that one can
    go down without the others.
    """

    mission: str
    out: Path
    backend: str = "mujoco"
    speed: str = "max"
    view: bool = False
    timeout_s: float = 600.0
    apart: bool = False
    programs: bool = False
    """Whether the plan is carried out as programs."""

    def worker_process(self, robot: str) -> str:
        """The name of the process that is a robot's worker."""
        return f"worker-{robot}" if self.apart else "workers"


def declare_processes(processes: ChildProcesses, mission: Mission, options: DemoOptions) -> None:
    """Say which processes a mission is made of, and which are stopped first at its end."""
    data = options.out / "data"
    listen = ("--listen", processes.endpoint)
    processes.declare("router", "router", *listen, "--data", str(data / "router"))
    view = ("--view",) if options.view else ()
    processes.declare("record", "record", str(options.out / RECORDING), *view, layer=1)
    pace = ("--backend", options.backend, "--speed", options.speed)
    processes.declare("sim", "sim", options.mission, *pace, layer=2)
    processes.declare("planner", "planner", "--data", str(data / "planner"), layer=2)
    robots = tuple(robot.spec.robot for robot in mission.robots)
    for group in ((robot,) for robot in robots) if options.apart else (robots,):
        name = options.worker_process(group[0])
        processes.declare(name, "worker", *group, "--data", str(data / name), layer=2)


async def router_up(processes: ChildProcesses) -> None:
    """Wait until the router's store answers for its journal."""
    config = SessionConfig(
        endpoints=(processes.endpoint,),
        realm=processes.realm,
        component="robotctl",
        connect_timeout_s=READY_S,
    )
    try:
        async with asyncio.timeout(READY_S), open_session(config) as session:
            while True:
                try:
                    await session.query(STORE_JOURNAL, StoreAddress(), StoreQuery(limit=1), 1.0)
                    return
                except NoReply:
                    await session.wait_connected()
    except (TimeoutError, Unreachable):
        raise TooLate(
            f"the router was not ready after {READY_S:g} s; its log is {processes.log('router')}"
        ) from None


async def bring_up(
    processes: ChildProcesses,
    session: Session,
    view: FleetView,
    mission: Mission,
    options: DemoOptions,
) -> None:
    """Store the world and the robots, start the rest, wait until all are ready."""
    await put_world(session, place_payloads(mission.world), object_payloads(mission.world))
    for robot in mission.robots:
        await session.confirm(ROBOT_SPEC, RobotAddress(robot.spec.robot), robot.spec)
    for name in processes.names:
        if processes.pid(name) is None:
            await processes.start(name)
    ready = [
        view.until(
            lambda: view.scene is not None and bool(view.truths),
            READY_S,
            f"the simulation (log: {processes.log('sim')})",
        ),
        _token(session, PLANNER_ALIVE, {}, "the planner", processes.log("planner")),
        _recording(processes),
    ]
    for name in (robot.spec.robot for robot in mission.robots):
        log = processes.log(options.worker_process(name))
        ready += [
            _token(session, ROBOT_ALIVE, {"robot": name}, f"the worker of {name}", log),
            view.until(
                partial(_can_be_planned, view, name),
                READY_S,
                f"{name} to say where it is and what it holds (log: {log})",
            ),
        ]
    await asyncio.gather(*ready)
    await check_skills(session, (robot.spec for robot in mission.robots))


def _can_be_planned(view: FleetView, robot: str) -> bool:
    """Whether a planner knows where the robot is and what it holds: else it can do nothing."""
    return all(FactKey(relation, robot) in view.facts for relation in (AT, HOLDING))


async def _token(
    session: Session, key: Key[Any, Any], fixed: dict[str, str], who: str, log: Path
) -> None:
    try:
        async with asyncio.timeout(READY_S), session.watch_tokens(key, 0.5, **fixed) as watch:
            async for change in watch:
                if change.alive:
                    return
    except TimeoutError:
        raise TooLate(f"{who} was not ready after {READY_S:g} s; its log is {log}") from None


async def _recording(processes: ChildProcesses) -> None:
    """Wait until the recorder says in its log that it records: it has no key of its own."""
    log = processes.log("record")
    try:
        async with asyncio.timeout(READY_S):
            # A file cannot be awaited, so it is looked at until it says so.
            while b"recording to" not in log.read_bytes():  # noqa: ASYNC110
                await asyncio.sleep(0.05)
    except TimeoutError:
        raise TooLate(f"the recorder was not ready after {READY_S:g} s; its log is {log}") from None
