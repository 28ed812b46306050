"""What robotctl asks the planner about what is over."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from cli.client.presence import planner_alive
from cli.errors import NotRunning, Unknown
from keyexpr_schema.errors import InvalidId, NoReply
from keyexpr_schema.key import Key
from keyexpr_schema.keyspace import AUDIT, GOAL_SPEC, HISTORY, HISTORY_STATS, RETIREMENT
from keyexpr_schema.payloads.audit import AuditAction, AuditEntry, AuditPage, AuditQuery
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.payloads.history import (
    HistoryPage,
    HistoryQuery,
    HistoryStats,
    HistoryStatsQuery,
    PastEntry,
    Retired,
    RetireQuery,
)
from keyexpr_schema.payloads.system import PlannerAddress

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Session

PAGE = 200
"""Entries asked for at once."""
ANSWER_S = 30.0
"""How long the planner may take to read a page, or to add its whole history up."""
ASIDE_S = 3.0
"""And to say what is told only beside something else."""


async def past_entries(session: Session, query: HistoryQuery, last: int) -> list[PastEntry]:
    """The newest `last` entries of the history that the query is for, newest first.

    Raises:
        NotRunning: no planner is connected.
    """
    found: list[PastEntry] = []
    while len(found) < last:
        limit = min(PAGE, last - len(found))
        page: HistoryPage = await _ask(session, HISTORY, replace(query, limit=limit))
        found += page.entries
        if page.before is None:
            break
        query = replace(query, before=page.before)
    return found


async def history_stats(session: Session, query: HistoryStatsQuery) -> HistoryStats:
    """The history, added up.

    Raises:
        NotRunning: no planner is connected.
    """
    found: HistoryStats = await _ask(session, HISTORY_STATS, query)
    return found


async def audit_entries(session: Session, query: AuditQuery) -> AuditPage:
    """The newest entries of the audit log that the query is for, newest first.

    Raises:
        NotRunning: no planner is connected.
    """
    found: AuditPage = await _ask(session, AUDIT, query)
    return found


async def deletions_of(session: Session, goals: Iterable[str]) -> dict[str, AuditEntry]:
    """Who has deleted these goals, and when, as the audit log tells; nothing of those of which no
    planner answers soon."""
    asked = list(goals)
    found = await asyncio.gather(*(_deletion_of(session, goal) for goal in asked))
    return {goal: entry for goal, entry in zip(asked, found, strict=True) if entry is not None}


async def _deletion_of(session: Session, goal: str) -> AuditEntry | None:
    key, query = GOAL_SPEC.build(GoalAddress(goal)), AuditQuery(about=goal, limit=PAGE)
    try:
        page: AuditPage = await session.query(AUDIT, PlannerAddress(), query, ASIDE_S)
    except NoReply:
        return None
    last = next((each for each in page.entries if each.key == key), None)
    return last if last is not None and last.action is AuditAction.DELETED else None


async def check_not_deleted(session: Session, goal: str) -> None:
    """Do nothing unless somebody has deleted this goal, which is not there any more.

    Raises:
        Unknown: somebody has; the message says who and when, and where the rest is told.
    """
    from cli.times import moment

    with suppress(InvalidId):  # what is no name of a goal
        for said in (await deletions_of(session, (goal,))).values():
            by = f" by {said.by}" if said.by else ""
            raise Unknown(
                f"goal {goal} was deleted {moment(said.wall_time_s, said.time_s)}{by}: "
                f"`robotctl history --goal {goal}` tells what had come of it"
            )


async def retire(session: Session, query: RetireQuery) -> Retired:
    """Have the keys of what is over deleted; how many plans and goals that were.

    Raises:
        NotRunning: no planner is connected.
    """
    total = Retired(left=True)
    while total.left:
        now: Retired = await _ask(session, RETIREMENT, query)
        total = Retired(plans=total.plans + now.plans, goals=total.goals + now.goals, left=now.left)
    return total


async def _ask(session: Session, key: Key[PlannerAddress, Any], query: Any) -> Any:
    try:
        return await session.query(key, PlannerAddress(), query, ANSWER_S)
    except NoReply:
        if await planner_alive(session):
            raise
        raise NotRunning(
            "no planner is running, and it keeps the history; start one with `robotctl planner`"
        ) from None
