"""What is done to a fleet while it works. Each fault ends what it began."""

from __future__ import annotations

import asyncio
import time
from collections import defaultdict
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from contextlib import asynccontextmanager, suppress

from benchmarks.chaos.judge import Judge
from benchmarks.chaos.plans import Fault
from benchmarks.chaos.power import set_back
from benchmarks.chaos.site import SiteProcesses
from cli.client.stops import give_stop
from cli.errors import CliError
from keyexpr_schema.errors import SchemaError
from keyexpr_schema.keyspace import STOP
from keyexpr_schema.payloads.stops import StopAddress
from keyexpr_schema.transport.session import Session

CONFIRMED_WITHIN_S = 20.0


class Faults:
    """Carries faults out, as far as they can be had on this site; `did` counts them by kind."""

    def __init__(
        self,
        processes: SiteProcesses,
        session: Session,
        judge: Judge,
        change_mind: Callable[[Fault], Awaitable[bool]],
    ) -> None:
        self._processes, self._session, self._judge = processes, session, judge
        self._began_s = 0.0
        self._busy: defaultdict[str, asyncio.Lock] = defaultdict(asyncio.Lock)
        self._change_mind = change_mind
        self.did: defaultdict[str, int] = defaultdict(int)
        self._kinds: dict[str, Callable[[Fault], Awaitable[bool]]] = {
            "kill": self._kill,
            "freeze": self._freeze,
            "power": self._power,
            "cut": self._cut,
            "clock": self._clock,
            "disk": self._disk,
            "stop": self._stop,
            "cancel": self._cancel,
        }

    async def carry_out(self, faults: Iterable[Fault]) -> None:
        """Each at its moment, over each other; returns when all are over."""
        self._began_s = time.monotonic()

        async def one(fault: Fault) -> None:
            await asyncio.sleep(fault.after_s)
            self.did[fault.kind] += await self._kinds[fault.kind](fault)

        async with asyncio.TaskGroup() as group:
            for fault in faults:
                if fault.kind not in self._processes.site.lacks:
                    group.create_task(one(fault))

    async def _for(self, fault: Fault, what: str) -> bool:
        now_s = time.monotonic() - self._began_s
        print(f"  at {now_s:.1f} s for {fault.lasts_s:.1f} s: {what}", flush=True)
        await asyncio.sleep(fault.lasts_s)
        return True

    @asynccontextmanager
    async def _alone(self, *names: str) -> AsyncIterator[None]:
        for name in sorted(names):
            await self._busy[name].acquire()
        try:
            yield
        finally:
            for name in names:
                self._busy[name].release()

    async def _kill(self, fault: Fault) -> bool:
        (name,) = fault.of
        async with self._alone(name):
            await self._processes.kill(name)
            await self._for(fault, f"{name} is killed")
            await self._start(name)
        return True

    async def _power(self, fault: Fault) -> bool:
        async with self._alone(*fault.of):
            await asyncio.gather(*(self._processes.kill(name) for name in fault.of))
            for name in fault.of:
                set_back(self._processes.site.data(name), self._processes.site.syncs)
            await self._for(fault, f"no power for {' '.join(fault.of)}")
            for name in fault.of:
                await self._start(name)
        return True

    async def _start(self, name: str) -> None:
        if self._processes.pid(name) is None:  # who supervises it may have been quicker
            await self._processes.start(name)

    async def _freeze(self, fault: Fault) -> bool:
        (name,) = fault.of
        async with self._alone(name):
            self._processes.freeze(name, True)
            await self._for(fault, f"{name} is frozen")
            self._processes.freeze(name, False)
        return True

    async def _cut(self, fault: Fault) -> bool:
        host = self._processes.site.hosts[fault.of[0]]
        async with self._alone(f"cable {host.name}"):
            host.cut()
            await self._for(fault, f"the cable of {host.name} is out")
            host.mend()
        return True

    async def _clock(self, fault: Fault) -> bool:
        (name,) = fault.of
        async with self._alone(f"clock {name}"):
            self._processes.site.set_clock(name, fault.ahead_s)
            await self._for(fault, f"the clock of {name} is {fault.ahead_s:+g} s ahead")
            self._processes.site.set_clock(name, 0.0)
        return True

    async def _disk(self, fault: Fault) -> bool:
        (name,) = fault.of
        async with self._alone(f"disk {name}"):
            self._processes.site.fill(name)
            await self._for(fault, f"the disk of {name} is full")
            self._processes.site.free(name)
        return True

    async def _cancel(self, fault: Fault) -> bool:
        async with self._alone("people"):
            try:
                return await self._change_mind(fault)
            except (SchemaError, CliError) as error:
                self._judge.add(f"nothing came of a change of mind: {error}")
                return True

    async def _stop(self, fault: Fault) -> bool:
        async with self._alone("stop"):

            def said(_robot: str) -> None:
                return None

            try:
                outcome = await give_stop(
                    self._session, (), "chaos", "is it safe?", CONFIRMED_WITHIN_S, said
                )
            except (SchemaError, CliError):
                return False
            name = outcome.stop.stop
            if outcome.unstored is None:
                self._judge.stopped(name)
            await self._for(fault, f"stop, confirmed by {' '.join(outcome.confirmed) or None}")
            self._judge.released()
            while True:
                with suppress(SchemaError):
                    await self._session.delete(STOP, StopAddress(name))
                    return True
                await asyncio.sleep(0.2)
