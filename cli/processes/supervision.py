"""Processes that end unasked are started again, each after a pause that grows with its failures."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable
from typing import NoReturn

from cli.errors import ProcessDied
from cli.processes.child_processes import ChildProcesses, Death

FIRST_AGAIN_S, LONGEST_AGAIN_S = 0.5, 30.0
STEADY_S = 60.0
"""A process that has run for so long had started well: its next failure is its first."""


def pause_s(failures: int) -> float:
    """How long a process stays down after so many failures in a row, of which this is the last."""
    return float(min(LONGEST_AGAIN_S, FIRST_AGAIN_S * 2 ** (failures - 1)))


class Supervision:
    """Starts processes again, except those that nothing can be without: `vital`, with the reason.

    `say` hears of each end and each start, `changed` when there is news of a process.
    """

    def __init__(
        self,
        processes: ChildProcesses,
        vital: dict[str, str],
        say: Callable[[str], None],
        changed: Callable[[], object],
    ) -> None:
        self._processes, self._vital = processes, vital
        self._say, self._changed = say, changed
        self._failures: Counter[str] = Counter()

    async def run(self) -> NoReturn:
        """Go on until cancelled.

        Raises:
            ProcessDied: a vital process ended.
        """
        async with asyncio.TaskGroup() as group:
            while True:
                deaths = await self._processes.deaths()
                self._changed()
                for death in deaths:
                    group.create_task(self._again(death.name, self._pause_s(death)))

    def _pause_s(self, death: Death) -> float:
        if death.name in self._vital:
            raise ProcessDied(f"{death.sentence}: {self._vital[death.name]}")
        if death.after_s >= STEADY_S:
            del self._failures[death.name]
        return self._failed(death.name, death.sentence)

    def _failed(self, name: str, sentence: str) -> float:
        self._failures[name] += 1
        again_s = pause_s(self._failures[name])
        self._say(f"{sentence}; it is started again in {again_s:g} s")
        return again_s

    async def _again(self, name: str, after_s: float) -> None:
        started = False
        while not started:
            await asyncio.sleep(after_s)
            try:
                await self._processes.start(name)
                started = True
            except OSError as error:  # no room for its log, no process more: that may pass
                why = error.strerror or error
                after_s = self._failed(name, f"{name} cannot be started: {why}")
        self._say(f"started {name} again (pid {self._processes.pid(name)})")
        self._changed()
