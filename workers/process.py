"""Workers as a process: `run_workers` is the main function of `robotctl worker`."""

from __future__ import annotations

import asyncio
import logging
import secrets
import sqlite3
import sys
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractAsyncContextManager, AsyncExitStack
from contextvars import ContextVar
from pathlib import Path

from keyexpr_schema.control_characters import show_in_logs
from keyexpr_schema.errors import BrokenPlugIn, SchemaError
from keyexpr_schema.ids import check_id
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.signals import run_until_signal
from keyexpr_schema.transport.session import SessionConfig, open_session
from workers.embodiment import Embodiment, EmbodimentFactory
from workers.errors import JournalBusy, JournalUnreadable, RobotTaken, WorkerError, WorkersEnded
from workers.orders.journal import KEPT, Journal, Retention
from workers.orders.journal_file import trouble_of
from workers.runtime import Worker
from workers.shared_watch import SharedWatch
from workers.skill_registry import Skill, SkillRegistry
from workers.skills.household import HOUSEHOLD

WAITING_LINE_S = 1.0
"""Wall seconds of waiting for a robot to be registered before it is announced."""
AGAIN_S, LONGEST_AGAIN_S = 1.0, 60.0
"""Wall seconds before a robot that could not be served is tried again; twice as long each time."""
HELD_UP_S = 5.0
"""The same, for a robot that another process serves: it is free as soon as that one ends."""
OTHERS_S = 2.0
"""So much later than it is registered, a robot is served that nobody has named [wall s]: a worker
that waits for it elsewhere goes first."""

HOPELESS = (JournalUnreadable, BrokenPlugIn)
"""What trying again does not help."""

_robot: ContextVar[str] = ContextVar("robot")
_log = logging.getLogger("robotfleet.worker.process")


def run_worker(
    robot: str,
    endpoints: tuple[str, ...],
    realm: str,
    data_dir: Path,
    embodiment_factory: EmbodimentFactory,
    *,
    skills: Iterable[Skill] = HOUSEHOLD,
    retention: Retention = KEPT,
    zenoh_config: Path | None = None,
) -> None:
    """Be the worker of `robot` until SIGTERM or SIGINT; then stop the robot and return.

    Waits for a router, and for the robot's spec to be registered. Skills are `skills` and those
    that installed packages offer (see `SkillRegistry.installed`). The order journal is
    `data_dir/{robot}.journal`. Logs go to stderr; the line `worker {robot} ready (incarnation …)`
    to stdout.

    Raises:
        InvalidId: `robot` or `realm` cannot stand in a key.
        JournalBusy: another worker runs for this robot on the same `data_dir`.
        JournalUnreadable: the journal's file is something else.
        RobotTaken: another worker of this robot is connected.
        BadSkill: two of `skills` share a name.
    """
    run_workers(
        {robot: data_dir},
        endpoints,
        realm,
        embodiment_factory,
        skills=skills,
        retention=retention,
        zenoh_config=zenoh_config,
    )


def run_workers(
    data_dirs: Mapping[str, Path],
    endpoints: tuple[str, ...],
    realm: str,
    embodiment_factory: EmbodimentFactory,
    *,
    skills: Iterable[Skill] = HOUSEHOLD,
    retention: Retention = KEPT,
    zenoh_config: Path | None = None,
    registered: Callable[[str], Path] | None = None,
) -> None:
    """Be the workers of several robots, each with the folder of its journal; see `run_worker`.

    With `registered`, which says where a robot's journal is, also of every other robot that is
    registered now or later. A robot that is unregistered has no worker any more, until it is
    registered again.

    They share a Zenoh session and what they know of the world, and nothing else. One that fails is
    reported on stderr and does not disturb the others. It is tried again, again and again; it has
    ended where that cannot help (a journal that cannot be read, an embodiment that cannot be made).

    A robot that is the only one ever is not tried again: what went wrong is raised.

    Raises:
        WorkersEnded: at the end, if some robots were not served then; it names them, with reasons.
        InvalidId: a robot or `realm` cannot stand in a key.
        BadSkill: two of `skills` share a name.
    """
    for robot in data_dirs:
        check_id(robot, "robot")
    first, alone = next(iter(data_dirs), ""), len(data_dirs) == 1 and registered is None
    config = SessionConfig(
        endpoints=endpoints,
        realm=realm,
        component="-".join(filter(None, ("worker" if alone else "workers", first))),
        connect_timeout_s=None,
        zenoh_config=zenoh_config,
    )
    _log_to_stderr(first if alone else "workers")
    registry = SkillRegistry.installed(skills)
    process = _Process(config, registry, embodiment_factory, retention, alone=alone)
    run_until_signal(process.serve(data_dirs, registered))
    if alone and process.failures:
        raise process.failures[first]
    if process.failures:
        raise WorkersEnded(
            f"{len(process.failures)} of {process.robots} robots were not served: "
            + "; ".join(f"{robot}: {_sentence(e)}" for robot, e in process.failures.items())
        )


class _Process:
    """All robots of a process, of which there are so many. `failures` are those that are not served
    now, and why."""

    def __init__(
        self,
        config: SessionConfig,
        registry: SkillRegistry,
        embodiment_factory: EmbodimentFactory,
        retention: Retention,
        *,
        alone: bool,
    ) -> None:
        self.failures: dict[str, Exception] = {}
        self._config, self._registry = config, registry
        self._embodiment_factory, self._retention = embodiment_factory, retention
        self._alone = alone
        self.robots = 0
        self._connected = asyncio.Event()

    async def serve(
        self, data_dirs: Mapping[str, Path], registered: Callable[[str], Path] | None = None
    ) -> None:
        """Serve until cancelled, or until no robot is left that could be."""
        async with asyncio.TaskGroup() as group:
            connecting = group.create_task(self._connect(data_dirs))
            async with asyncio.TaskGroup() as robots:
                self._begin(robots, data_dirs)
                if registered is not None:
                    await self._serve_registered(robots, data_dirs, registered)
            connecting.cancel()

    def _begin(
        self, group: asyncio.TaskGroup, data_dirs: Mapping[str, Path], after_s: float = 0.0
    ) -> None:
        self.robots += len(data_dirs)
        for robot, data_dir in data_dirs.items():
            group.create_task(self._attend(robot, data_dir, after_s))

    async def _serve_registered(
        self,
        group: asyncio.TaskGroup,
        named: Iterable[str],
        data_dir_of: Callable[[str], Path],
    ) -> None:
        """Begin with every other robot as soon as it is registered, for ever."""
        await self._connected.wait()
        await self._shared.synced()
        specs, begun = self._shared.world.specs, set(named)
        after_s = 0.0
        while True:
            new = sorted(specs.keys() - begun)
            if new:
                group.create_task(self._shared.follow(*new))
                self._begin(group, {robot: data_dir_of(robot) for robot in new}, after_s)
                begun.update(new)
            after_s = OTHERS_S
            await self._shared.world.until(lambda: bool(specs.keys() - begun))

    async def _connect(self, robots: Iterable[str]) -> None:
        async with open_session(self._config) as self._session:
            self._shared = SharedWatch(self._session, *robots)
            self._connected.set()
            await self._shared.run()

    async def _attend(self, robot: str, data_dir: Path, after_s: float) -> None:
        """Serve one robot, as often as it takes; nothing that fails in it leaves this method."""
        _robot.set(robot)
        await asyncio.sleep(after_s)
        pause_s, said = AGAIN_S, ""
        while True:
            try:
                await self._work(robot, data_dir)
                said = ""
            except Exception as failure:  # also what a stranger's embodiment raises
                error = failure
                if isinstance(cause := _cause(failure), sqlite3.DatabaseError):
                    error = trouble_of(_journal(robot, data_dir), cause)
                if robot not in self.failures:
                    pause_s, said = AGAIN_S, ""
                self.failures[robot] = error
                if self._alone:
                    return
                cause = _cause(error)
                known = isinstance(cause, (WorkerError, SchemaError))
                held_up = isinstance(cause, (JournalBusy, RobotTaken))
                if _sentence(error) != said:
                    said = _sentence(error)
                    _log.error("%s", said, exc_info=None if known else error)
                if isinstance(cause, HOPELESS):
                    _log.error("%s is not served any more; the other robots are", robot)
                    return
                await asyncio.sleep(HELD_UP_S if held_up else pause_s)
                pause_s = min(2 * pause_s, LONGEST_AGAIN_S)

    async def _work(self, robot: str, data_dir: Path) -> None:
        """Serve one robot until it fails, or is unregistered."""
        async with AsyncExitStack() as stack:
            # Before there is a router: whoever starts a second one hears of it at once.
            journal = Journal(_journal(robot, data_dir), self._retention)
            await asyncio.to_thread(journal.__enter__)
            stack.push(journal)
            await self._connected.wait()
            spec = await self._registered(robot)
            incarnation = f"{robot[:40]}-{secrets.token_hex(4)}"
            made = self._embodiment_factory(self._session, spec, incarnation)
            body: Embodiment = (
                await stack.enter_async_context(made)
                if isinstance(made, AbstractAsyncContextManager)
                else made
            )
            worker = Worker(
                self._session, spec, body, journal, self._registry, incarnation, self._shared
            )
            announcing = asyncio.create_task(self._announce_ready(worker))
            serving = asyncio.create_task(worker.run())
            leaving = asyncio.create_task(worker.unregistered())
            try:
                await asyncio.wait({serving, leaving}, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for task in (announcing, serving, leaving):
                    task.cancel()
                await asyncio.wait({serving})
            if not serving.cancelled():
                serving.result()
            print(f"worker {robot} leaves: the robot is not registered any more", flush=True)  # noqa: T201

    async def _registered(self, robot: str) -> RobotSpec:
        """The robot's spec, as soon as somebody has registered it."""
        finding = asyncio.create_task(self._shared.registered(robot))
        try:
            done, _ = await asyncio.wait({finding}, timeout=WAITING_LINE_S)
            if not done:
                print(f"worker {robot} waits: the robot is not registered yet", flush=True)  # noqa: T201
            return await finding
        finally:
            finding.cancel()

    async def _announce_ready(self, worker: Worker) -> None:
        await worker.ready()
        robot = worker.spec.robot
        self.failures.pop(robot, None)
        print(f"worker {robot} ready (incarnation {worker.incarnation})", flush=True)  # noqa: T201


def _journal(robot: str, data_dir: Path) -> Path:
    return data_dir / f"{robot}.journal"


def _cause(error: BaseException) -> BaseException:
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return error


def _sentence(error: BaseException) -> str:
    """What went wrong, for a person."""
    cause = _cause(error)
    if isinstance(cause, (WorkerError, SchemaError)):
        return str(cause)
    return f"{type(cause).__name__}: {cause}"


def _log_to_stderr(otherwise: str) -> None:
    """Log lines begin with the robot that they are about, or `otherwise`."""

    def name_robot(record: logging.LogRecord) -> bool:
        record.robot = _robot.get(otherwise)
        return True

    show_in_logs()
    handler = logging.StreamHandler(sys.stderr)
    handler.addFilter(name_robot)
    line = "%(robot)s: %(levelname)s: %(message)s"
    logging.basicConfig(handlers=[handler], level=logging.INFO, format=line)
