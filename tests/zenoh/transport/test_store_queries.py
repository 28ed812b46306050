"""Questions to a store: not too many are open at a time, and each is answered, whatever fails; who
does not ask what is on the disk waits for none."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from fleet.service.router_process import with_port
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.errors import Unreachable
from keyexpr_schema.keyspace import GOAL_SPEC
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.transport.router import run_router
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from keyexpr_schema.transport.store.storage import Changes, Write
from tests.support.polling import DEADLINE_S, until
from tests.support.session_values import goal

G1 = GoalAddress("g1")


class OddStore(SqliteStore):
    """Lists nothing until it may, counts the questions that were taken in, and fails if told to;
    with `slow` its disk takes as long as that says."""

    fails = False
    taken = failed = 0

    def __init__(self, data_dir: Path) -> None:
        super().__init__(data_dir)
        self.may_list, self.syncing = threading.Event(), threading.Event()
        self.slow: threading.Event | None = None

    def sync(self) -> None:
        """As ever, when the disk is free."""
        self.syncing.set()
        if self.slow is not None:
            self.slow.wait(DEADLINE_S)
        super().sync()

    def receipt(self) -> int:
        """Each question is given one as it is taken in."""
        self.taken += 1
        if self.fails:
            raise RuntimeError("no receipts")
        return super().receipt()

    def newest(self, keyexprs: Sequence[str]) -> list[Write | None]:
        """Asked as a write is judged."""
        if self.fails:
            self.failed += 1
            raise RuntimeError("nothing known")
        return super().newest(keyexprs)

    def changes(self, patterns: Sequence[str], position: str, limit: int) -> Changes:
        """As ever, when it may."""
        self.may_list.wait(DEADLINE_S)
        return super().changes(patterns, position, limit)


@asynccontextmanager
async def asking(folder: Path) -> AsyncIterator[tuple[OddStore, Session]]:
    """Such a store, and who asks it."""
    endpoint = with_port("tcp/127.0.0.1:0")
    with OddStore(folder) as store:
        async with (
            run_router((endpoint,), store=store),
            open_session(SessionConfig((endpoint,))) as session,
        ):
            try:
                yield store, session
            finally:
                store.may_list.set()


async def test_so_many_questions_are_open_at_a_time_and_all_are_answered(tmp_path, monkeypatch):
    monkeypatch.setattr("keyexpr_schema.transport.store.server.MOST_OPEN", 4)
    async with asking(tmp_path) as (store, session):
        store.taken = 0
        listings = [asyncio.create_task(session.list(GOAL_SPEC, DEADLINE_S)) for _ in range(60)]
        await until(lambda: store.taken >= 4)
        session.put(GOAL_SPEC, G1, goal("g1"))
        await until(lambda: store.select("robotfleet/goals/g1/spec"))  # it came behind them
        assert store.taken < 20
        store.may_list.set()
        found = await asyncio.gather(*listings)
        assert store.taken >= 60
        assert found[-1] == {G1: goal("g1")}


async def test_a_store_that_fails_for_a_moment_says_so_and_goes_on(tmp_path):
    async with asking(tmp_path) as (store, session):
        store.may_list.set()
        store.fails = True
        session.put(GOAL_SPEC, G1, goal("g1"))
        with pytest.raises(Unreachable, match="the store failed: no receipts"):
            await session.list(GOAL_SPEC, DEADLINE_S)
        await until(lambda: store.failed)
        store.fails = False
        await session.confirm(GOAL_SPEC, G1, goal("g1"), DEADLINE_S)
        assert await session.list(GOAL_SPEC, DEADLINE_S) == {G1: goal("g1")}


@pytest.mark.parametrize("write", [Session.confirm, Session.create])
async def test_who_asks_what_has_changed_waits_for_no_disk(tmp_path, write):
    async with asking(tmp_path) as (store, session):
        store.may_list.set()
        store.slow = threading.Event()
        try:
            confirmed = asyncio.create_task(write(session, GOAL_SPEC, G1, goal("g1"), DEADLINE_S))
            await until(store.syncing.is_set)
            assert await session.list(GOAL_SPEC, DEADLINE_S) == {G1: goal("g1")}
            assert not confirmed.done()
        finally:
            store.slow.set()
        await confirmed
