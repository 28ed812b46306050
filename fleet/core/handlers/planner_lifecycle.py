"""The planner itself: a run begins, an earlier planner's documents were read, a timer fired."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from fleet.core.model.skills import Skills
from fleet.core.state import State
from keyexpr_schema.payloads.goals import ENDED_GOALS


def planner_started(state: State, event: events.PlannerStarted, skills: Skills) -> State:
    """The new run's epoch, policy and name hold from now on."""
    return replace(state, epoch=event.epoch, incarnation=event.incarnation, policy=event.policy)


def prior_state_loaded(state: State, event: events.PriorStateLoaded, skills: Skills) -> State:
    """Take over what an earlier planner left, so that nothing is done a second time."""
    answers = {answer.request: answer for answer in event.answers}
    goals = {status.goal: status for status in event.goals if status.state in ENDED_GOALS}
    return replace(
        state,
        answers={**answers, **state.answers},
        durations={**{known.model: known for known in event.durations}, **state.durations},
        goal_states={**goals, **state.goal_states},
        past_plans=(*state.past_plans, *(p for p in event.plans if p not in state.plans)),
    )


def timer_fired(state: State, event: events.TimerFired, skills: Skills) -> State:
    """Time has passed, and that is all."""
    return state
