"""Tasks that closures keep robots from, and closures whose time is over."""

from __future__ import annotations

from math import inf

from msgspec.structs import replace

from fleet.core.indexes.touches import Part, Touch
from fleet.core.model.preconditions import action_of
from fleet.core.model.world import WorldModel
from fleet.core.plan_entry import PlanEntry
from fleet.core.replan_reasons import ReplanScope
from fleet.core.state import State
from fleet.core.state_updates import set_entry, touch
from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.tasks import TaskRecord


def kept_from(state: State, record: TaskRecord, world: WorldModel) -> str | None:
    """Why the robot of a task does not get to where that is done; `None` if it does, or may."""
    robot = record.robot
    if not world.closures or robot is None or robot not in world.robots:
        return None
    action = action_of(record, state.skills)
    if action is None or action.skill.travel_to is None:
        return None
    return world.kept_from(robot, action.args[action.skill.travel_to])


def without_closed_ways(state: State, entry: PlanEntry, world: WorldModel) -> PlanEntry:
    """The plan with closures that its robots do not get through as a reason to make it again."""
    index = entry.index
    if entry.ended or entry.cancelling:
        return entry
    kept = {
        record.task: (record, why)
        for record in entry.current()
        if (record.task in index.open or record.task in index.outstanding)
        and record.task not in entry.unwanted
        and (why := kept_from(state, record, world)) is not None
    }
    if not kept:
        return entry
    records = [record for record, _ in kept.values()]
    return entry.to_replan(
        ReplanScope.REPAIR,
        next(why for _, why in kept.values()),
        goals=tuple(record.goal for record in records),
        tasks=tuple(kept),
    )


def opened(state: State, closure: Closure) -> State:
    """Without a closure: whoever waits for robots that get there may have some."""
    state = replace(state, closures=state.closures.without(closure.closure))
    if closure.one_at_a_time:
        return state
    for plan in state.index.active:
        entry = state.plans[plan]
        if entry.hopeless:  # what failed for it need not fail again
            state = set_entry(state, replace(entry, hopeless=()))
    state = replace(state, team_number=state.team_number + 1)
    return touch(state, Touch(Part.TEAM))


def end_closures(state: State) -> State:
    """Without those whose time is over."""
    for closure in state.closures.values():
        if closure.is_over(state.time_s):
            state = opened(state, closure)
    return state


def next_opening_s(state: State) -> float:
    """When the first closure is over, on the fleet's clock [s]; infinite if none ends by itself."""
    ends = (each.until_s for each in state.closures.values() if each.until_s is not None)
    return min(ends, default=inf)
