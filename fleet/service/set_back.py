"""Whether a planner's journal was set back: a backup was put in its place, or its log was lost.

What a planner has ordered and planned was on its disk before (`EventJournal.sync`). So a journal
that does not know of it is an older one, or that of a planner in whose place another one was. Names
and attempts that it gives would be given a second time, and mean something else.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection

from fleet.core.state import State
from fleet.service.event_journal import EventJournal
from fleet.service.recovery import Recovered
from keyexpr_schema.key import Address
from keyexpr_schema.keyspace import ORDER, PLAN_STATUS, TASK_RECORD
from keyexpr_schema.transport.session import Session

log = logging.getLogger(__name__)


async def is_set_back(
    session: Session,
    state: State,
    is_over: Callable[[Address], bool],
    deleting: Collection[str],
) -> bool:
    """Whether the store has something of a planner that this state, and what it has let go, cannot
    have led to. `deleting` are keys that are to be deleted.

    Raises:
        Unreachable: the store cannot be asked.
    """
    for order in (await session.list(ORDER)).values():
        if order.planner == state.lineage and order.serial > state.attempts_made:
            return True
    for plan, status in (await session.list(PLAN_STATUS)).items():
        entry = state.plans.get(plan.plan)
        known = is_over(plan) or PLAN_STATUS.build(plan) in deleting
        if status.revision > entry.plan.revision if entry is not None else not known:
            return True
    for task, record in (await session.list(TASK_RECORD)).items():
        entry = state.plans.get(task.plan)
        mine = None if entry is None else entry.records.get(task.task)
        if entry is not None and record.attempt > (0 if mine is None else mine.attempt):
            return True
    return False


async def recovered(
    session: Session,
    journal: EventJournal,
    is_over: Callable[[Address], bool],
    recover: Callable[[], Recovered],
) -> tuple[Recovered, bool]:
    """What `recover` makes of the journal, and whether the planner begins with what the store has:
    there was no journal, or one that was set back, which is put aside.

    Raises:
        Unreachable: the store cannot be asked.
    """
    if journal.empty:
        return recover(), True
    found = recover()
    deleting = {effect.key.build(effect.address) for effect in found.retracted}
    if not await is_set_back(session, found.state, is_over, deleting):
        return found, False
    kept = journal.begin_anew()
    log.warning(
        "the planner's journal is older than what the store has of its work (a backup was put in "
        "its place, or its log was lost): it lies in %s now, and the planner begins with what the "
        "store has; what was under way is planned again",
        kept,
    )
    return recover(), True
