"""Processes of tests: what is started is killed and waited for, and its pipes are closed."""

from __future__ import annotations

import subprocess
from asyncio.subprocess import PIPE, Process
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from typing import Any

from fleet.service.child_process import ChildProcess


@asynccontextmanager
async def child_process(*command: str, **options: Any) -> AsyncIterator[Process]:
    """A process with its output on pipes, or as `options` of asyncio say, killed with the block."""
    child = await ChildProcess.start(*command, **{"stdout": PIPE, "stderr": PIPE, **options})
    try:
        yield child.process
    finally:
        await child.end()


@contextmanager
def blocking_child(*command: str, **options: Any) -> Iterator[subprocess.Popen[str]]:
    """The same for who does not await; text, with stdout on a pipe."""
    options = {"stdout": subprocess.PIPE, **options}
    process = subprocess.Popen(command, text=True, **options)
    try:
        yield process
    finally:
        end_child(process)


def end_child(process: subprocess.Popen[str]) -> None:
    """Kill it if it runs, wait for it, and close its pipes."""
    process.kill()
    with process:
        pass
