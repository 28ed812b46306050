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
from fleet.core.effects import Effect, all_touches, effects_between
from fleet.core.events import Event
from fleet.core.handlers import goals, plan_results, reports, requests, robots, statements, world
from fleet.core.over import SINCE_LOGIC, everything_perhaps_over, let_go
from fleet.core.state import State
from fleet.core.state_updates import touch
from fleet.core.table import Table
from fleet.core.touches import UNTOUCHED, Part, Touch
from keyexpr_schema.payloads.goals import ENDED_GOALS


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


def _prior_state_loaded(state: State, event: events.PriorStateLoaded) -> State:
    """Take over what an earlier planner left, so that nothing is done a second time."""
    answers = {answer.request: answer for answer in event.answers}
    goals = {status.goal: status for status in event.goals if status.state in ENDED_GOALS}
    state = replace(
        state,
        answers=Table({**answers, **state.answers}),
        durations={**{known.model: known for known in event.durations}, **state.durations},
        goal_states=Table({**goals, **state.goal_states}),
        statement_states=Table(
            {**{status.statement: status for status in event.statements}, **state.statement_states}
        ),
        past_plans=(*state.past_plans, *(p for p in event.plans if p not in state.plans)),
    )
    for touched in all_touches(State(), state):
        state = touch(state, touched)
    return state


_Handler = Callable[[State, Any], State]
_HANDLERS: dict[type[Event], _Handler] = {
    events.PlannerStarted: _planner_started,
    events.PriorStateLoaded: _prior_state_loaded,
    events.TimerFired: lambda state, event: state,
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


def step(state: State, event: Event) -> tuple[State, tuple[Effect, ...]]:
    """The state after an event, and what is to be done about it.

    An event that changes nothing gives back the very same state and no effects.
    """
    now = replace(at_time_of(state, event), over=())
    handled = _HANDLERS[type(event)](now, event)
    settled = let_go(dispatcher.advance(handled))
    if settled is now and now.era == state.era:
        return state, ()
    touches = settled.touches.since(UNTOUCHED)
    settled = replace(settled, touches=UNTOUCHED)
    return settled, effects_between(state, settled, touches)


def replay(journal: Iterable[Event], state: State | None = None) -> State:
    """The state after all events of a journal."""
    now = State() if state is None else state
    for event in journal:
        now, _ = step(now, event)
    return now
