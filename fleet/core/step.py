"""The planner's pure core: `step(state, event, skills)` gives the next state and effects.

It is total: whatever the outside world sends, it returns. It asks no clock and opens no socket;
time comes in with the events. So a journal of events replays to the same state and effects.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from msgspec.structs import replace

from fleet.core import events
from fleet.core.dispatch import dispatcher
from fleet.core.effects import Effect, effects_between
from fleet.core.events import Event
from fleet.core.handlers import (
    goals,
    plan_results,
    planner_lifecycle,
    reports,
    requests,
    robots,
    statements,
    world,
)
from fleet.core.model.skills import Skills
from fleet.core.state import State

_Handler = Callable[[State, Any, Skills], State]
_HANDLERS: dict[type[Event], _Handler] = {
    events.PlannerStarted: planner_lifecycle.planner_started,
    events.PriorStateLoaded: planner_lifecycle.prior_state_loaded,
    events.TimerFired: planner_lifecycle.timer_fired,
    events.GoalPut: goals.goal_put,
    events.GoalDeleted: goals.goal_deleted,
    events.GoalInterpreted: goals.goal_interpreted,
    events.StatementPut: statements.statement_put,
    events.StatementDeleted: statements.statement_deleted,
    events.FactPut: world.fact_put,
    events.FactDeleted: world.fact_deleted,
    events.PlacePut: world.place_put,
    events.PlaceDeleted: world.place_deleted,
    events.ObjectPut: world.object_put,
    events.ObjectDeleted: world.object_deleted,
    events.RobotRegistered: robots.robot_registered,
    events.RobotUnregistered: robots.robot_unregistered,
    events.WorkerConnected: robots.worker_connected,
    events.WorkerDisconnected: robots.worker_disconnected,
    events.ReportReceived: reports.report_received,
    events.PlanRequested: requests.plan_requested,
    events.ReplanRequested: requests.replan_requested,
    events.ControlRequested: requests.control_requested,
    events.PlanProposed: requests.plan_proposed,
    events.PlanningSucceeded: plan_results.planning_succeeded,
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
    handled = _HANDLERS[type(event)](now, event, skills)
    settled = dispatcher.advance(handled, skills)
    if settled is now:
        return state, ()
    return settled, effects_between(state, settled)


def replay(journal: Iterable[Event], skills: Skills, state: State | None = None) -> State:
    """The state after all events of a journal."""
    now = State() if state is None else state
    for event in journal:
        now, _ = step(now, event, skills)
    return now
