"""How goals of the planner's own wait for a plan, and what has one tried again that was in vain."""

from __future__ import annotations

from collections.abc import Iterable

from msgspec.structs import replace

from fleet.core.indexes.fleet_index import carried_by
from fleet.core.indexes.touches import Part, Touch
from fleet.core.state import State
from keyexpr_schema.facts import CHARGE, FactKey, Value
from keyexpr_schema.payloads.world import Fact

AT_ONCE = -1
"""In `State.waiting_for_robots`: planned without being asked for, whatever the team is."""
KEPT_SINCE_LOGIC = 8
"""Before, one was forgotten that was to go into a plan which was cancelled, and given up like any
other; and one that was in vain waited for other robots or ways only."""


def is_own(state: State, goal: str) -> bool:
    """Whether the planner has made a goal itself, and not for one that somebody has put."""
    status = state.goal_states.get(goal)
    return status is not None and status.own and status.part_of is None


def tried_again_after(state: State, key: FactKey, old: Fact | None, new: Fact | None) -> State:
    """What is about a thing or a robot that is elsewhere now, or has been charged, may go now. That
    a charge falls changes nothing for the better."""
    was, now = (None if fact is None else fact.value for fact in (old, new))
    if was == now:
        return state
    if key.relation == CHARGE and _percent(now) <= _percent(was):
        return state
    robot = key.subject in state.robots
    return tried_again(state, carried_by(state.index, key.subject) if robot else (key.subject,))


def tried_again(state: State, names: Iterable[str]) -> State:
    """With what is about any of these, and was in vain, to be planned at once; and once more, where
    a plan is being made for it now that does not know of it, if that should be in vain."""
    if state.logic < KEPT_SINCE_LOGIC:
        return state
    waiting, touches, unknowing = state.waiting_for_robots, state.touches, False
    for name in names:
        for goal in sorted(state.index.goals_about.get(name, ())):
            if not is_own(state, goal):
                continue
            if waiting.get(goal, AT_ONCE) != AT_ONCE:
                waiting = waiting.set(goal, AT_ONCE)
                touches = touches.and_(Touch(Part.GOAL, goal))
            plans = (state.plans[plan] for plan in state.index.plans_of.get(goal, ()))
            unknowing = unknowing or any(entry.job is not None for entry in plans)
    if unknowing:  # as if another robot had come meanwhile
        state = replace(state, team_number=state.team_number + 1)
    if waiting is state.waiting_for_robots:
        return state
    return replace(state, waiting_for_robots=waiting, touches=touches)


def _percent(said: Value) -> float:
    known = isinstance(said, int | float) and not isinstance(said, bool)
    return float(said) if known else 0.0  # type: ignore[arg-type]
