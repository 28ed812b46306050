"""Starts the processes of a fleet and waits until each shows that it is ready."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from functools import partial
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from cli.client.fleet_view import FleetView
from cli.client.planner_requests import check_skills
from cli.client.world import put_world
from cli.errors import TooLate
from cli.processes.child_processes import ChildProcesses
from cli.processes.composition import PLANNER, RECORDER, SIM, Composition
from keyexpr_schema.errors import NoReply, Unreachable
from keyexpr_schema.facts import AT, HOLDING, FactKey
from keyexpr_schema.key import Key
from keyexpr_schema.keyspace import PLANNER_ALIVE, ROBOT_ALIVE, ROBOT_SPEC, STORE_JOURNAL
from keyexpr_schema.payloads.robots import RobotAddress
from keyexpr_schema.payloads.system import StoreAddress, StoreQuery
from keyexpr_schema.transport.session import Session, open_session
from sim.files.world_payloads import object_payloads, place_payloads, region_payloads

READY_S = 180.0
"""How long a process may take until it shows that it is there; a busy machine starts slowly."""


async def router_up(processes: ChildProcesses) -> None:
    """Wait until the router's store answers for its journal."""
    config = processes.session_config(READY_S)
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
    processes: ChildProcesses, session: Session, view: FleetView, fleet: Composition, by: str = ""
) -> None:
    """Store the world and the robots, start what does not run yet, wait until all are ready.

    Robots that nobody has registered before are registered `by` this person.

    Robots outside a simulated world need not be: one that is switched off now is not waited for.
    """
    if fleet.world is not None:
        world = fleet.world.mission.world
        told = place_payloads(world), object_payloads(world), region_payloads(world)
        await put_world(session, *told, by=by)
    known = await session.list(ROBOT_SPEC)
    for spec in fleet.robots:
        address = RobotAddress(spec.robot)
        if spec != known.get(address):  # else it is as somebody has registered it
            await session.confirm(ROBOT_SPEC, address, replace(spec, by=by))
    fleet.declare(processes)
    for name in processes.names:
        if processes.pid(name) is None:
            await processes.start(name)
    ready = [_token(session, PLANNER_ALIVE, {}, "the planner", processes.log(PLANNER))]
    if fleet.recording is not None:
        ready.append(_recording(processes))
    if fleet.world is not None:
        ready += _in_the_world(processes, session, view, fleet)
    await asyncio.gather(*ready)
    await check_skills(session, fleet.robots)


def _in_the_world(
    processes: ChildProcesses, session: Session, view: FleetView, fleet: Composition
) -> list[Coroutine[Any, Any, None]]:
    """What to wait for until a simulated world is there, and every robot is awake in it."""
    ready = [
        view.until(
            lambda: view.scene is not None and bool(view.truths),
            READY_S,
            f"the simulation (log: {processes.log(SIM)})",
        )
    ]
    for name in fleet.names:
        log = processes.log(fleet.worker_process(name))
        ready += [
            _token(session, ROBOT_ALIVE, {"robot": name}, f"the worker of {name}", log),
            view.until(
                partial(_can_be_planned, view, name),
                READY_S,
                f"{name} to say where it is and what it holds (log: {log})",
            ),
        ]
    return ready


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
    log = processes.log(RECORDER)
    try:
        async with asyncio.timeout(READY_S):
            # A file cannot be awaited, so it is looked at until it says so.
            while b"recording to" not in log.read_bytes():  # noqa: ASYNC110
                await asyncio.sleep(0.05)
    except TimeoutError:
        raise TooLate(f"the recorder was not ready after {READY_S:g} s; its log is {log}") from None
