"""Trajectory constraints of goals (PDDL3): what holds always, never, or before something else.

They count from when a goal is planned until it is reached, before and after tasks: while a task is
under way, nothing is said of what it changes.
"""

from __future__ import annotations

from collections.abc import Iterable

from msgspec.structs import replace

from fleet.core.indexes.fleet_index import carried_by, constrained_subjects
from fleet.core.model.preconditions import action_of, written_by
from fleet.core.plan_entry import PlanEntry
from fleet.core.replan_reasons import ReplanScope
from fleet.core.state import State
from fleet.core.state_updates import set_goal
from keyexpr_schema.payloads.goals import ENDED_GOALS, Goal, Precedence


def in_order(state: State, entry: PlanEntry) -> tuple[Precedence, ...]:
    """What must still come first, of all open goals of the plan."""
    return tuple(
        dict.fromkeys(
            row
            for goal in entry.plan.goals
            if (spec := state.goals.get(goal)) is not None
            and spec.sometime_before
            and (status := state.goal_states.get(goal)) is not None
            for row in status.still_in_order(spec)
        )
    )


def with_passed(state: State, goals: Iterable[str]) -> State:
    """Note what had to hold before something else and does, while that does not."""
    for goal in goals:
        spec, status = state.goals.get(goal), state.goal_states.get(goal)
        if spec is None or status is None or not spec.sometime_before:
            continue
        world = state.world()
        passed = [
            row.first
            for row in status.still_in_order(spec)
            if world.holds(row.first) and not world.holds(row.then)
        ]
        if passed and status.state not in ENDED_GOALS:
            passed = list(dict.fromkeys((*status.passed, *passed)))
            state = set_goal(state, replace(status, passed=tuple(passed)))
    return state


def broken(state: State, entry: PlanEntry, goals: Iterable[str]) -> PlanEntry | None:
    """The entry with what must always, never, or not yet hold and is otherwise: no plan for that
    goal is left."""
    for goal in goals:
        status, spec = state.goal_states.get(goal), state.goals.get(goal)
        if spec is None or status is None or status.state in ENDED_GOALS:
            continue
        if not (spec.always or spec.never or spec.sometime_before):
            continue
        if _is_being_changed(state, entry, spec):
            continue
        world = state.world()
        sentence = next(
            (
                f"{condition} must {often} hold, and {does}"
                for rows, wanted, often, does in (
                    (spec.always, True, "always", "does not"),
                    (spec.never, False, "never", "does now"),
                )
                for condition in rows
                if world.holds(condition) is not wanted
            ),
            None,
        ) or next(
            (
                f"{row.first} must hold before {row.then} does, and has not"
                for row in status.still_in_order(spec)
                if world.holds(row.then)
            ),
            None,
        )
        if sentence is not None:
            return entry.to_replan(ReplanScope.REPAIR, sentence, goals=(goal,))
    return None


def _is_being_changed(state: State, entry: PlanEntry, spec: Goal) -> bool:
    """Whether a task under way writes of what a goal's constraints are about, or what that is in:
    what is known of it may be half of what the task does."""
    subjects = constrained_subjects(spec)
    for task in entry.index.outstanding:
        action = action_of(entry.records[task], state.skills)
        if action is None:
            continue
        for variable in written_by(action):
            if not subjects.isdisjoint(carried_by(state.index, variable.subject)):
                return True
    return False
