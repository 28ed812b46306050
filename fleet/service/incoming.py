"""Where the core's events come from: keys, tokens, timers, and whoever has one to put."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any

from fleet.core import events
from fleet.core.events import Event
from fleet.core.state import State
from fleet.service.audit_trail import AuditTrail
from fleet.service.charge import Charge
from fleet.service.event_translation import event_of, zone_in
from fleet.service.fleet_clock import FleetClock
from fleet.service.inbox import Inbox
from fleet.service.leases import Leases
from fleet.service.timers import Timers
from fleet.service.zones_told import ZonesTold
from keyexpr_schema.keyspace import DELETION, PLANNER_STATUS, SIM_CLOCK
from keyexpr_schema.transport.session import Change, TokenChange


class Incoming:
    """Makes an event of each change of a key or a token, in turns (`Inbox`), and of time that has
    come. `charge`, `leases` and `audit` hear of what is theirs.

    While it is not yet `live`, what is read was said before: reports set no clock.
    """

    def __init__(
        self,
        state: Callable[[], State],
        clock: FleetClock,
        charge: Charge,
        leases: Leases,
        audit: AuditTrail,
        limits: Callable[[str | None], None],
    ) -> None:
        """`state` is what the planner knows now; `limits` hears how many goals have to wait."""
        self._state, self._clock = state, clock
        self._charge, self._leases, self._audit = charge, leases, audit
        self._inbox = Inbox(lambda: state().goals, limits)
        self._timers, self._zones = Timers(), ZonesTold()
        self.live = False

    def put(self, event: Event) -> None:
        """Take in an event that nothing outside has led to."""
        self._inbox.put_nowait(event)

    async def next(self) -> Event:
        """The next event, as soon as there is one, or a timer of the state has run out."""
        timer_s = self._timers.next(self._state())
        try:
            async with asyncio.timeout(None if timer_s is None else timer_s - time.monotonic()):
                return await self._inbox.get()
        except TimeoutError:
            self._timers.fired(time.monotonic())
            return events.TimerFired(**self._clock.at())

    def waiting(self) -> Event | None:
        """The next event that has come already, if there is one."""
        return self._inbox.get_nowait()

    def change(self, change: Change[Any, Any]) -> None:
        """Take in a change of a key.

        Raises:
            Superseded: it says that another planner is in charge.
        """
        if change.key is SIM_CLOCK:
            if change.value is not None:
                self._clock.ticked(change.value.time_s)
                if self._timers.rings(self._state(), change.value.time_s):
                    self._inbox.put_nowait(events.TimerFired(**self._clock.at()))
        elif change.key is PLANNER_STATUS:
            self._charge.status_changed(change.value)
        elif change.key is DELETION:
            self._audit.announced(change.address, change.value)
        elif (event := event_of(change, self._clock.at())) is not None:
            if isinstance(event, events.ReportReceived):
                report = event.report
                self._charge.reported(report)
                if self.live:
                    self._clock.reported(report.ended_s or report.started_s or 0.0)
            if (zone := self._zones.news(zone_in(change.value), self._clock.at())) is not None:
                self._inbox.put_nowait(zone)
            self._inbox.put_nowait(event, change.timestamp.partition("/")[2])

    def token(self, token: TokenChange[Any]) -> None:
        """A run of a robot's worker came, or went away."""
        kind = events.WorkerConnected if token.alive else events.WorkerDisconnected
        robot, incarnation = token.address.robot, token.address.incarnation
        self._leases.seen(robot, incarnation, token.alive)
        self._inbox.put_nowait(kind(robot=robot, incarnation=incarnation, **self._clock.at()))
