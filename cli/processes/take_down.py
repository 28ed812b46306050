"""Ends what a `robotctl up` has started, and nothing else."""

from __future__ import annotations

import asyncio
import signal
import time
from collections.abc import Callable, Iterable

from cli.processes.identity import ProcessId
from cli.processes.up_state import UpState

KILLED_S = 10.0
"""How long what was killed, or whose parent was, may take to be gone [s, wall]."""
LOOK_S = 0.1


def processes_of(up: UpState) -> list[ProcessId]:
    """`up` itself, and what it last said that it ran."""
    children = (child.process for child in up.children)
    return [each for each in (up.process, *children) if each is not None]


async def take_down(up: UpState, wait_s: float, say: Callable[[str], None]) -> list[ProcessId]:
    """Have `up` end its processes in order, and wait; where it does not in time, kill.

    Each process is looked at by when it began: a number that was given out again is left alone.

    Returns:
        What runs still.
    """
    own = up.process
    if own and own.send(signal.SIGTERM) and await _alive_after([own], wait_s):
        say(f"up (pid {own.pid}) has not ended after {wait_s:g} s: it is killed")
        own.send(signal.SIGKILL)
    # Those whose parent was killed end by themselves.
    for each in await _alive_after(processes_of(up), KILLED_S):
        say(f"pid {each.pid} has not ended: it is killed")
        each.send(signal.SIGKILL)
    return await _alive_after(processes_of(up), KILLED_S)


async def _alive_after(processes: Iterable[ProcessId], wait_s: float) -> list[ProcessId]:
    """Those that still run when all have ended, or after so long."""
    give_up_at = time.monotonic() + wait_s
    while left := [each for each in processes if each.alive]:
        if time.monotonic() >= give_up_at:
            break
        await asyncio.sleep(LOOK_S)
    return left
