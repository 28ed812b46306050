"""Starts the processes of a mission and waits until each shows that it is ready."""

from __future__ import annotations

import asyncio
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cli.board import Board
from cli.demo.fleet import Fleet
from cli.errors import TooLate
from cli.telling import check_skills, put_world
from keyexpr_schema.errors import NoAnswer, Unreachable
from keyexpr_schema.facts import AT, HOLDING, FactKey
from keyexpr_schema.key import Key
from keyexpr_schema.keyspace import PLANNER_ALIVE, ROBOT_ALIVE, ROBOT_SPEC, STORE_JOURNAL
from keyexpr_schema.payloads.robots import RobotAddress
from keyexpr_schema.payloads.service import StoreAddress, StoreQuery
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from sim.files.world_payloads import object_payloads, place_payloads

if TYPE_CHECKING:
    from cli.demo.mission_run import DemoOptions
    from sim.files.mission_file import Mission

READY_S = 60.0
"""How long a process may take until it shows that it is there; a busy machine starts slowly."""
RECORDING = "recording.rrd"


def declare_processes(fleet: Fleet, mission: Mission, options: DemoOptions) -> None:
    """Say which processes a mission is made of, and which are stopped first at its end."""
    data = options.out / "data"
    fleet.declare("router", "router", "--listen", fleet.endpoint, "--data", str(data / "router"))
    view = ("--view",) if options.view else ()
    fleet.declare("record", "record", str(options.out / RECORDING), *view, layer=1)
    fleet.declare(
        "sim",
        "sim",
        options.mission,
        "--backend",
        options.backend,
        "--speed",
        options.speed,
        layer=2,
    )
    fleet.declare("planner", "planner", "--data", str(data / "planner"), layer=2)
    for robot in mission.robots:
        name = f"worker-{robot.spec.robot}"
        fleet.declare(name, "worker", robot.spec.robot, "--data", str(data / name), layer=2)


async def router_up(fleet: Fleet) -> None:
    """Wait until the router's store answers for its journal."""
    config = SessionConfig(
        endpoints=(fleet.endpoint,),
        realm=fleet.realm,
        component="robotctl",
        connect_timeout_s=READY_S,
    )
    try:
        async with asyncio.timeout(READY_S), open_session(config) as session:
            while True:
                try:
                    await session.ask(STORE_JOURNAL, StoreAddress(), StoreQuery(limit=1), 1.0)
                    return
                except NoAnswer:
                    await session.wait_connected()
    except (TimeoutError, Unreachable):
        raise TooLate(
            f"the router was not ready after {READY_S:g} s; its log is {fleet.log('router')}"
        ) from None


async def bring_up(fleet: Fleet, session: Session, board: Board, mission: Mission) -> None:
    """Tell the store of the world and the robots, start the rest, wait until all are ready."""
    await put_world(session, place_payloads(mission.world), object_payloads(mission.world))
    for robot in mission.robots:
        await session.confirm(ROBOT_SPEC, RobotAddress(robot.spec.robot), robot.spec)
    for name in fleet.names:
        if fleet.pid(name) is None:
            await fleet.start(name)
    await asyncio.gather(
        board.until(
            lambda: board.scene is not None and bool(board.truths),
            READY_S,
            f"the simulation (log: {fleet.log('sim')})",
        ),
        _token(session, PLANNER_ALIVE, {}, "the planner", fleet.log("planner")),
        *(
            _token(
                session,
                ROBOT_ALIVE,
                {"robot": robot.spec.robot},
                f"the worker of {robot.spec.robot}",
                fleet.log(f"worker-{robot.spec.robot}"),
            )
            for robot in mission.robots
        ),
        *(
            board.until(
                partial(_can_be_planned, board, robot.spec.robot),
                READY_S,
                f"{robot.spec.robot} to say where it is and what it holds "
                f"(log: {fleet.log(f'worker-{robot.spec.robot}')})",
            )
            for robot in mission.robots
        ),
        _recording(fleet),
    )
    await check_skills(session, (robot.spec for robot in mission.robots))


def _can_be_planned(board: Board, robot: str) -> bool:
    """Whether a planner knows where the robot is and what it holds: else it can do nothing."""
    return all(FactKey(relation, robot) in board.facts for relation in (AT, HOLDING))


async def _token(
    session: Session, key: Key[Any, Any], fixed: dict[str, str], who: str, log: Path
) -> None:
    """Wait until somebody shows the liveliness token."""
    try:
        async with asyncio.timeout(READY_S), session.watch_tokens(key, 0.5, **fixed) as watch:
            async for change in watch:
                if change.alive:
                    return
    except TimeoutError:
        raise TooLate(f"{who} was not ready after {READY_S:g} s; its log is {log}") from None


async def _recording(fleet: Fleet) -> None:
    """Wait until the recorder says in its log that it records: it has no key of its own."""
    log = fleet.log("record")
    try:
        async with asyncio.timeout(READY_S):
            # A file cannot be awaited, so it is looked at until it says so.
            while b"recording to" not in log.read_bytes():  # noqa: ASYNC110
                await asyncio.sleep(0.05)
    except TimeoutError:
        raise TooLate(f"the recorder was not ready after {READY_S:g} s; its log is {log}") from None
