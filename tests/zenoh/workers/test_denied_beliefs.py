"""What a robot has not found where it was said to be, though it heard of that before the store."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from msgspec.structs import replace

from keyexpr_schema.facts import AT, FactKey
from keyexpr_schema.full_disk import FullDisk
from keyexpr_schema.keyspace import FACT
from keyexpr_schema.payloads.world import Fact, FactAddress
from keyexpr_schema.transport.session import open_session
from tests.support.polling import DEADLINE_S
from workers.host_clock import running_s
from workers.orders.journal import Journal
from workers.orders.outbox import Outbox

SAID = Fact(relation=AT, subject="cup_1", value="kitchen", source="planner", time_s=5.0)
GONE = replace(SAID, value=None, source="hsr")
CUP = FactAddress.of(FactKey(AT, "cup_1"))


@pytest.mark.parametrize(
    ("there", "left"),
    [(SAID, GONE), (seen := replace(SAID, value="hallway", source="locobot", time_s=5.1), seen)],
    ids=["what-it-denies", "what-another-has-seen-since"],
)
async def test_only_the_belief_that_was_found_wrong_gives_way(
    router, session_config, tmp_path: Path, there: Fact, left: Fact
):
    """The store counts a fact as received when it takes it in, and that may be later than a robot
    hears of it."""
    heard_s = running_s()
    async with open_session(session_config()) as planner, open_session(session_config()) as worker:
        await planner.confirm(FACT, CUP, there)
        with Journal(tmp_path / "hsr.journal") as journal:
            journal.seen_s[GONE] = heard_s
            outbox = Outbox(worker, journal, FullDisk(tmp_path, "hsr", "", lambda _: None))
            sending = asyncio.create_task(outbox.run())
            try:
                await outbox.add(GONE)
                async with asyncio.timeout(DEADLINE_S):
                    await outbox.emptied()
            finally:
                sending.cancel()
        assert await planner.get(FACT, CUP) == left
