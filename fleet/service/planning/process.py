"""One planning process, seen from the planner: started when needed, killed when it must be."""

from __future__ import annotations

import asyncio
import signal
import sys
from asyncio.subprocess import PIPE
from contextlib import suppress

import msgspec

from fleet.errors import FleetError
from fleet.service.child_process import ChildProcess
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


class PlanningProcessEnded(FleetError):
    """A planning process has ended, or was never there; the message says how."""


class PlanningTookTooLong(FleetError):
    """A job was not answered within its limit, and its process was killed."""


class PlanningProcess:
    """A process that does one job at a time; it is started again for the next one if need be."""

    def __init__(self, start: Start) -> None:
        self._start = start
        self._process: ChildProcess | None = None
        self._ready: Ready | None = None
        self._starting = asyncio.Lock()

    @property
    def pid(self) -> int | None:
        """The process id while it runs."""
        return self._process.pid if self._process is not None else None

    async def started(self) -> Ready:
        """Have it run.

        Raises:
            PlanningProcessEnded: it cannot be started.
        """
        async with self._starting:
            if self._ready is None or self.pid is None:
                await self.close()
                self._process = await ChildProcess.start(
                    *(sys.executable, "-P", "-m", "fleet.service.planning.worker"),
                    stdin=PIPE,
                    stdout=PIPE,
                    start_new_session=True,
                )
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
            self._process.kill()

    async def close(self) -> None:
        """End it, and wait until it has ended."""
        process, self._process, self._ready = self._process, None, None
        if process is not None:
            with suppress(TimeoutError):
                async with asyncio.timeout(END_TIMEOUT_S):
                    await process.end()

    async def _greeted(self, process: ChildProcess) -> Ready:
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

    async def _exchange(self, process: ChildProcess, data: bytes) -> bytes:
        """Send a frame, and receive one."""
        ending = asyncio.ensure_future(process.ends_its_output())
        try:
            return await _received(process, data)
        except (asyncio.IncompleteReadError, ConnectionError):
            code = await process.end()  # it may only have closed its end
            how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
            raise PlanningProcessEnded(f"the planning process ended ({how})") from None
        finally:
            ending.cancel()


async def _received(process: ChildProcess, data: bytes) -> bytes:
    """The frame that a process answers to one."""
    stdin, stdout = process.process.stdin, process.process.stdout
    assert stdin is not None and stdout is not None
    stdin.write(data)
    await stdin.drain()
    (size,) = HEADER.unpack(await stdout.readexactly(HEADER.size))
    return await stdout.readexactly(size)
