"""Goals that are wanted once more, or sooner: what is stored in their place."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from datetime import datetime
from typing import TYPE_CHECKING

from msgspec.structs import replace

from cli.client.names import TakenMeanwhile, put_if_unchanged
from cli.client.publish import fleet_time_s, put_goals
from cli.errors import Refused, check_known
from keyexpr_schema.keyspace import GOAL_SPEC, GOAL_STATUS, SCHEDULE_SPEC
from keyexpr_schema.payloads.goals import (
    ENDED_GOALS,
    Goal,
    GoalAddress,
    GoalState,
    GoalStatus,
)
from keyexpr_schema.payloads.schedules import ScheduleAddress

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Session


async def goals_named(
    session: Session, names: Iterable[str], *, own: bool = False
) -> tuple[dict[str, Goal], dict[str, GoalStatus]]:
    """What these goals want, and how they stand as far as a planner has said; with `own`, also of
    those that the planner has made itself, or for a schedule.

    Raises:
        Unknown: there is no such goal.
    """
    specs = dict(await put_goals(session))
    status = {a.goal: known for a, known in (await session.list(GOAL_STATUS)).items()}
    for name, known in status.items():
        if own and known.own and name not in specs:
            text = known.understood or name
            specs[name] = Goal(goal=name, text=text, conditions=known.conditions)
        elif own and known.part_of in specs and name not in specs:
            specs[name] = _made_by(specs[known.part_of], known)
    for name in names:
        check_known("goal", name, specs)
    return {name: specs[name] for name in names}, status


def _made_by(whole: Goal, run: GoalStatus) -> Goal:
    """What another goal has made, as a goal of its own: by what shall hold, or by its words where
    that is several things one after the other and the words say no times."""
    once = replace(
        whole, goal=run.goal, every=None, whenever=(), when=(), not_before_s=None, conditions=()
    )
    if run.stages[1:] and (whole.every or whole.whenever):
        return once
    return replace(once, conditions=(run.stages or (run.conditions,))[-1])


def check_failed(names: Iterable[str], status: Mapping[str, GoalStatus]) -> None:
    """Do nothing if all of these goals have failed.

    Raises:
        Refused: one has not; the message says how it stands, and what would be right.
    """
    for name in names:
        known = status.get(name)
        state = GoalState.WAITING if known is None else known.state
        if state is not GoalState.FAILED:
            raise Refused(
                f"goal {name} is {state.value}, it has not failed{_INSTEAD.get(state, '')}"
            )


_INSTEAD = {
    GoalState.WAITING: "; have it planned with `robotctl plan create`",
    GoalState.REACHED: "; say it once more with `robotctl goal add`",
    GoalState.NOT_NEEDED: "; say it once more with `robotctl goal add`",
    GoalState.REJECTED: "; say it in other words with `robotctl goal add`",
}


async def want_again(
    session: Session, specs: Mapping[str, Goal], status: Mapping[str, GoalStatus], by: str
) -> None:
    """Store these goals as said now, confirmed, each under its name: due as long from now as it was
    from when it was said. What the planner wanted itself is then wanted by a person.

    Raises:
        Refused: somebody has changed one meanwhile.
    """
    now_s, now = await fleet_time_s(session), datetime.now().astimezone()
    for name, spec in specs.items():
        due_s = spec.due_s
        again = replace(
            spec,
            said_s=now_s,
            said_at=now.isoformat(timespec="seconds"),
            said_by=by,
            due_s=None if due_s is None else now_s + max(0.0, due_s - spec.said_s),
            not_before_s=None,
        )
        if status[name].own or status[name].part_of is not None:
            await session.confirm(GOAL_SPEC, GoalAddress(name), again)
        else:
            await _put(session, name, spec, again)


async def set_urgency(
    session: Session,
    specs: Mapping[str, Goal],
    by: str,
    priority: int | None,
    in_s: float | None,
    never_due: bool,
) -> set[str]:
    """Store these goals with another priority, or due so long from now [s], each run of a schedule
    so long from its beginning, or at no time, confirmed; what is `None` stays as it is. Which of
    them are schedules.

    Raises:
        Refused: somebody has changed one meanwhile.
    """
    now_s = None if in_s is None else await fleet_time_s(session)
    schedules = {address.schedule for address in await session.list(SCHEDULE_SPEC)}
    for name, spec in specs.items():
        due_s = spec.due_s
        if in_s is not None and now_s is not None:
            due_s = in_s + (spec.said_s if name in schedules else now_s)
        changed = replace(
            spec,
            priority=spec.priority if priority is None else priority,
            due_s=None if never_due else due_s,
            said_by=by,
        )
        await _put(session, name, spec, changed)
    return schedules.intersection(specs)


def check_open(names: Iterable[str], status: Mapping[str, GoalStatus]) -> None:
    """Do nothing if none of these goals has ended.

    Raises:
        Refused: one has.
    """
    for name in names:
        known = status.get(name)
        if known is not None and known.state in ENDED_GOALS:
            raise Refused(f"goal {name} is {known.state.value}: nothing of it is left to be done")


async def _put(session: Session, name: str, seen: Goal, spec: Goal) -> None:
    schedule = await session.get(SCHEDULE_SPEC, ScheduleAddress(name))
    try:
        if schedule is not None and schedule.goal == seen:
            at, changed = ScheduleAddress(name), replace(schedule, goal=spec)
            await put_if_unchanged(session, SCHEDULE_SPEC, at, changed, schedule)
        else:
            await put_if_unchanged(session, GOAL_SPEC, GoalAddress(name), spec, seen)
    except TakenMeanwhile:
        raise Refused(f"somebody else has just changed goal {name}; look at it again") from None
