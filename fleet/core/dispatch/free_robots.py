"""Which robots are free to take a plan's next task."""

from __future__ import annotations

from fleet.core.plan_entry import OUTSTANDING, PlanEntry
from fleet.core.state import State
from keyexpr_schema.facts import AT
from keyexpr_schema.payloads.goals import ENDED_GOALS
from keyexpr_schema.payloads.tasks import TaskState


def is_free(state: State, robot: str, plan: str, reservations: bool = True) -> bool:
    """Whether a robot is connected, and neither works now nor is reserved by another plan.

    A robot that carries what a plan wants brought somewhere is that plan's until it is delivered:
    between a pick and its place no other plan may have the hand. Without a load, a robot that has
    begun an actor's work stays reserved by that plan until it has nothing left to do there, unless
    `reservations` are not to count.
    """
    if not state.connected.get(robot):
        return False
    carries = _carries_for(state, robot, state.plans[plan])
    for entry in state.plans.values():
        begun: set[str] = set()
        unfinished: set[str] = set()
        for record in entry.records.values():
            if robot not in (record.robot, *record.args.values()):
                continue
            if record.state in OUTSTANDING:
                return False
            if record.robot == robot and record.state is TaskState.SUCCEEDED:
                begun.add(record.actor)
            elif record.robot == robot and record.state is TaskState.WAITING:
                unfinished.add(record.actor)
        if entry.plan.plan == plan or entry.ended or carries:
            continue
        if (reservations and begun & unfinished) or _carries_for(state, robot, entry):
            return False
    return True


def _carries_for(state: State, robot: str, entry: PlanEntry) -> bool:
    """Whether a robot has something with it that an open goal of the plan is about."""
    return any(
        (fact := state.fact(AT, subject)) is not None and fact.value == robot
        for goal in entry.plan.goals
        if goal in state.goal_states and state.goal_states[goal].state not in ENDED_GOALS
        for condition in state.goal_states[goal].conditions
        for subject in condition.subjects
    )
