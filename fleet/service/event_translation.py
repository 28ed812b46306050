"""From changes on keys to events of the core."""

from __future__ import annotations

from typing import Any

from msgspec.structs import asdict

from fleet.core import events
from fleet.core.events import At, Event
from keyexpr_schema.key import Address, Key, Payload
from keyexpr_schema.keyspace import (
    CLOSURE,
    CONTROL_REQUEST,
    FACT,
    GOAL_SPEC,
    HOLD,
    OBJECT,
    PLACE,
    PLAN_PROPOSAL,
    PLAN_REQUEST,
    REPLAN_REQUEST,
    REPORT,
    ROBOT_SPEC,
    SCHEDULE_SPEC,
    STATEMENT,
    STOP,
    STOP_RELEASE,
)
from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.schedules import Schedule
from keyexpr_schema.transport.watch import Change

_PUT: dict[Key[Any, Any], tuple[type[Event], str]] = {
    STOP: (events.StopPut, "stop"),
    HOLD: (events.HoldPut, "hold"),
    CLOSURE: (events.ClosurePut, "closure"),
    STOP_RELEASE: (events.StopReleased, "release"),
    PLACE: (events.PlacePut, "place"),
    OBJECT: (events.ObjectPut, "object"),
    ROBOT_SPEC: (events.RobotRegistered, "spec"),
    STATEMENT: (events.StatementPut, "statement"),
    FACT: (events.FactPut, "fact"),
    GOAL_SPEC: (events.GoalPut, "goal"),
    SCHEDULE_SPEC: (events.SchedulePut, "schedule"),
    REPORT: (events.ReportReceived, "report"),
    PLAN_PROPOSAL: (events.PlanProposed, "plan"),
    PLAN_REQUEST: (events.PlanRequested, "request"),
    REPLAN_REQUEST: (events.ReplanRequested, "request"),
    CONTROL_REQUEST: (events.ControlRequested, "request"),
}
"""The event that a value means, and its field that has the value."""
_DELETED: dict[Key[Any, Any], type[Event]] = {
    GOAL_SPEC: events.GoalDeleted,
    SCHEDULE_SPEC: events.ScheduleDeleted,
    FACT: events.FactDeleted,
    STATEMENT: events.StatementDeleted,
    PLACE: events.PlaceDeleted,
    OBJECT: events.ObjectDeleted,
    ROBOT_SPEC: events.RobotUnregistered,
    HOLD: events.HoldDeleted,
    CLOSURE: events.ClosureDeleted,
    STOP: events.StopDeleted,
    STOP_RELEASE: events.StopReleaseDeleted,
}
"""The event that a deletion means; it has the fields of the address."""
_KEY_OF_DELETED = {kind: key for key, kind in _DELETED.items()}
_KEYS = {kind: (key, field) for key, (kind, field) in _PUT.items()}
WATCHED = tuple(_PUT)
"""Keys the planner listens to; names come before the sentences that use them."""


def event_of(change: Change[Any, Any], at: At) -> Event | None:
    """The event that a change means, or `None` if it means nothing to the planner.

    A payload that speaks of another address than its own key's is ignored: keys are the truth.
    """
    if change.value is None:
        deleted = _DELETED.get(change.key)
        return None if deleted is None else deleted(**asdict(change.address), **at)
    for field in change.address.__struct_fields__:
        if getattr(change.value, field, None) != getattr(change.address, field):
            return None
    kind, field = _PUT[change.key]
    said = {"received": change.received} if change.key.by_receipt and change.received else {}
    return kind(**{field: change.value}, **said, **at)


def zone_in(value: Payload | None) -> str | None:
    """The time zone that a goal or a schedule speaks of, if it speaks of one."""
    goal = value.goal if isinstance(value, Schedule) else value
    return goal.zone if isinstance(goal, Goal) else None


def key_behind(event: Event) -> tuple[Key[Any, Any], Address, Payload] | None:
    """The key that an event came from, and the value there; None: from none, or it was deleted."""
    found = _KEYS.get(type(event))
    if found is None:
        return None
    key, field = found
    value = getattr(event, field)
    return key, key.address(*(getattr(value, f) for f in key.address.__struct_fields__)), value


def address_of(event: Event) -> tuple[Key[Any, Any], Address, Payload | None] | None:
    """The key that an event came from, and the value there; without one, it was deleted."""
    key = _KEY_OF_DELETED.get(type(event))
    if key is None:
        return key_behind(event)
    names = key.address.__struct_fields__
    return key, key.address(*(getattr(event, name) for name in names)), None
