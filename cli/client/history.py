"""What robotctl asks the planner about what is over."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from cli.client.presence import planner_alive
from cli.errors import NotRunning
from keyexpr_schema.errors import NoReply
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
    """Who has deleted these goals, and when, as the audit log tells; without a planner, nothing."""
    found: dict[str, AuditEntry] = {}
    for goal in goals:
        key = GOAL_SPEC.build(GoalAddress(goal))
        with suppress(NoReply, NotRunning):
            page = await audit_entries(session, AuditQuery(about=goal, limit=PAGE))
            last = next((each for each in page.entries if each.key == key), None)
            if last is not None and last.action is AuditAction.DELETED:
                found[goal] = last
    return found


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
