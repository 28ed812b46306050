"""What robotctl asks of the planner, what must be there first, and what the planner can do."""

from __future__ import annotations

import asyncio
import uuid
from collections.abc import Iterable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from cli.client.fleet_view import fleet_view
from cli.client.presence import planner_alive, planners_alive
from cli.errors import NotRunning, Refused, TooLate, Unknown, check_known, near_miss
from keyexpr_schema.errors import NoReply
from keyexpr_schema.key import Key
from keyexpr_schema.keyspace import (
    ANSWER,
    CONTROL_REQUEST,
    GOAL_SPEC,
    GOAL_STATUS,
    PLAN_REQUEST,
    PLAN_SPEC,
    PLAN_STATUS,
    PLANNER_STATUS,
    REPLAN_REQUEST,
    ROBOT_SPEC,
    SCHEDULE_SPEC,
    STATEMENT_STATUS,
    TASKS_KNOWN,
)
from keyexpr_schema.payloads.goals import GoalState, GoalStatus
from keyexpr_schema.payloads.methods import TasksQuery, TasksReply
from keyexpr_schema.payloads.requests import (
    Answer,
    ControlRequest,
    PlanRequest,
    ReplanRequest,
    RequestAddress,
)
from keyexpr_schema.payloads.system import PlannerAddress
from keyexpr_schema.payloads.waits import WaitKind

if TYPE_CHECKING:
    from cli.client.fleet_view import FleetView
    from keyexpr_schema.payloads.robots import RobotSpec
    from keyexpr_schema.payloads.system import PlannerStatus
    from keyexpr_schema.payloads.world import StatementStatus
    from keyexpr_schema.transport.session import Session

ANSWER_S = 120.0
"""Longest time to wait for an answer: planning with a language model takes its time."""

READ_S = 5.0
"""How long the planner may take to say what it can do, or what tasks it knows."""
STATEMENT_S = 30.0
"""How long it may take to read a statement."""

Request = PlanRequest | ReplanRequest | ControlRequest
REQUEST_KEYS: dict[type[Request], Key[RequestAddress, Any]] = {
    PlanRequest: PLAN_REQUEST,
    ReplanRequest: REPLAN_REQUEST,
    ControlRequest: CONTROL_REQUEST,
}


def request_name() -> str:
    """A name for one request, never used before."""
    return f"req-{uuid.uuid4().hex[:12]}"


async def check_goals(session: Session, goals: Iterable[str]) -> None:
    """Raise `Unknown` unless there is each of these goals."""
    known = [address.goal for address in await session.list(GOAL_SPEC)]
    known += [address.schedule for address in await session.list(SCHEDULE_SPEC)]
    for goal in goals:
        check_known("goal", goal, known)


async def check_plan(session: Session, plan: str) -> None:
    """Raise `Unknown` unless there is a plan of that name, be it without tasks."""
    known = {address.plan for address in await session.list(PLAN_SPEC)}
    known |= {address.plan for address in await session.list(PLAN_STATUS)}
    check_known("plan", plan, known)


async def check_robot(session: Session, robot: str) -> None:
    """Raise `Unknown` unless a robot of that name is registered."""
    check_known("robot", robot, (address.robot for address in await session.list(ROBOT_SPEC)))


async def check_planner(session: Session) -> None:
    """Raise `NotRunning` unless a planner is connected."""
    if not await planner_alive(session):
        raise NotRunning("no planner is running; start one with `robotctl planner`")


async def ask_planner(session: Session, request: Request, timeout_s: float = ANSWER_S) -> Answer:
    """Put `request` and wait for its answer.

    With no planner there the request is not put: it would be carried out whenever one starts, long
    after anybody remembers it.

    Raises:
        NotRunning: no planner is connected.
        Refused: the planner said no; the message is its sentence and every violation.
        TooLate: the planner did not answer within `timeout_s` [s].
    """
    await check_planner(session)
    await session.confirm(REQUEST_KEYS[type(request)], RequestAddress(request.request), request)
    answer: Answer | None = await first_value(session, ANSWER, timeout_s, request=request.request)
    if answer is None:
        raise TooLate(
            f"the planner did not answer request {request.request} within {timeout_s:g} s"
        )
    if not answer.accepted:
        more = [each.sentence for each in answer.violations if each.sentence not in answer.sentence]
        raise Refused("; ".join([answer.sentence, *more]))
    return answer


async def have_planned(session: Session, view: FleetView, goals: Iterable[str], by: str) -> str:
    """Ask for one plan of those of these goals that wait for one, and return a sentence once they
    all wait no more. For a goal that a plan is being made for already, by a planner that plans
    unasked or because somebody else has asked, nothing is asked.

    Raises:
        NotRunning, Refused, TooLate: as `ask_planner`.
    """
    status, asked = view.goal_status, tuple(goals)
    left = tuple(goal for goal in asked if waits_unplanned(status[goal]))
    said = f"planned already: {', '.join(asked)}"
    if left:
        try:
            request = PlanRequest(request=request_name(), goals=left, by=by)
            said = (await ask_planner(session, request)).sentence
        except Refused as refused:
            await planned_otherwise(session, left, refused)

    def in_vain(goal: str) -> bool:
        """Whether the plan that was being made for it came to nothing."""
        return goal not in left and waits_unplanned(status[goal])

    await view.until(
        lambda: all(status[g].state is not GoalState.WAITING or in_vain(g) for g in asked),
        ANSWER_S,
        f"{', '.join(asked)} to be planned",
    )
    if reasons := [f"goal {goal}: {status[goal].reason}" for goal in asked if in_vain(goal)]:
        raise Refused("; ".join(reasons))
    return said


async def planned_otherwise(session: Session, goals: Iterable[str], refused: Refused) -> None:
    """Return once a plan that somebody else has asked for has these goals, a request for which was
    refused. What says that one is being made may be what is over: the answer can come first.

    Raises:
        Refused: no plan has one of them, for the reason that its status gives.
    """
    names = tuple(goals)
    # What is stored now: the view of whoever asks may still be at what was before.
    async with fleet_view(session, *((GOAL_STATUS, {"goal": name}) for name in names)) as view:

        def without_plan() -> list[str]:
            found = ((name, view.goal_status.get(name)) for name in names)
            return [name for name, now in found if now is None or waits_unplanned(now)]

        def decided() -> bool:
            states = (view.goal_status[name].state for name in names)
            return bool(without_plan()) or all(s is not GoalState.WAITING for s in states)

        if without_plan():
            raise refused
        await view.until(decided, ANSWER_S, f"{', '.join(names)} to be planned")
        for name in without_plan():
            last = view.goal_status.get(name)
            raise Refused((last and last.reason) or str(refused))


def waits_unplanned(status: GoalStatus) -> bool:
    """Whether a goal waits, and no plan is being made for it."""
    in_plan = any(why.kind is WaitKind.PLAN for why in status.waits_for)
    return status.state is GoalState.WAITING and not in_plan


def asked_for_no_plan(status: GoalStatus) -> bool:
    """Whether a goal waits for somebody who asks for a plan."""
    kinds = [why.kind for why in status.waits_for]
    return status.state is GoalState.WAITING and WaitKind.NO_PLAN in kinds


async def ask_about_tasks(session: Session, asked: TasksQuery) -> TasksReply:
    """What the planner knows of tasks that goals can call by name.

    Raises:
        NotRunning: no planner is connected.
    """
    try:
        reply: TasksReply = await session.query(TASKS_KNOWN, PlannerAddress(), asked, READ_S)
    except NoReply:
        await check_planner(session)
        raise
    return reply


async def first_value(
    session: Session, key: Key[Any, Any], timeout_s: float, **chunks: str | int
) -> Any | None:
    """The first value of the one `key` with these chunks; `None` if none comes in time."""
    with suppress(TimeoutError):
        async with asyncio.timeout(timeout_s), session.watch((key, chunks)) as watch:
            async for change in watch:
                if change.value is not None:
                    return change.value
    return None


async def statement_status(session: Session, statement: str) -> StatementStatus | None:
    """What the planner read out of a statement; `None` if no planner runs, or it does not say."""
    if not await planner_alive(session):
        return None
    return await first_value(session, STATEMENT_STATUS, STATEMENT_S, statement=statement)


async def planner_status(session: Session) -> PlannerStatus | None:
    """What the latest planner says that it can do; `None` where none ever ran, or nobody can tell.

    One that does not decode is reported like any other, and is no reason to refuse a command.
    """
    return (await session.list(PLANNER_STATUS)).get(PlannerAddress())


async def acting_planner(session: Session) -> PlannerStatus | None:
    """What the planner that is connected says that it can do; `None`: there is none.

    Not what one says that is dead: the next may be started with other skills.
    """
    alive = await planners_alive(session)
    if not alive:
        return None
    latest = await planner_status(session)
    if latest is not None and latest.incarnation in alive:
        return latest
    with suppress(TimeoutError):
        async with asyncio.timeout(READ_S), session.watch(PLANNER_STATUS) as watch:
            async for change in watch:
                if change.value is not None and change.value.incarnation in alive:
                    told: PlannerStatus = change.value
                    return told
    return None


async def check_skills(session: Session, specs: Iterable[RobotSpec]) -> None:
    """Do nothing if the planner has a model of each skill, or if there is no planner to say so.

    Raises:
        Unknown: it lacks one, so that no plan could ever ask a robot for it.
    """
    planner = await acting_planner(session)
    if planner is None or not planner.skills:
        return
    for spec in specs:
        for skill in spec.skills:
            if skill not in planner.skills:
                hint = near_miss(skill, planner.skills)
                raise Unknown(
                    f"robot {spec.robot!r}: the planner knows no skill {skill!r}{hint}; it knows "
                    f"{', '.join(sorted(planner.skills))}; "
                    "teach it more with `robotctl planner --skills FILE`"
                )
