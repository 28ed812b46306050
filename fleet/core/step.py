"""The planner's pure core: `step(state, event)` gives the next state and effects.

It is total: whatever the outside world sends, it returns. It asks no clock and opens no socket;
time comes in with the events. So a journal of events replays to the same state and effects.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from msgspec.structs import replace

from fleet.core import events
from fleet.core.clocks import at_time_of, with_clock_of_new_run
from fleet.core.dispatch import dispatcher
from fleet.core.effects import Effect, effects_between
from fleet.core.events import Event
from fleet.core.handlers import (
    closures,
    goals,
    holds,
    plan_results,
    prior_state,
    reports,
    requests,
    robots,
    schedules,
    statements,
    stops,
    world,
)
from fleet.core.indexes.touches import UNTOUCHED, Part, Touch
from fleet.core.over import SINCE_LOGIC, everything_perhaps_over, let_go
from fleet.core.state import State
from fleet.core.state_updates import (
    touch,
)


def _planner_started(state: State, event: events.PlannerStarted) -> State:
    if state.logic < SINCE_LOGIC <= event.logic:
        state = everything_perhaps_over(state)
    state = with_clock_of_new_run(state, event)
    started = replace(
        state,
        epoch=event.epoch,
        incarnation=event.incarnation,
        policy=event.policy,
        skills=state.skills if event.skills is None else event.skills,
        logic=event.logic,
        lineage=state.lineage or event.lineage,
    )
    if started.skills != state.skills:
        started = started.reindexed()
    for plan in started.index.active:
        started = touch(started, Touch(Part.PLAN, plan))
    return touch(started, Touch(Part.EPOCH))


def _epoch_raised(state: State, event: events.EpochRaised) -> State:
    if event.epoch <= state.epoch:
        return state
    return touch(replace(state, epoch=event.epoch), Touch(Part.EPOCH))


_Handler = Callable[[State, Any], State]
_HANDLERS: dict[type[Event], _Handler] = {
    events.PlannerStarted: _planner_started,
    events.EpochRaised: _epoch_raised,
    events.PriorStateLoaded: prior_state.prior_state_loaded,
    events.TimerFired: lambda state, event: state,
    events.GoalPut: goals.goal_put,
    events.GoalDeleted: goals.goal_deleted,
    events.GoalInterpreted: goals.goal_interpreted,
    events.SchedulePut: schedules.schedule_put,
    events.ScheduleDeleted: schedules.schedule_deleted,
    events.TimeZoneRead: schedules.time_zone_read,
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
    events.StopPut: stops.stop_put,
    events.StopDeleted: stops.stop_deleted,
    events.StopReleased: stops.stop_released,
    events.StopReleaseDeleted: stops.stop_release_deleted,
    events.HoldPut: holds.hold_put,
    events.HoldDeleted: holds.hold_deleted,
    events.ClosurePut: closures.closure_put,
    events.ClosureDeleted: closures.closure_deleted,
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


def step(state: State, event: Event) -> tuple[State, tuple[Effect, ...]]:
    """The state after an event, and what is to be done about it.

    An event that changes nothing gives back the very same state and no effects.
    """
    receipt: int = getattr(event, "received", 0)
    last = max(state.last_received, receipt)
    now = replace(at_time_of(state, event), over=(), receipt=receipt, last_received=last)
    handled = _HANDLERS[type(event)](now, event)
    settled = let_go(dispatcher.advance(handled))
    if settled is now and now.era == state.era:
        return state, ()
    touches = settled.touches.since(UNTOUCHED)
    settled = replace(settled, touches=UNTOUCHED, receipt=0)
    return settled, effects_between(state, settled, touches)


def replay(journal: Iterable[Event], state: State | None = None) -> State:
    """The state after all events of a journal."""
    now = State() if state is None else state
    for event in journal:
        now, _ = step(now, event)
    return now
