"""What is done to a fleet while it works. Each fault ends what it began."""

from __future__ import annotations

import asyncio
import random
import time
from collections import defaultdict
from collections.abc import AsyncIterator, Awaitable, Callable, Collection
from contextlib import asynccontextmanager, suppress

from benchmarks.chaos.judge import Judge
from benchmarks.chaos.power import set_back
from benchmarks.chaos.site import SiteProcesses
from cli.client.stops import give_stop
from cli.errors import CliError
from cli.processes.composition import PLANNER, ROUTER
from keyexpr_schema.errors import SchemaError
from keyexpr_schema.keyspace import STOP
from keyexpr_schema.payloads.stops import StopAddress
from keyexpr_schema.transport.session import Session

KINDS = ("kill", "freeze", "power", "cut", "clock", "disk", "stop")
DOWN_S = (0.0, 1.5)
FROZEN_S = (0.2, 5.0)
CUT_S = (0.3, 6.0)
SHIFTED_S = (1.0, 5.0)
AHEAD_S = (-600.0, -5.0, -0.3, 0.3, 5.0)
"""What is farther ahead stays: see docs/guarantees.md."""
FULL_S = (0.5, 4.0)
STOPPED_S = (0.3, 4.0)
CONFIRMED_WITHIN_S = 20.0


class Faults:
    """Faults by chance, each in a kind that can be had on this site; `did` counts them."""

    def __init__(
        self,
        processes: SiteProcesses,
        session: Session,
        judge: Judge,
        robots: tuple[str, ...],
        rnd: random.Random,
        wanted: Collection[str] = KINDS,
    ) -> None:
        self._processes, self._session, self._judge = processes, session, judge
        self._rnd, self._began_s = rnd, 0.0
        self._workers = [f"worker-{robot}" for robot in robots]
        self._busy: defaultdict[str, asyncio.Lock] = defaultdict(asyncio.Lock)
        self.did: defaultdict[str, int] = defaultdict(int)
        kinds: dict[str, Callable[[], Awaitable[None]]] = {
            "kill": self._kill,
            "freeze": self._freeze,
            "power": self._power,
            "cut": self._cut,
            "clock": self._clock,
            "disk": self._disk,
            "stop": self._stop,
        }
        self._kinds = {
            k: do for k, do in kinds.items() if k in wanted and k not in processes.site.lacks
        }

    async def some(self, number: int, within_s: float) -> None:
        """So many, each at a moment of its own, over each other; returns when all are over."""

        self._began_s = time.monotonic()

        async def one(kind: str, after_s: float) -> None:
            await asyncio.sleep(after_s)
            await self._kinds[kind]()
            self.did[kind] += 1

        kinds = self._rnd.choices(sorted(self._kinds), k=number)
        moments = [self._rnd.uniform(0.0, within_s) for _ in kinds]
        async with asyncio.TaskGroup() as group:
            for kind, after_s in zip(kinds, moments, strict=True):
                group.create_task(one(kind, after_s))

    async def _for(self, lasts_s: tuple[float, float], what: str) -> None:
        now_s, lasting_s = time.monotonic() - self._began_s, self._rnd.uniform(*lasts_s)
        print(f"  at {now_s:.1f} s for {lasting_s:.1f} s: {what}", flush=True)
        await asyncio.sleep(lasting_s)

    @asynccontextmanager
    async def _alone(self, *names: str) -> AsyncIterator[None]:
        for name in sorted(names):
            await self._busy[name].acquire()
        try:
            yield
        finally:
            for name in names:
                self._busy[name].release()

    async def _kill(self) -> None:
        name = self._rnd.choice([ROUTER, PLANNER, *self._workers])
        async with self._alone(name):
            await self._processes.kill(name)
            await self._for(DOWN_S, f"{name} is killed")
            await self._start(name)

    async def _power(self) -> None:
        both = [ROUTER, PLANNER]
        names = self._rnd.choice([both, both[:1], both[1:], [*both, *self._workers]])
        async with self._alone(*names):
            await asyncio.gather(*(self._processes.kill(name) for name in names))
            for name in names:
                set_back(self._processes.site.data(name))
            await self._for(DOWN_S, f"no power for {' '.join(names)}")
            for name in names:
                await self._start(name)

    async def _start(self, name: str) -> None:
        if self._processes.pid(name) is None:  # who supervises it may have been quicker
            await self._processes.start(name)

    async def _freeze(self) -> None:
        name = self._rnd.choice([ROUTER, PLANNER, *self._workers])
        async with self._alone(name):
            self._processes.freeze(name, True)
            await self._for(FROZEN_S, f"{name} is frozen")
            self._processes.freeze(name, False)

    async def _cut(self) -> None:
        host = self._processes.site.hosts[self._rnd.choice(["office", "robots"])]
        async with self._alone(f"cable {host.name}"):
            host.cut()
            await self._for(CUT_S, f"the cable of {host.name} is out")
            host.mend()

    async def _clock(self) -> None:
        name = self._rnd.choice([PLANNER, *self._workers])
        async with self._alone(f"clock {name}"):
            ahead_s = self._rnd.choice(AHEAD_S)
            self._processes.site.set_clock(name, ahead_s)
            await self._for(SHIFTED_S, f"the clock of {name} is {ahead_s:+g} s ahead")
            self._processes.site.set_clock(name, 0.0)

    async def _disk(self) -> None:
        name = self._rnd.choice([ROUTER, PLANNER, *self._workers])
        async with self._alone(f"disk {name}"):
            self._processes.site.fill(name)
            await self._for(FULL_S, f"the disk of {name} is full")
            self._processes.site.free(name)

    async def _stop(self) -> None:
        async with self._alone("stop"):
            name = ""

            def said(_robot: str) -> None:
                return None

            try:
                outcome = await give_stop(
                    self._session, (), "chaos", "is it safe?", CONFIRMED_WITHIN_S, said
                )
            except (SchemaError, CliError):
                return
            name = outcome.stop.stop
            if outcome.unstored is None:
                self._judge.stopped(name)
            await self._for(STOPPED_S, f"stop, confirmed by {' '.join(outcome.confirmed) or None}")
            self._judge.released()
            while True:
                with suppress(SchemaError):
                    await self._session.delete(STOP, StopAddress(name))
                    return
                await asyncio.sleep(0.2)
