"""A child process ends as a whole, whoever else has its pipes."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from asyncio.subprocess import PIPE
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from fleet.service.child_process import ChildProcess
from tests.support.polling import until
from tests.support.process_ids import alive

LEAVES = """
import os, subprocess, sys
left = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
print(left.pid, flush=True)
if sys.argv[1] == "leaves a speaker":
    os.execvp("yes", ["yes"]) if os.fork() == 0 else None
if sys.argv[1] == "speaks":
    print("x" * 300_000, end="", flush=True)
if sys.argv[1] != "waits":
    os._exit(3)
left.wait()
"""
"""Leaves a process with all its pipes behind, or waits for it."""


@asynccontextmanager
async def leaving(how: str, **options: bool) -> AsyncIterator[tuple[ChildProcess, int]]:
    """Such a process, and the id of what it leaves behind."""
    command = (sys.executable, "-c", LEAVES, how)
    child = await ChildProcess.start(*command, stdin=PIPE, stdout=PIPE, stderr=PIPE, **options)
    assert child.process.stdout is not None
    left = int(await child.process.stdout.readline())
    try:
        yield child, left
    finally:
        if alive(left):
            os.kill(left, signal.SIGKILL)


async def test_it_has_ended_although_somebody_else_holds_its_pipes(
    all_closed: None,
) -> None:
    async with leaving("ends") as (child, left):
        assert await child.wait() == 3
        assert child.pid is None
        assert alive(left)
        assert await child.end() == 3
        assert await child.end() == 3


async def test_all_that_it_wrote_comes_and_then_its_output_ends_whoever_holds_it(
    all_closed: None,
) -> None:
    async with leaving("speaks") as (child, left):
        ending = asyncio.create_task(child.ends_its_output())
        stdin, stdout = child.process.stdin, child.process.stdout
        assert stdin is not None and stdout is not None
        stdin.write(b"y" * 10**6)  # which nobody takes
        said, *_ = await asyncio.gather(stdout.read(), stdin.drain(), ending)
        assert len(said) == 300_000
        assert alive(left)
        assert await child.end() == 3


async def test_its_output_ends_although_somebody_goes_on_writing_there() -> None:
    async with leaving("leaves a speaker", start_new_session=True) as (child, _):
        stdout = child.process.stdout
        assert stdout is not None
        assert await stdout.readexactly(4) == b"y\ny\n"
        said, _ = await asyncio.gather(stdout.read(), child.ends_its_output())
        assert set(said) <= set(b"y\n")
        assert await child.end() == 3


async def test_it_is_killed_although_somebody_else_holds_its_pipes(
    all_closed: None,
) -> None:
    async with leaving("waits") as (child, left):
        assert await child.end() == -signal.SIGKILL
        assert alive(left)


async def test_a_session_of_its_own_is_killed_with_it() -> None:
    async with leaving("waits", start_new_session=True) as (child, left):
        await child.end()
        await until(lambda: not alive(left))


async def test_what_nobody_reads_and_nobody_takes_keeps_nothing_open(
    all_closed: None,
) -> None:
    code = "import sys; sys.stdout.write('x' * 10**6)"
    child = await ChildProcess.start(sys.executable, "-c", code, stdin=PIPE, stdout=PIPE)
    assert child.process.stdin is not None
    child.process.stdin.write(b"y" * 10**6)
    with pytest.raises(TimeoutError):  # it is killed, and the pipes are closed, all the same
        async with asyncio.timeout(0.0):
            await child.end()
    assert await child.end() == -signal.SIGKILL


async def test_without_pipes_it_ends_as_well() -> None:
    child = await ChildProcess.start(sys.executable, "-c", "import sys; sys.exit(4)")
    assert await child.wait() == 4
    assert await child.end() == 4
