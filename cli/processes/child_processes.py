"""Child processes `robotctl …`: started, watched, and ended by their ids."""

from __future__ import annotations

import asyncio
import os
import re
import signal
import sys
import threading
import time
from collections.abc import Coroutine, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from cli.errors import BadArgument, ProcessDied
from fleet.service.child_process import ChildProcess
from keyexpr_schema.free_ports import free_port
from keyexpr_schema.full_disk import FREE_SOME, without_room
from keyexpr_schema.private_files import open_private
from keyexpr_schema.transport.session import SessionConfig

T = TypeVar("T")
END_WITH_STDIN = "ROBOTFLEET_END_WITH_STDIN"
"""Set for children of `demo` and `up`: end when stdin ends, that is, when the parent died."""
TERM_S = 20.0
"""How long a process has to end after SIGTERM before it gets SIGKILL: a recorder that has much to
write on a busy machine would lose the end of its recording."""


def free_endpoint(protocol: str = "tcp") -> str:
    """A loopback endpoint on which nothing listens now."""
    return f"{protocol}/127.0.0.1:{free_port()}"


@dataclass(frozen=True)
class Death:
    """An end that nobody asked for; `after_s` is how long the process has run [s]."""

    name: str
    after_s: float
    sentence: str


class ChildProcesses:
    """Child processes `robotctl …`, by name, each with a log file in `out`.

    Use as `async with ChildProcesses(…) as processes:`; at the end every child gets SIGTERM, then
    SIGKILL. Each is in a session of its own, so that Ctrl-C reaches the parent only, and ends by
    itself when the parent dies (its stdin ends). `zenoh_config` is given to each, and used by
    robotctl itself; `own_configs` to those that have one of their own.
    """

    def __init__(
        self,
        endpoint: str,
        realm: str,
        out: Path,
        zenoh_config: Path | None = None,
        own_configs: Mapping[str, Path] | None = None,
    ) -> None:
        self.endpoint, self.realm, self.out = endpoint, realm, out
        self.zenoh_config = zenoh_config
        self._own_configs = own_configs or {}
        self._commands: dict[str, tuple[str, ...]] = {}
        self._layers: dict[str, int] = {}
        self._children: dict[str, ChildProcess] = {}
        self._waiters: dict[str, asyncio.Task[None]] = {}
        self._ending: set[str] = set()
        self._begun_s: dict[str, float] = {}
        self._starts: dict[str, int] = {}
        self._deaths: list[Death] = []
        self._died = asyncio.Event()

    async def __aenter__(self) -> ChildProcesses:
        return self

    async def __aexit__(self, *_: object) -> None:
        for layer in sorted(set(self._layers.values()), reverse=True):
            names = [name for name in self._children if self._layers[name] == layer]
            await asyncio.gather(*(self.stop(name) for name in names))

    def declare(self, name: str, *arguments: str, layer: int = 0) -> None:
        """Say which `robotctl` command `name` runs, for this and every later `start`.

        At the end the highest layer is stopped first, so that nobody complains of a router that
        has gone, and the recorder sees how the others end.
        """
        self._commands[name] = arguments
        self._layers[name] = layer

    def surroundings(self, name: str) -> tuple[Sequence[str], Mapping[str, str]]:
        """What the command of `name` is run by, and with what in its environment: for those who
        run processes elsewhere than here."""
        return (), {}

    def session_config(self, connect_timeout_s: float = 3.0) -> SessionConfig:
        """How robotctl itself reaches the router of these processes."""
        return SessionConfig(
            endpoints=(self.endpoint,),
            realm=self.realm,
            component="robotctl",
            connect_timeout_s=connect_timeout_s,
            zenoh_config=self.zenoh_config,
        )

    def log(self, name: str) -> Path:
        """Where the output of `name` goes."""
        return self.out / f"{name}.log"

    def pid(self, name: str) -> int | None:
        """The process id of `name` while it runs."""
        child = self._children.get(name)
        return None if child is None else child.pid

    def begun_s(self, name: str) -> float | None:
        """When `name` was last started [s, Unix time]; `None` if it never was."""
        return self._begun_s.get(name)

    def starts(self, name: str) -> int:
        """How often `name` was started."""
        return self._starts.get(name, 0)

    @property
    def names(self) -> tuple[str, ...]:
        """Every declared process."""
        return tuple(self._commands)

    async def start(self, name: str) -> None:
        """Start `name`, for the first time or again; its log goes on where it was.

        Raises:
            BadArgument: nobody declared it, or it runs.
        """
        if name not in self._commands:
            raise BadArgument(f"there is no process {name!r}; there are {', '.join(self.names)}")
        if self.pid(name) is not None:
            raise BadArgument(f"{name} runs already")
        self._ending.discard(name)
        config = self._own_configs.get(name, self.zenoh_config)
        arguments = (
            *("-P", "-m", "cli.main", *self._commands[name]),
            *("--router", self.endpoint, "--realm", self.realm),
            *(() if config is None else ("--zenoh-config", str(config))),
        )
        before, environment = self.surroundings(name)
        with os.fdopen(open_private(self.log(name), os.O_WRONLY | os.O_APPEND), "ab") as log:
            child = await ChildProcess.start(
                *(*before, sys.executable, *arguments),
                stdin=asyncio.subprocess.PIPE,
                stdout=log,
                stderr=log,
                env={**os.environ, END_WITH_STDIN: "1", "PYTHONUNBUFFERED": "1", **environment},
                start_new_session=True,
            )
        self._children[name] = child
        self._begun_s[name] = time.time()
        self._starts[name] = self.starts(name) + 1
        self._waiters[name] = asyncio.create_task(self._wait(name, child))

    async def kill(self, name: str) -> None:
        """`kill -9`, as a test of what the others do then; not an unexpected death."""
        await self._end(name, (signal.SIGKILL,))

    async def stop(self, name: str) -> None:
        """SIGTERM, and SIGKILL if that does not help."""
        await self._end(name, (signal.SIGTERM, signal.SIGKILL))

    async def guard(self, work: Coroutine[Any, Any, T]) -> T:
        """Do `work`; stop it when a process dies unasked.

        Raises:
            ProcessDied: one did; the message names it, and its log.
        """
        task = asyncio.ensure_future(work)
        died = asyncio.ensure_future(self._died.wait())
        try:
            await asyncio.wait({task, died}, return_when=asyncio.FIRST_COMPLETED)
            if not task.done():
                raise ProcessDied(self._deaths[0].sentence)
            return task.result()
        finally:
            died.cancel()
            if not task.done():
                task.cancel()
                await asyncio.wait({task})

    async def deaths(self) -> list[Death]:
        """Wait until a process dies unasked; every such death that nobody was told of yet."""
        await self._died.wait()
        self._died.clear()
        told, self._deaths = self._deaths, []
        return told

    async def _end(self, name: str, signals: Sequence[signal.Signals]) -> None:
        child = self._children.get(name)
        if child is None:
            return
        self._ending.add(name)
        for signum in signals:
            if child.pid is None:
                break
            try:
                child.process.send_signal(signum)
                async with asyncio.timeout(TERM_S):
                    await child.wait()
            except (TimeoutError, ProcessLookupError):
                continue
        await self._waiters[name]

    async def _wait(self, name: str, child: ChildProcess) -> None:
        began_s = time.monotonic()
        await child.wait()
        code = await child.end()
        if name in self._ending:
            return
        # What a process said before a signal ended it has nothing to do with its end.
        how = (
            f"with exit code {code}{last_words(self.log(name))}"
            if code >= 0
            else f"by {signal.Signals(-code).name}"
        )
        after_s = time.monotonic() - began_s
        full = f" (the disk is full: {FREE_SOME})" if without_room(self.out) else ""
        sentence = f"{name} ended unexpectedly {how}; its log is {self.log(name)}{full}"
        self._deaths.append(Death(name, after_s, sentence))
        self._died.set()


def last_words(log: Path) -> str:
    """The last line of a log, as part of a sentence; nothing where it cannot be read."""
    try:
        text = log.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
    lines = [line.strip() for line in text.split("\n") if line.strip()]
    return f", saying “{re.sub('^[Ee]rror: ', '', lines[-1])}”" if lines else ""


def end_with_parent() -> None:
    """Where a parent wants it: SIGTERM to this process when the parent is gone, however it went."""
    if not os.environ.get(END_WITH_STDIN):
        return
    stdin = sys.stdin.fileno()

    def wait() -> None:
        while os.read(stdin, 4096):
            pass
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=wait, name="end-with-parent", daemon=True).start()
