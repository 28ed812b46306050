"""Keeps a simulated world to the closures that people have put, each until its time is over."""

from __future__ import annotations

from math import inf

from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.transport.session import Watch
from sim.backend import Backend


class ClosedWays:
    """The closures of a realm, as the drivers of one world obey them."""

    def __init__(self, backend: Backend) -> None:
        self._backend = backend
        self._closures: dict[str, Closure] = {}
        self._next_s = inf
        """When the first of them is over [s]."""

    async def follow(self, watch: Watch) -> None:
        """Obey what a watch on the closures tells, until cancelled."""
        async for change in watch:
            if isinstance(change.value, Closure):
                self._closures[change.address.closure] = change.value
            else:
                self._closures.pop(change.address.closure, None)
            self._obey()

    def look_at_clock(self) -> None:
        """Open what is closed no longer."""
        if self._backend.time_s >= self._next_s:
            self._obey()

    def _obey(self) -> None:
        now_s = self._backend.time_s
        standing = [c for _, c in sorted(self._closures.items()) if not c.is_over(now_s)]
        ends = [c.until_s for c in standing if c.until_s is not None]
        self._next_s = min(ends, default=inf)
        self._backend.close(standing)
