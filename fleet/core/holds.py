"""What is held back by pauses and drains."""

from __future__ import annotations

from fleet.core.state import State
from keyexpr_schema.payloads.holds import Hold, HoldKind


def paused(state: State, robot: str) -> Hold | None:
    """The pause that holds a robot, if there is one."""
    return next(
        (
            hold
            for hold in state.holds.values()
            if hold.kind is HoldKind.PAUSE and (hold.of_all or robot in hold.robots)
        ),
        None,
    )


def plan_paused(state: State, plan: str) -> Hold | None:
    """The pause that holds a plan, and not all robots, if there is one."""
    return next((hold for hold in state.holds.values() if plan in hold.plans), None)


def schedule_paused(state: State, schedule: str) -> Hold | None:
    """The pause that holds a schedule, or a goal that is for later, if there is one."""
    return next((hold for hold in state.holds.values() if schedule in hold.schedules), None)


def drains(state: State) -> dict[str, Hold]:
    """The robots that are being drained, or are."""
    return {
        robot: hold
        for hold in state.holds.values()
        if hold.kind is HoldKind.DRAIN
        for robot in hold.robots
    }
