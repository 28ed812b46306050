"""Who has deleted a goal is told beside why a plan is cancelled, which waits not long for that."""

from __future__ import annotations

import asyncio
from typing import Any

from cli.client.history import ANSWER_S, deletions_of
from keyexpr_schema.errors import NoReply
from keyexpr_schema.payloads.audit import AuditAction, AuditEntry, AuditPage, AuditQuery
from tests.support.polling import DEADLINE_S

GOALS = ("cup", "plate", "spoon")


def entry(goal: str, action: AuditAction) -> AuditEntry:
    return AuditEntry(
        at="", wall_time_s=1.0, time_s=1.0, by="ana", action=action, key=f"goals/{goal}/spec",
        summary="",
    )  # fmt: skip


class Asked:
    """A planner that answers of one goal, when it is asked of all, and not of others in time."""

    def __init__(self) -> None:
        self._all, self.longest_s = asyncio.Barrier(len(GOALS)), 0.0

    async def query(self, key: Any, address: Any, query: AuditQuery, timeout_s: float) -> AuditPage:
        await self._all.wait()
        self.longest_s = max(self.longest_s, timeout_s)
        if query.about == "plate":
            raise NoReply("it did not answer in time")
        deleted, said = entry(query.about or "", AuditAction.DELETED), AuditAction.PUT
        others = (entry("fork", AuditAction.DELETED), entry("spoon", said))
        return AuditPage(entries=(*others, deleted))


async def test_all_are_asked_of_at_once_and_not_waited_for_as_long_as_for_a_history() -> None:
    planner: Any = Asked()
    found = await asyncio.wait_for(deletions_of(planner, GOALS), DEADLINE_S)
    assert found == {"cup": entry("cup", AuditAction.DELETED)}
    assert planner.longest_s <= ANSWER_S / 10
