"""Who has done what: from what people put and delete to entries of the audit log.

What machines write of themselves (facts of robots, reports) is not in it, nor what was known
before.
"""

from __future__ import annotations

import asyncio
import hashlib
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import datetime
from typing import Any

import msgspec

from fleet.core.effects import Retract
from fleet.core.events import Event
from fleet.core.model.recurrence import when_shown
from fleet.history.audit_log import AuditLog
from fleet.service.event_translation import address_of
from fleet.service.outbox import Outbox
from fleet.service.time_zones import zones_of
from keyexpr_schema.key import Address, Key, Payload
from keyexpr_schema.keyspace import AUDIT, DELETION, REPORT, RETIREMENT
from keyexpr_schema.payloads.audit import (
    AuditAction,
    AuditEntry,
    AuditPage,
    AuditQuery,
    Deletion,
    DeletionAddress,
)
from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.history import Retired, RetireQuery
from keyexpr_schema.payloads.holds import Hold
from keyexpr_schema.payloads.plans import Plan
from keyexpr_schema.payloads.requests import Control, ControlRequest, PlanRequest, ReplanRequest
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.schedules import Schedule
from keyexpr_schema.payloads.stops import Stop, StopRelease
from keyexpr_schema.payloads.system import PlannerAddress
from keyexpr_schema.payloads.world import PERSON_SOURCE, Fact, Object, Place, Statement
from keyexpr_schema.transport.session import Session

ANNOUNCED_S = 600.0
"""A deletion that has not come so long after it was announced [s] is not waited for."""


class AuditTrail:
    """What one run of the planner writes into the audit log, and answers from it."""

    def __init__(self, session: Session, log: AuditLog, outbox: Outbox) -> None:
        self._session, self._log, self._outbox = session, log, outbox
        self._announced: dict[str, Deletion] = {}
        """By the key expression that is about to be deleted."""
        self._replayed: list[Event] = []

    @asynccontextmanager
    async def answered(self) -> AsyncIterator[None]:
        """Answer questions until the block ends."""
        async with self._session.serve(AUDIT, self._page):
            yield

    async def _page(self, _: PlannerAddress, query: AuditQuery) -> AuditPage:
        return await asyncio.to_thread(self._log.page, query)

    def sync(self) -> None:
        """Have it on disk, as before a snapshot that knows nothing of it is kept."""
        self._log.sync()

    def replayed(self, event: Event) -> None:
        """An event of the journal, which an earlier run may not have written down."""
        self._replayed.append(event)

    def write_replayed(self) -> None:
        """Write them down, now that it is known who has announced what."""
        events, self._replayed = self._replayed, []
        for event in events:
            self.heard(event)
        for key, deletion in list(self._announced.items()):
            if self._log.has_deletion(key, deletion.wall_time_s):
                self._forget(key)

    def announced(self, address: DeletionAddress, deletion: Deletion | None) -> None:
        """Somebody says what he is about to delete."""
        if deletion is None:
            return
        for key, known in list(self._announced.items()):
            if time.time() - known.wall_time_s > ANNOUNCED_S:
                self._forget(key)
        if time.time() - deletion.wall_time_s <= ANNOUNCED_S:
            self._announced[deletion.key] = deletion
        else:
            self._outbox.send([Retract(DELETION, address)])

    def _forget(self, key: str) -> Deletion | None:
        deletion = self._announced.pop(key, None)
        if deletion is not None:
            self._outbox.send([Retract(DELETION, DeletionAddress(deletion.deletion))])
        return deletion

    def heard(self, event: Event) -> None:
        """Something has happened that was not known before: written down if a person did it."""
        found = address_of(event)
        if found is None or found[0] is REPORT or not _by_a_person(found[2]):
            return
        key, address, value = found
        keyexpr = key.build(address)
        by = _who(value)
        if value is None:
            deletion = self._announced.get(keyexpr)
            by = "" if deletion is None else deletion.by
        self._add(
            event.time_s,
            event.wall_time_s,
            by=by,
            action=AuditAction.DELETED if value is None else AuditAction.PUT,
            key=keyexpr,
            summary=_summary(key, address, value),
            digest="" if value is None else _digest(value),
        )

    def retired(
        self, query: RetireQuery, gone: Retired, *, time_s: float, wall_time_s: float, **_: float
    ) -> None:
        """Somebody has had keys deleted of what is over."""
        if gone.plans or gone.goals:
            self._add(
                time_s,
                wall_time_s,
                by=query.by,
                action=AuditAction.DELETED,
                key=RETIREMENT.build(PlannerAddress()),
                summary=f"deleted the keys of {gone.plans} plans and {gone.goals} goals that ended",
                digest=str(wall_time_s),
            )

    def _add(self, time_s: float, wall_time_s: float, **fields: Any) -> None:
        at = datetime.fromtimestamp(wall_time_s).astimezone().isoformat(timespec="milliseconds")
        self._log.add(AuditEntry(at=at, wall_time_s=wall_time_s, time_s=time_s, **fields))


def _by_a_person(value: Payload | None) -> bool:
    return not isinstance(value, Fact) or bool(value.by) or value.source == PERSON_SOURCE


def _who(value: Payload | None) -> str:
    if isinstance(value, Schedule):
        value = value.goal
    names = (getattr(value, name, "") for name in ("said_by", "proposed_by", "by"))
    return next((name for name in names if isinstance(name, str) and name), "")


def _digest(value: Payload) -> str:
    return hashlib.sha256(msgspec.json.encode(value)).hexdigest()[:16]


def _summary(key: Key[Any, Any], address: Address, value: Payload | None) -> str:
    names = " ".join(str(getattr(address, name)) for name in address.__struct_fields__)
    what = key.name.removesuffix("_spec").replace("_", " ")
    if value is None:
        return f"deleted {what} {names}"
    return f"{what} {names}: {said}" if (said := _said(value)) else f"{what} {names}"


def _said(value: Payload) -> str:
    match value:
        case Goal():
            due = "" if value.due_s is None else when_shown(value, value.due_s, zones_of(value))
            due = f", due {due}" if due else ""
            return f"“{value.text}”, priority {value.priority}{due}"
        case Schedule():
            return f"“{value.goal.text}”, {value.goal.every or 'as often as it says'}"
        case Statement():
            return f"“{value.text}”"
        case Fact():
            return str(value.literal)
        case Hold():
            whom = ", ".join((*value.robots, *value.plans, *value.schedules))
            return f"{whom or 'everything'} {value}"
        case Stop():
            whom = ", ".join(value.robots) or "all robots"
            return f"{whom} stopped" + (f" ({value.reason})" if value.reason else "")
        case StopRelease():
            return f"{value.robot} may move again"
        case Closure():
            return str(value)
        case RobotSpec():
            return f"model {value.model}"
        case Object() | Place():
            return value.label
        case Plan():
            return f"proposed, {len(value.tasks)} tasks"
        case PlanRequest():
            dry = " (a dry run)" if value.dry_run else ""
            return f"plan for {', '.join(value.goals) or 'what waits'}{dry}"
        case ReplanRequest():
            return f"plan {value.plan} again: {value.reason}"
        case ControlRequest(control=Control.TASK_DONE):
            why = f" ({value.reason})" if value.reason else ""
            return f"says that task {value.task} of plan {value.plan} was done by hand{why}"
        case ControlRequest(control=Control.ADD_TASK):
            return f"add a task ({value.skill}) to plan {value.plan}"
        case ControlRequest():
            why = f" ({value.reason})" if value.reason else ""
            return f"{value.control.value} plan {value.plan}{why}"
    return ""
