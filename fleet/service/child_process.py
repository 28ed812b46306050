"""Child processes that end as a whole: killed, waited for, their pipes closed."""

from __future__ import annotations

import array
import asyncio
import fcntl
import os
import signal
import termios
from asyncio.subprocess import Process, SubprocessStreamProtocol
from contextlib import suppress
from typing import Any

_STREAM_LIMIT = 2**16
"""The default of asyncio's streams, bytes."""


class _Protocol(SubprocessStreamProtocol):
    """Says when the process has ended, and when its pipes are closed: two things."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        super().__init__(limit=_STREAM_LIMIT, loop=loop)
        self.ended, self.closed = asyncio.Event(), asyncio.Event()
        self._pipes: set[int] = set()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        assert isinstance(transport, asyncio.SubprocessTransport)
        self._pipes = {fd for fd in range(3) if transport.get_pipe_transport(fd) is not None}
        if not self._pipes:
            self.closed.set()

    def pipe_connection_lost(self, fd: int, exc: Exception | None) -> None:
        super().pipe_connection_lost(fd, exc)
        self._pipes.discard(fd)
        if not self._pipes:
            self.closed.set()

    def process_exited(self) -> None:
        super().process_exited()
        self.ended.set()


class ChildProcess:
    """A process that this one has started, and owns.

    asyncio takes a process for ended, and closes its pipes, when nobody else holds those any more:
    with a grandchild that does, `Process.wait` never returns, and a loop that ends first leaves
    them open. `wait` and `end` do not depend on that.
    """

    def __init__(
        self, transport: asyncio.SubprocessTransport, protocol: _Protocol, group: bool
    ) -> None:
        self.process = Process(transport, protocol, asyncio.get_running_loop())
        self._transport = transport
        self._protocol = protocol
        self._group = group

    @classmethod
    async def start(cls, *command: str, **options: Any) -> ChildProcess:
        """As `asyncio.create_subprocess_exec`, with its options.

        With `start_new_session` the whole group is killed when it ends.

        Raises:
            OSError: it cannot be started.
        """
        loop = asyncio.get_running_loop()
        transport, protocol = await loop.subprocess_exec(
            lambda: _Protocol(loop),
            *command,
            **{"stdin": None, "stdout": None, "stderr": None, **options},
        )
        return cls(transport, protocol, group=bool(options.get("start_new_session")))

    @property
    def pid(self) -> int | None:
        """The process id while it runs."""
        return self.process.pid if self.process.returncode is None else None

    def kill(self) -> None:
        """`kill -9`, if it runs."""
        if self.process.returncode is not None:
            return
        # Not by `Process.kill`: that looks for the exit code first, and takes it away from asyncio.
        kill = os.killpg if self._group else os.kill
        with suppress(ProcessLookupError):
            kill(self.process.pid, signal.SIGKILL)

    async def wait(self) -> int:
        """Its exit code, as soon as it has ended."""
        await self._protocol.ended.wait()
        assert self.process.returncode is not None
        return self.process.returncode

    async def ends_its_output(self) -> None:
        """Wait until it has ended; then all that it wrote comes, and the end of its output.

        Without this the pipe has no end while somebody whom the process has left behind keeps it.
        What waits to be written to the process is dropped.
        """
        await self.wait()
        stdin, stdout = map(self._transport.get_pipe_transport, (0, 1))
        output = self.process.stdout
        assert isinstance(stdout, asyncio.ReadTransport) and output is not None
        if isinstance(stdin, asyncio.WriteTransport):
            stdin.abort()
        if not stdout.is_closing():
            pipe = stdout.get_extra_info("pipe").fileno()
            if count := _unread(pipe):  # once: who was left behind may write for ever
                output.feed_data(os.read(pipe, count))
            stdout.close()
            output.feed_eof()

    async def end(self) -> int:
        """Kill it if it runs, close its pipes, whoever else has them, and wait; its exit code.

        What it has written and nobody has read is gone. It is killed and its pipes are closed
        also where this is cancelled.
        """
        self.kill()
        # Not the transport as a whole: that would look for the exit code itself, and take it away
        # from asyncio. It is closed with the last pipe when the process has ended.
        for fd in range(3):
            pipe = self._transport.get_pipe_transport(fd)
            if isinstance(pipe, asyncio.WriteTransport) and pipe.get_write_buffer_size():
                pipe.abort()  # nobody reads what waits to be written
            elif pipe is not None:
                pipe.close()
        code = await self.wait()
        await self._protocol.closed.wait()
        return code


def _unread(pipe: int) -> int:
    """How many bytes were written to a pipe and are not yet read."""
    count = array.array("i", [0])
    fcntl.ioctl(pipe, termios.FIONREAD, count)
    return count[0]
