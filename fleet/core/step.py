"""The pure heart of the planner: `step(state, event, skills)` gives the next state and effects.

It is total: whatever the outside world sends, it returns. It asks no clock and opens no socket;
time comes in with the events. So a journal of events replays to the same state and effects.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from msgspec.structs import replace

from fleet.core import events
from fleet.core.dispatch import dispatcher, replan_triggers
from fleet.core.effects import Effect, effects_between
from fleet.core.events import Event
from fleet.core.handlers import goals, plan_results, reports, requests
from fleet.core.model.preconditions import Skills
from fleet.core.state import State

_NEWS: dict[type[Event], Callable[[State, Any], State]] = {
    events.GoalPut: goals.goal_put,
    events.GoalDeleted: goals.goal_deleted,
    events.FactDeleted: goals.fact_deleted,
    events.StatementPut: goals.statement_put,
    events.StatementDeleted: goals.statement_deleted,
    events.PlacePut: goals.place_put,
    events.PlaceDeleted: goals.place_deleted,
    events.ObjectPut: goals.object_put,
    events.ObjectDeleted: goals.object_deleted,
    events.RobotRegistered: goals.robot_registered,
    events.RobotUnregistered: goals.robot_unregistered,
    events.WorkerConnected: goals.worker_connected,
    events.WorkerDisconnected: goals.worker_disconnected,
    events.PriorStateLoaded: goals.prior_state_loaded,
    events.GoalInterpreted: goals.goal_interpreted,
    events.PlanRequested: requests.plan_requested,
    events.ReplanRequested: requests.replan_requested,
    events.ControlRequested: requests.control_requested,
    events.PlanProposed: requests.plan_proposed,
    events.PlanningFailed: plan_results.planning_failed,
}


def step(state: State, event: Event, skills: Skills) -> tuple[State, tuple[Effect, ...]]:
    """The state after an event, and what is to be done about it.

    An event that changes nothing gives back the very same state and no effects.
    """
    now = replace(
        state,
        time_s=max(state.time_s, event.time_s),
        wall_time_s=max(state.wall_time_s, event.wall_time_s),
    )
    told = _take_in(now, event, skills)
    settled = dispatcher.advance(told, skills)
    if settled is now:
        return state, ()
    return settled, effects_between(state, settled)


def _take_in(state: State, event: Event, skills: Skills) -> State:
    match event:
        case events.PlannerStarted():
            return replace(
                state, epoch=event.epoch, incarnation=event.incarnation, policy=event.policy
            )
        case events.PlanningSucceeded():
            return plan_results.planning_succeeded(state, event, skills)
        case events.FactPut():
            return replan_triggers.fact_put(state, event, skills)
        case events.ReportReceived():
            return reports.report_received(state, event, skills)
        case events.TimerFired():
            return state
    return _NEWS[type(event)](state, event)


def replay(journal: Iterable[Event], skills: Skills, state: State | None = None) -> State:
    """The state after all events of a journal."""
    now = State() if state is None else state
    for event in journal:
        now, _ = step(now, event, skills)
    return now
