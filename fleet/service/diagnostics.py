"""What is wrong with the planner now, on keys that people look at."""

from __future__ import annotations

import time

from fleet.core.effects import Publish, Retract
from fleet.core.events import Event
from fleet.service.event_translation import key_behind
from fleet.service.outbox import Outbox
from keyexpr_schema.keyspace import DIAGNOSTIC
from keyexpr_schema.payloads.system import Diagnostic, DiagnosticAddress
from keyexpr_schema.transport.session import Session

STORE, CORE, DISK, LIMITS = "store", "core", "disk", "limits"
"""What is checked: whether the store can be read, whether the core handles what comes, whether
there is room for what the planner keeps, and whether something waits because there is too much."""


class Diagnostics:
    """The planner's diagnostics; those of an earlier run end with `start`."""

    def __init__(self, session: Session, outbox: Outbox) -> None:
        self._session, self._outbox = session, outbox
        self._component = session.config.component
        self._found: dict[str, Diagnostic] = {}

    async def start(self) -> None:
        """Take back what an earlier run said and this one has not."""
        for address in await self._session.list(DIAGNOSTIC, component=self._component):
            if address.check not in self._found:
                self._outbox.send([Retract(DIAGNOSTIC, address)])

    def store(self, trouble: str | None) -> None:
        """What is stored cannot be read, for this reason, or (None) can be again."""
        told = None if trouble is None else f"the planner cannot read what is stored: {trouble}"
        self._tell_or_end(STORE, told)

    def disk(self, sentence: str | None) -> None:
        """There is no room for what the planner keeps, or (None) there is again."""
        self._tell_or_end(DISK, sentence)

    def limits(self, sentence: str | None) -> None:
        """There is more than is taken in at a time, or (None) there is not any more."""
        self._tell_or_end(LIMITS, sentence)

    def _tell_or_end(self, check: str, sentence: str | None) -> None:
        if sentence is not None:
            self._tell(check, sentence)
        elif self._found.pop(check, None) is not None:
            self._outbox.send([Retract(DIAGNOSTIC, DiagnosticAddress(self._component, check))])

    def set_aside(self, event: Event, reason: str) -> None:
        """An event could not be handled. Where a value led to it, the value is reported."""
        behind = key_behind(event)
        if behind is not None:
            key, address, value = behind
            what = f"the planner cannot handle this value and has set it aside: {reason}"
            self._session.report_unusable(key, address, value, what)
        else:
            what = f"{type(event).__name__} could not be handled and was set aside: {reason}"
            self._tell(CORE, what)

    def _tell(self, check: str, sentence: str) -> None:
        known = self._found.get(check)
        found = Diagnostic(
            component=self._component,
            check=check,
            sentence=sentence,
            since_s=known.since_s if known else time.time(),
            count=known.count + 1 if known else 1,
        )
        self._found[check] = found
        address = DiagnosticAddress(self._component, check)
        self._outbox.send([Publish(DIAGNOSTIC, address, found)])
