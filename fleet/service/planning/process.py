"""One planning process, seen from the planner: started when needed, killed when it must be."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from asyncio.subprocess import PIPE, Process, SubprocessStreamProtocol
from contextlib import suppress

import msgspec

from fleet.errors import FleetError
from fleet.service.planning.messages import (
    ANSWER,
    GREETING,
    HEADER,
    Answer,
    Job,
    Ready,
    Refused,
    Start,
    failed_answer,
    frame,
)

START_TIMEOUT_S = 60.0
"""For a process to greet; it takes half a second on an idle core."""
END_TIMEOUT_S = 5.0
"""For a killed process to be gone."""

_STREAM_LIMIT = 2**16
"""The default of asyncio's streams, bytes."""


class PlanningProcessEnded(FleetError):
    """A planning process has ended, or was never there; the message says how."""


class PlanningTookTooLong(FleetError):
    """A job was not answered within its limit, and its process was killed."""


class PlanningProcess:
    """A process that does one job at a time; it is started again for the next one if need be."""

    def __init__(self, start: Start) -> None:
        self._start = start
        self._process: Process | None = None
        self._transport: asyncio.SubprocessTransport | None = None
        self._ready: Ready | None = None
        self._starting = asyncio.Lock()

    @property
    def pid(self) -> int | None:
        """The process id while it runs."""
        running = self._process is not None and self._process.returncode is None
        return self._process.pid if self._process is not None and running else None

    async def started(self) -> Ready:
        """Have it run.

        Raises:
            PlanningProcessEnded: it cannot be started.
        """
        async with self._starting:
            if self._ready is None or self.pid is None:
                await self.close()
                self._process, self._transport = await _started()
                self._ready = await self._greeted(self._process)
            return self._ready

    async def answer(self, job: Job, limit_s: float) -> Answer:
        """What a job comes to within `limit_s`.

        Raises:
            PlanningProcessEnded: the process ended over it; it may be tried again.
            PlanningTookTooLong: it was killed at the limit.
        """
        await self.started()
        assert self._process is not None
        try:
            async with asyncio.timeout(limit_s):
                data = await self._exchange(self._process, frame(job))
        except TimeoutError:
            await self.close()
            raise PlanningTookTooLong(f"planning took longer than {limit_s:g} s") from None
        try:
            return ANSWER.decode(data)
        except msgspec.MsgspecError as error:
            return failed_answer(job, f"the planner's answer is malformed: {error}")

    def kill(self) -> None:
        """End it at once, with what it has started; whoever waits for an answer hears of it."""
        if self._process is not None:
            _kill(self._process)

    async def close(self) -> None:
        """End it, and wait until it has ended; its pipes are closed, also if this is cancelled."""
        process, self._process, self._ready = self._process, None, None
        transport, self._transport = self._transport, None
        if process is None or transport is None:
            return
        try:
            _kill(process)
            with suppress(TimeoutError):
                async with asyncio.timeout(END_TIMEOUT_S):
                    await process.wait()
        finally:
            transport.close()

    async def _greeted(self, process: Process) -> Ready:
        try:
            async with asyncio.timeout(START_TIMEOUT_S):
                greeting = GREETING.decode(await self._exchange(process, frame(self._start)))
        except TimeoutError:
            await self.close()
            raise PlanningProcessEnded(
                f"the planning process was not ready within {START_TIMEOUT_S:g} s"
            ) from None
        if isinstance(greeting, Refused):
            await self.close()
            raise PlanningProcessEnded(greeting.sentence)
        return greeting

    async def _exchange(self, process: Process, data: bytes) -> bytes:
        """Send a frame, and receive one."""
        assert process.stdin is not None and process.stdout is not None
        try:
            process.stdin.write(data)
            await process.stdin.drain()
            (size,) = HEADER.unpack(await process.stdout.readexactly(HEADER.size))
            return await process.stdout.readexactly(size)
        except (asyncio.IncompleteReadError, ConnectionError):
            _kill(process)  # it may only have closed its end
            code = await process.wait()
            how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
            raise PlanningProcessEnded(f"the planning process ended ({how})") from None


async def _started() -> tuple[Process, asyncio.SubprocessTransport]:
    """As `create_subprocess_exec`, which keeps the transport, that is, the pipes, to itself."""
    loop = asyncio.get_running_loop()
    transport, protocol = await loop.subprocess_exec(
        lambda: SubprocessStreamProtocol(limit=_STREAM_LIMIT, loop=loop),
        *(sys.executable, "-P", "-m", "fleet.service.planning.worker"),
        stdin=PIPE,
        stdout=PIPE,
        stderr=None,
        start_new_session=True,
    )
    return Process(transport, protocol, loop), transport


def _kill(process: Process) -> None:
    """End a process, and its group."""
    if process.returncode is None:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
