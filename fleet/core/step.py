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
    events.GoalTold: goals.goal_told,
    events.GoalForgotten: goals.goal_forgotten,
    events.FactForgotten: goals.fact_forgotten,
    events.StatementTold: goals.statement_told,
    events.StatementForgotten: goals.statement_forgotten,
    events.PlaceTold: goals.place_told,
    events.PlaceForgotten: goals.place_forgotten,
    events.ObjectTold: goals.object_told,
    events.ObjectForgotten: goals.object_forgotten,
    events.RobotTold: goals.robot_told,
    events.RobotForgotten: goals.robot_forgotten,
    events.RobotSeen: goals.robot_seen,
    events.RobotGone: goals.robot_gone,
    events.Remembered: goals.remembered,
    events.GoalInterpreted: goals.goal_interpreted,
    events.PlanAsked: requests.plan_asked,
    events.ReplanAsked: requests.replan_asked,
    events.ControlAsked: requests.control_asked,
    events.PlanProposed: requests.plan_proposed,
    events.PlanNotMade: plan_results.plan_not_made,
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
        case events.PlanMade():
            return plan_results.plan_made(state, event, skills)
        case events.FactTold():
            return replan_triggers.fact_told(state, event, skills)
        case events.ReportTold():
            return reports.report_told(state, event, skills)
        case events.TimePassed():
            return state
    return _NEWS[type(event)](state, event)


def replay(journal: Iterable[Event], skills: Skills, state: State | None = None) -> State:
    """The state after all events of a journal."""
    now = State() if state is None else state
    for event in journal:
        now, _ = step(now, event, skills)
    return now
