"""The clocks in the state: the fleet's, which may be set back, and one that nobody sets.

A simulation that is started anew begins at 0, and a host's clock may be put right. From there on it
is another *era*: what is said in it is newer than anything of before, whatever its time, and what
is under way counts as begun with it.
"""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from fleet.core.events import Event
from fleet.core.standing import with_times
from fleet.core.state import State
from fleet.core.state_updates import (
    set_entry,
    set_goal,
    set_spec,
)
from fleet.core.table import Table
from keyexpr_schema.payloads.tasks import TaskState

SINCE_LOGIC = 1
"""Before this logic of the core, the fleet's clock never went back."""
SET_BACK_S = 5.0
"""A clock that is further behind than this [s] was set back; less is two messages in another order,
or a host's clock that is put right by a little."""
_ANSWERS = (events.PlanningSucceeded, events.PlanningFailed, events.GoalInterpreted)
"""They may bear the time of what they answer."""


def at_time_of(state: State, event: Event) -> State:
    """The state at the time of an event, in a new era if need be."""
    reading_s = event.wall_time_s if event.monotonic_s is None else event.monotonic_s
    back = event.time_s < state.time_s - SET_BACK_S and not isinstance(event, _ANSWERS)
    if back and state.logic >= SINCE_LOGIC:
        state = _new_era(state, event)
    return replace(
        state,
        time_s=max(state.time_s, event.time_s),
        wall_time_s=max(state.wall_time_s, event.wall_time_s),
        monotonic_s=max(state.monotonic_s, reading_s),
        over=(),
    )


def with_clock_of_new_run(state: State, event: events.PlannerStarted) -> State:
    """A new run of the planner waits anew for robots that are away."""
    if event.monotonic_s is None:
        return state
    gone = Table(dict.fromkeys(state.gone_since, event.monotonic_s))
    return replace(state, monotonic_s=event.monotonic_s, gone_since=gone)


def _new_era(state: State, event: Event) -> State:
    before_s = state.time_s
    state = replace(
        state,
        era=state.era + 1,
        time_s=event.time_s,
        wall_time_s=event.wall_time_s,
        older_facts=Table(dict.fromkeys(state.facts)),
    )
    state = _with_later_goals_shifted(state, event.time_s - before_s)
    for entry in state.plans.values():
        running = {
            name: replace(record, started_s=event.time_s)
            for name, record in entry.records.items()
            if record.state is TaskState.RUNNING
        }
        if running:
            state = set_entry(state, replace(entry, records=entry.records.updated(running)))
    return state


def _with_later_goals_shifted(state: State, by_s: float) -> State:
    """What is for later is as far ahead as it was before the clock was set back."""
    for name in with_times(state):
        goal, status = state.goals[name], state.goal_states[name]
        assert status.next_s is not None
        times = {
            field: at_s + by_s
            for field in ("said_s", "not_before_s", "due_s")
            if (at_s := getattr(goal, field)) is not None
        }
        state = set_spec(state, state.goal_specs.get(name, goal), replace(goal, **times))
        waits = tuple(
            each if each.due_s is None else replace(each, due_s=each.due_s + by_s)
            for each in status.waits_for
        )
        queued_s = tuple(at_s + by_s for at_s in status.queued_s)
        next_s = status.next_s + by_s
        state = set_goal(state, replace(status, next_s=next_s, queued_s=queued_s, waits_for=waits))
    return state
