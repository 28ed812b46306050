"""What comes in from keys and tokens: events in the inbox; and who else hears of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fleet.core import events
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
    """Takes in one change after the other, without a pause.

    While it is not yet `live`, what is read was said before: reports set no clock.
    """

    def __init__(
        self,
        state: Callable[[], State],
        inbox: Inbox,
        clock: FleetClock,
        timers: Timers,
        charge: Charge,
        leases: Leases,
        audit: AuditTrail,
    ) -> None:
        """`state` is what the planner knows now."""
        self._state, self._inbox, self._clock, self._timers = state, inbox, clock, timers
        self._charge, self._leases, self._audit = charge, leases, audit
        self._zones = ZonesTold()
        self.live = False

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
