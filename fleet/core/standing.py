"""Goals that stand or are for later: what they constrain, and what others have made."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core.indexes.fleet_index import EMPTY
from fleet.core.state import State
from keyexpr_schema.payloads.goals import ENDED_GOALS, Condition, Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.schedules import Schedule

AFTER_RUNS_SINCE_LOGIC = 6
"""Before, what came after something that is repeated waited for ever."""
EACH_DUE_SINCE_LOGIC = 7
"""Before, what is repeated could not be due."""
_LONGEST_NAME = 56
"""Of what a part is called by, so that there is room for its number [characters]."""


def part_name(goal: str, number: int | str) -> str:
    """What a goal's part of that number is called."""
    return f"{goal[:_LONGEST_NAME]}.{number}"


def is_part(state: State, goal: str) -> bool:
    """Whether another goal has made it: nobody has put it on a key."""
    status = state.goal_states.get(goal)
    return status is not None and status.part_of is not None


def is_put(state: State, goal: str) -> bool:
    """Whether somebody has put it on its key: neither another goal nor the planner has made it, nor
    a schedule."""
    status = state.goal_states.get(goal)
    own = status is not None and status.own
    return not (own or is_part(state, goal) or is_scheduled(state, goal))


def wanted_by(schedule: Schedule) -> Goal:
    """What a schedule wants, as a goal that was put."""
    return replace(schedule.goal, goal=schedule.schedule)


def is_scheduled(state: State, goal: str) -> bool:
    """Whether a goal is what a schedule wants, and not one that somebody has put on its own key."""
    schedule, spec = state.schedules.get(goal), state.goals.get(goal)
    if schedule is None or spec is None:
        return False
    return wanted_by(schedule) == state.goal_specs.get(goal, spec)


def has_ended(state: State, goal: str) -> bool:
    """Whether nothing comes of a goal any more; of one that is not known, neither."""
    status = state.goal_states.get(goal)
    return status is None or status.state in ENDED_GOALS


def goes_on(state: State, goal: str) -> bool:
    """Whether what comes after a goal waits for it: until it has ended, or, as something that is
    repeated never does, until a run of it has."""
    status, spec = state.goal_states.get(goal), state.goals.get(goal)
    if has_ended(state, goal) or status is None:
        return False
    runs = spec is not None and is_repeated(spec) and state.logic >= AFTER_RUNS_SINCE_LOGIC
    return not (runs and status.runs and not status.parts)


def with_times(state: State) -> list[str]:
    """Goals that no plan works on, and with which something happens at a time (`next_s`)."""
    in_state = state.index.in_state
    names = (*in_state.get(GoalState.PENDING, EMPTY), *in_state.get(GoalState.STANDING, EMPTY))
    known = (name for name in names if name in state.goals)
    return sorted(name for name in known if state.goal_states[name].next_s is not None)


def is_repeated(spec: Goal) -> bool:
    """Whether a goal makes one at each of its times, or each time that something comes to hold."""
    return spec.every is not None or bool(spec.whenever)


def run_due_s(spec: Goal, status: GoalStatus, now_s: float) -> float | None:
    """When a run that begins now is due: it has as long as the whole had when it was said."""
    said_s = spec.said_s or status.given_s or 0.0
    return None if spec.due_s is None else now_s + max(0.0, spec.due_s - said_s)


def is_maintained(spec: Goal) -> bool:
    """Whether a goal that stands says what to keep or to avoid."""
    return not is_repeated(spec) and bool(spec.always or spec.never)


def standing_constraints(state: State) -> tuple[tuple[Condition, ...], tuple[Condition, ...]]:
    """What goals that stand say always and never holds, as far as it is so now."""
    standing = sorted(state.index.in_state.get(GoalState.STANDING, EMPTY))
    specs = [state.goals[name] for name in standing if name in state.goals]
    kept = [spec for spec in specs if is_maintained(spec)]
    if not kept:
        return (), ()
    world = state.world()
    always = dict.fromkeys(c for spec in kept for c in spec.always if world.holds(c))
    never = dict.fromkeys(c for spec in kept for c in spec.never if not world.holds(c))
    return tuple(always), tuple(never)


def keepers(state: State) -> dict[str, str]:
    """By what always or never holds, as it is written, the goal that stands for it."""
    standing = sorted(state.index.in_state.get(GoalState.STANDING, EMPTY))
    specs = (state.goals[name] for name in standing if name in state.goals)
    kept = (spec for spec in specs if is_maintained(spec))
    return {str(row): spec.goal for spec in kept for row in (*spec.always, *spec.never)}
