"""The fleet's real processes, started, killed and weighed."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path

from cli.processes.child_processes import END_WITH_STDIN
from fleet.service.child_process import ChildProcess
from fleet.service.router_process import with_port

REALM = "benchmark"
READY_S = 60.0
_TICKS_A_S = os.sysconf("SC_CLK_TCK")
_PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 2**20


class Child:
    """A process that is ready when it has said lines that begin like each of `ready` on stdout.

    Its errors go to `folder/name.log`.
    """

    def __init__(self, name: str, folder: Path, ready: Sequence[str], *command: str) -> None:
        self.name, self._ready = name, ready
        self.log = folder / f"{name}.log"
        self._settings = folder / "robotctl.yaml"
        self._command = command
        self._process: ChildProcess | None = None
        self._reading: asyncio.Task[None] | None = None

    async def start(self, limit_s: float = READY_S) -> float | None:
        """Start; the seconds until it said that it is ready, or `None` where it did not in time."""
        began_s = time.perf_counter()
        with self.log.open("ab") as log:
            self._process = await ChildProcess.start(
                sys.executable,
                *self._command,
                stdin=asyncio.subprocess.PIPE,  # ends when we do, however, and the child with it
                stdout=asyncio.subprocess.PIPE,
                stderr=log,
                env={**os.environ, END_WITH_STDIN: "1", "ROBOTFLEET_CONFIG": str(self._settings)},
                start_new_session=True,
            )
        said = self._process.process.stdout
        assert said is not None
        missing = set(self._ready)
        try:
            async with asyncio.timeout(limit_s):
                async for line in said:
                    missing -= {words for words in missing if line.decode().startswith(words)}
                    if not missing:
                        self._reading = asyncio.create_task(_drain(said))
                        return time.perf_counter() - began_s
        except TimeoutError:
            self._reading = asyncio.create_task(_drain(said))
            return None
        raise SystemExit(f"{self.name} ended before it was ready; its log is {self.log}")

    @property
    def pid(self) -> int:
        """Its process id."""
        assert self._process is not None
        return self._process.process.pid

    async def kill(self) -> None:
        """`kill -9`, the processes that it started included."""
        await self._end(signal.SIGKILL)

    async def stop(self) -> None:
        """SIGTERM, and SIGKILL where that does not help in ten seconds."""
        await self._end(signal.SIGTERM)

    async def _end(self, number: signal.Signals) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        started = _descendants(process.process.pid)
        with suppress(ProcessLookupError, TimeoutError):
            process.process.send_signal(number)
            async with asyncio.timeout(10.0):
                await process.wait()
        await process.end()
        for pid in started:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        if self._reading is not None:
            self._reading.cancel()
            await asyncio.gather(self._reading, return_exceptions=True)

    async def tell(self, line: str) -> None:
        """Write a line to its standard input."""
        assert self._process is not None
        stdin = self._process.process.stdin
        assert stdin is not None
        stdin.write(f"{line}\n".encode())
        await stdin.drain()

    def cpu_s(self) -> float:
        """Seconds of a core that it and the processes that it started have had."""
        return sum(_cpu_s(pid) for pid in (self.pid, *_descendants(self.pid)))

    def rss_mb(self) -> float:
        """Memory that it and the processes that it started have now, MB."""
        return sum(rss_mb(pid) for pid in (self.pid, *_descendants(self.pid)))


async def _drain(stream: asyncio.StreamReader) -> None:
    while await stream.read(65536):
        pass


def _stat(pid: int) -> list[str]:
    """/proc/PID/stat from the state on; of a process that is gone, nothing."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8")
    except OSError:
        return []
    return text.rpartition(")")[2].split()


def _cpu_s(pid: int) -> float:
    fields = _stat(pid)
    return sum(int(fields[place]) for place in range(11, 15)) / _TICKS_A_S if fields else 0.0


def rss_mb(pid: int) -> float:
    """Memory that a process has now, MB; 0 where it is gone."""
    fields = _stat(pid)
    return int(fields[21]) * _PAGE_MB if fields else 0.0


def _descendants(pid: int) -> list[int]:
    parents: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and (fields := _stat(int(entry.name))):
            parents.setdefault(int(fields[1]), []).append(int(entry.name))
    found: list[int] = []
    ahead = [pid]
    while ahead:
        children = parents.get(ahead.pop(), [])
        found += children
        ahead += children
    return found


async def share_of_core(*children: Child, seconds: float) -> list[float]:
    """What share of a core each of them takes over so many seconds."""
    before = [child.cpu_s() for child in children]
    began_s = time.perf_counter()
    await asyncio.sleep(seconds)
    took_s = time.perf_counter() - began_s
    return [(child.cpu_s() - had_s) / took_s for child, had_s in zip(children, before, strict=True)]


def folder_mb(folder: Path) -> float:
    """The size of the files in a folder, MB."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) / 2**20


SETTINGS = "limits: {open_goals: 10000}"
"""All goals of a run are of one operator, who may have half of those that are open."""


class Processes:
    """A router and a planner on a free port; their data lies in `folder`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "robotctl.yaml").write_text(SETTINGS)
        self.endpoint = with_port("tcp/127.0.0.1:0")
        self.router = self.robotctl(
            "router", ("router listening",),
            "router", "--listen", self.endpoint, "--data", str(folder / "router"),
        )  # fmt: skip
        self.planner = self.robotctl(
            "planner", ("planner ready",), "planner", "--data", str(folder / "planner")
        )

    def robotctl(self, name: str, ready: Sequence[str], *arguments: str) -> Child:
        """A process by `robotctl`, of this router and realm."""
        return self.module("cli.main", name, ready, *arguments)

    def module(self, module: str, name: str, ready: Sequence[str], *arguments: str) -> Child:
        """A process by `python -m`, of this router and realm."""
        place = ("--router", self.endpoint, "--realm", REALM)
        return Child(name, self.folder, ready, "-m", module, *arguments, *place)


@asynccontextmanager
async def processes(folder: Path, planner: bool = True) -> AsyncIterator[Processes]:
    """A router, and a planner where it is wanted, ended with the block."""
    made = Processes(folder)
    try:
        await made.router.start()
        if planner:
            await made.planner.start()
        yield made
    finally:
        await made.planner.stop()
        await made.router.stop()
