"""Whether the fleet knows the goals, plans and robots that a person names."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from cli.errors import check_known
from keyexpr_schema.keyspace import GOAL_SPEC, PLAN_SPEC, PLAN_STATUS, ROBOT_SPEC

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Session


async def check_goals(session: Session, goals: Iterable[str]) -> None:
    """Raise `Unknown` unless there is each of these goals."""
    known = [address.goal for address in await session.list(GOAL_SPEC)]
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
