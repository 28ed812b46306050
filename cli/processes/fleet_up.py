"""A fleet on this machine, from its first process until somebody ends it: `robotctl up`."""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from cli.client.fleet_view import FLEET_KEYS, SIMULATION_KEYS, fleet_view
from cli.client.publish import put_statement
from cli.processes.bring_up import bring_up, router_up
from cli.processes.child_processes import ChildProcesses
from cli.processes.composition import ROUTER, SIM, Composition, worker_of
from cli.processes.identity import ProcessId
from cli.processes.log_files import cut
from cli.processes.supervision import Supervision
from cli.processes.up_state import Child, UpState, write_state
from keyexpr_schema.keyspace import ROBOT_SPEC
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.transport.session import Session, open_session

if TYPE_CHECKING:
    from sim.files.mission_file import Mission

CUT_S = 60.0
VITAL = {SIM: "it was the world, and what was in it is gone; so the fleet ends"}


@dataclass
class FleetUp:
    """One `robotctl up`. `state` is where others read of it, `folder` where its logs are.

    `compose` makes the fleet of the robots that are registered in the store already. `admit`, of a
    fleet with certificates, certifies robots and says whether the router has to be started again.
    """

    processes: ChildProcesses
    state: Path
    mission: Mission | None
    compose: Callable[[tuple[RobotSpec, ...]], Composition]
    say: Callable[[str], None]
    by: str
    admit: Callable[[Iterable[str]], bool] | None = None
    ready: bool = False
    was_ready: bool = False

    def __post_init__(self) -> None:
        self._since_wall_s = time.time()

    async def run(self, announce: Callable[[UpState], None]) -> NoReturn:
        """Start everything, call `announce` once all are there, and keep it up until cancelled.

        Raises:
            ProcessDied: a process ended before all were there, or the world did.
            TooLate: a process was not ready in time.
        """
        processes = self.processes
        try:
            async with processes:
                self.compose(()).declare_router(processes)
                self.tell()  # who ends it now finds it
                await processes.start(ROUTER)
                self.tell()
                await processes.guard(router_up(processes))
                await processes.guard(self._bring_up())
                self.ready = self.was_ready = True
                announce(self.tell())
                beside = [asyncio.create_task(self._keep_logs_small())]
                if self.admit is not None and self.mission is None:
                    beside.append(asyncio.create_task(self._take_in_newcomers()))
                try:
                    await Supervision(processes, VITAL, self.say, self.tell).run()
                finally:
                    for task in beside:
                        task.cancel()
                    self.say("ending the fleet")
        finally:
            self.ready = False
            self.tell()

    async def _keep_logs_small(self) -> NoReturn:
        while True:
            for name in self.processes.names:
                await asyncio.to_thread(cut, self.processes.log(name))
            await asyncio.sleep(CUT_S)

    async def _bring_up(self) -> None:
        config = self.processes.session_config()
        async with (
            open_session(config) as session,
            fleet_view(session, *FLEET_KEYS, *SIMULATION_KEYS) as view,
        ):
            known = (await session.list(ROBOT_SPEC)).values()
            fleet = self.compose(tuple(sorted(known, key=lambda spec: spec.robot)))
            await self._admit(session, fleet.names)
            await bring_up(self.processes, session, view, fleet, self.by)
            for text in self.mission.statements if self.mission else ():
                await put_statement(session, text, by=self.by)

    async def _admit(self, session: Session, robots: Iterable[str]) -> None:
        """Where there are certificates, let the workers of these robots in."""
        if self.admit is None or not await asyncio.to_thread(self.admit, robots):
            return
        before = session.connections
        await self.processes.stop(ROUTER)
        await self.processes.start(ROUTER)
        await session.wait_reconnected(before)

    async def _take_in_newcomers(self) -> NoReturn:
        """Give each robot that is registered from now on a certificate and a worker."""
        async with (
            open_session(self.processes.session_config()) as session,
            session.watch(ROBOT_SPEC) as watch,
        ):
            async for change in watch:
                robot = change.address.robot
                if change.value is None or worker_of(robot) in self.processes.names:
                    continue
                await self._admit(session, (robot,))
                self.compose((change.value,)).declare(self.processes)
                await self.processes.start(worker_of(robot))
                self.say(f"{robot} is registered: it has a certificate, and a worker")
                self.tell()
        raise AssertionError("a watch has no end")

    def tell(self) -> UpState:
        """Write down how things stand, for who looks; where that cannot be, the fleet goes on."""
        state = UpState(
            process=ProcessId.of(os.getpid()),
            since_wall_s=self._since_wall_s,
            endpoint=self.processes.endpoint,
            zenoh_config=_text(self.processes.zenoh_config),
            realm=self.processes.realm,
            folder=str(self.processes.out.resolve()),
            mission=None if self.mission is None else self.mission.mission,
            ready=self.ready,
            children=tuple(self._child(name) for name in self.processes.names),
        )
        try:
            write_state(self.state, state)
        except OSError as error:
            self.say(f"`robotctl ps` is not up to date: {self.state}: {error.strerror or error}")
        return state

    def _child(self, name: str) -> Child:
        pid = self.processes.pid(name)
        return Child(
            name=name,
            process=None if pid is None else ProcessId.of(pid),
            since_wall_s=self.processes.begun_s(name),
            restarts=max(0, self.processes.starts(name) - 1),
            log=str(self.processes.log(name).resolve()),
        )


def _text(path: Path | None) -> str | None:
    return None if path is None else str(path)
