"""From changes on keys to events of the core."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fleet.core import events
from fleet.core.events import At, Event
from fleet.core.state import State
from keyexpr_schema.key import Key
from keyexpr_schema.keyspace import (
    CONTROL_REQUEST,
    FACT,
    GOAL_SPEC,
    OBJECT,
    PLACE,
    PLAN_PROPOSAL,
    PLAN_REQUEST,
    REPLAN_REQUEST,
    REPORT,
    ROBOT_SPEC,
    STATEMENT,
)
from keyexpr_schema.transport.watch import Change

_PUT: dict[Key[Any, Any], Callable[[Any, At], Event]] = {
    PLACE: lambda v, at: events.PlacePut(place=v, **at),
    OBJECT: lambda v, at: events.ObjectPut(object=v, **at),
    ROBOT_SPEC: lambda v, at: events.RobotRegistered(spec=v, **at),
    STATEMENT: lambda v, at: events.StatementPut(statement=v, **at),
    FACT: lambda v, at: events.FactPut(fact=v, **at),
    GOAL_SPEC: lambda v, at: events.GoalPut(goal=v, **at),
    REPORT: lambda v, at: events.ReportReceived(report=v, **at),
    PLAN_PROPOSAL: lambda v, at: events.PlanProposed(plan=v, **at),
    PLAN_REQUEST: lambda v, at: events.PlanRequested(request=v, **at),
    REPLAN_REQUEST: lambda v, at: events.ReplanRequested(request=v, **at),
    CONTROL_REQUEST: lambda v, at: events.ControlRequested(request=v, **at),
}
_DELETED: dict[Key[Any, Any], Callable[[Any, At], Event]] = {
    GOAL_SPEC: lambda a, at: events.GoalDeleted(goal=a.goal, **at),
    FACT: lambda a, at: events.FactDeleted(subject=a.subject, relation=a.relation, **at),
    STATEMENT: lambda a, at: events.StatementDeleted(statement=a.statement, **at),
    PLACE: lambda a, at: events.PlaceDeleted(place=a.place, **at),
    OBJECT: lambda a, at: events.ObjectDeleted(object=a.object, **at),
    ROBOT_SPEC: lambda a, at: events.RobotUnregistered(robot=a.robot, **at),
}
WATCHED = tuple(_PUT)
"""Keys the planner listens to; names come before the sentences that use them."""


def event_of(change: Change[Any, Any], at: At) -> Event | None:
    """The event that a change means, or `None` if it means nothing to the planner.

    A payload that speaks of another address than its own key's is ignored: keys are the truth.
    """
    if change.value is None:
        make = _DELETED.get(change.key)
        return make(change.address, at) if make else None
    for field in change.address.__struct_fields__:
        if getattr(change.value, field, None) != getattr(change.address, field):
            return None
    return _PUT[change.key](change.value, at)


def missed_deletions(state: State, seen: set[str], at: At) -> list[Event]:
    """Events for what the state knows and a complete listing (`seen`, key expressions) lacks."""
    known: list[tuple[Key[Any, Any], Any]] = [
        *((GOAL_SPEC, GOAL_SPEC.address(goal)) for goal in state.goals),
        *((STATEMENT, STATEMENT.address(name)) for name in state.statements),
        *((STATEMENT, STATEMENT.address(name)) for name in state.statement_states),
        *((PLACE, PLACE.address(place)) for place in state.places),
        *((OBJECT, OBJECT.address(thing)) for thing in state.objects),
        *((ROBOT_SPEC, ROBOT_SPEC.address(robot)) for robot in state.robots),
    ]
    return [_DELETED[key](address, at) for key, address in known if key.build(address) not in seen]
