"""A confirmed write is exactly that one; many cost one question; the overtaken hear of it."""

from __future__ import annotations

import asyncio
import os
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from fleet.errors import StoreError
from fleet.service.router_process import with_port
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.errors import Overtaken, Unconfirmed, UndecodablePayload, WriteRefused
from keyexpr_schema.keyspace import GOAL_SPEC, STORE_JOURNAL, STORE_STAMPS, UNDECODABLE
from keyexpr_schema.limits import Limits, put_in_force
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.payloads.system import StoreAddress, StoreQuery, StoreStampsQuery
from keyexpr_schema.transport.link import Link, Put
from keyexpr_schema.transport.router import run_router
from keyexpr_schema.transport.samples import timestamp_of_stamp
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from keyexpr_schema.transport.stamps import stamp_of_text
from keyexpr_schema.transport.store.storage import Write
from tests.support.polling import DEADLINE_S, until
from tests.support.session_values import goal

G1 = GoalAddress("g1")
KEYEXPR = GOAL_SPEC.build(G1)


def counted_questions(monkeypatch) -> list[str]:
    """Fills with the key of every query that any session of this process sends."""
    asked: list[str] = []
    query = Link.query

    async def counted(self, keyexpr, *args, **kwargs):
        asked.append(keyexpr)
        return await query(self, keyexpr, *args, **kwargs)

    monkeypatch.setattr(Link, "query", counted)
    return asked


def behind(session: Session, monkeypatch, seconds: float) -> None:
    """Set the clock back by which this session stamps what it writes."""
    now = session.link.new_timestamp

    def earlier():
        return timestamp_of_stamp(stamp_of_text(str(now())) - (int(seconds * 2**32) << 128))

    monkeypatch.setattr(session.link, "new_timestamp", earlier)


async def test_writes_that_wait_together_cost_one_question(session_config, monkeypatch):
    async with open_session(session_config()) as session:
        await session.confirm(GOAL_SPEC, G1, goal("g1"))
        asked = counted_questions(monkeypatch)
        names = [f"g{number}" for number in range(100)]
        await asyncio.gather(
            *(session.confirm(GOAL_SPEC, GoalAddress(name), goal(name)) for name in names),
            session.delete(GOAL_SPEC, GoalAddress("none")),
        )
        assert asked == [STORE_STAMPS.build(StoreAddress())]
        monkeypatch.undo()
        assert len(await session.list(GOAL_SPEC)) == 100


async def test_a_writer_whose_clock_is_behind_hears_that_it_was_overtaken(
    session_config, monkeypatch
):
    async with open_session(session_config()) as early, open_session(session_config()) as late:
        await early.confirm(GOAL_SPEC, G1, goal("g1", "first"))
        behind(late, monkeypatch, 3600)
        with pytest.raises(Overtaken, match=r"goals/g1/spec was not written: .* 3\d\d\d\.\d* s"):
            await late.confirm(GOAL_SPEC, G1, goal("g1", "second"))
        with pytest.raises(Overtaken):
            await late.delete(GOAL_SPEC, G1)
        # What nobody has written yet it can write.
        await late.confirm(GOAL_SPEC, GoalAddress("g2"), goal("g2"))
        assert await late.get(GOAL_SPEC, G1) == goal("g1", "first")
        # A deletion overtakes, too.
        await early.delete(GOAL_SPEC, G1)
        with pytest.raises(Overtaken):
            await late.confirm(GOAL_SPEC, G1, goal("g1", "third"))


async def test_a_value_that_its_own_session_has_replaced_is_confirmed(session_config):
    async with open_session(session_config()) as session:
        writes = [session.confirm(GOAL_SPEC, G1, goal("g1", f"text {n}")) for n in range(50)]
        await asyncio.gather(*writes)
        assert await session.get(GOAL_SPEC, G1) == goal("g1", "text 49")


async def test_putting_again_with_the_same_stamp_changes_nothing(session_config):
    async with open_session(session_config()) as session:
        put = Put(KEYEXPR, b"{}", "application/json", session.link.new_timestamp())
        for _ in range(3):
            await session.link.send(put)
        await session.confirm(GOAL_SPEC, GoalAddress("g2"), goal("g2"))
        journal = await session.query(STORE_JOURNAL, StoreAddress(), StoreQuery())
        assert [e.keyexpr for e in journal.entries] == [KEYEXPR, "goals/g2/spec"]


async def test_the_store_tells_what_is_not_there(session_config):
    async with open_session(session_config()) as session:
        await session.confirm(GOAL_SPEC, G1, goal("g1"))
        asked = StoreStampsQuery(keys=(KEYEXPR, "goals/g9/spec"))
        found = (await session.query(STORE_STAMPS, StoreAddress(), asked)).timestamps
        (stored,) = (await session.link.query(KEYEXPR, 5.0)).values
        assert [stamp_of_text(found[0]), found[1]] == [stored.stamp, ""]


async def test_who_gives_up_waiting_leaves_the_others_alone(router, session_config):
    async with open_session(session_config()) as session:
        router.freeze()
        impatient = asyncio.create_task(session.confirm(GOAL_SPEC, G1, goal("g1"), 0.05))
        patient = asyncio.create_task(
            session.confirm(GOAL_SPEC, GoalAddress("g2"), goal("g2"), DEADLINE_S)
        )
        with pytest.raises(Unconfirmed):
            await impatient
        # The last to wait is gone, and then there is another one.
        patient.cancel()
        await asyncio.gather(patient, return_exceptions=True)
        third = asyncio.create_task(
            session.confirm(GOAL_SPEC, GoalAddress("g3"), goal("g3"), DEADLINE_S)
        )
        router.thaw()
        await third

        async def stored() -> bool:
            return GoalAddress("g3") in await session.list(GOAL_SPEC, DEADLINE_S)

        await until(stored)


class FullStore(SqliteStore):
    """A store whose disk is full for a while."""

    full = False

    def apply(self, batch: Sequence[Write]) -> int:
        """As ever, if there is room."""
        if self.full:
            raise StoreError("the store could not write: database or disk is full")
        return super().apply(batch)


@asynccontextmanager
async def troubled(session: Session) -> AsyncIterator[str]:
    """Something waits to be written until the session has heard why it cannot be, and this is why;
    from then on the session says it of whatever it waits for in vain, however short that is."""
    waits = asyncio.create_task(
        session.confirm(GOAL_SPEC, GoalAddress("waits"), goal("waits"), DEADLINE_S)
    )

    async def heard() -> str | None:
        return (await session.store_troubles()).failing

    try:
        trouble = await until(heard, "word of what is wrong with the store")
        assert isinstance(trouble, str)
        yield trouble
    finally:
        waits.cancel()
        await asyncio.gather(waits, return_exceptions=True)


async def test_while_the_stores_disk_is_full_nothing_is_confirmed_and_then_it_goes_on(
    tmp_path, caplog
):
    endpoint = with_port("tcp/127.0.0.1:0")
    with FullStore(tmp_path) as store:
        async with (
            run_router((endpoint,), store=store),
            open_session(SessionConfig((endpoint,))) as session,
        ):
            await session.confirm(GOAL_SPEC, G1, goal("g1"))
            assert (await session.store_troubles()).failing is None
            store.full = True
            async with troubled(session) as trouble:
                assert trouble == "the store could not write: database or disk is full"
            for name in ("g2", "g3"):
                with pytest.raises(Unconfirmed, match=r"store could not write: .* is full; free"):
                    await session.confirm(GOAL_SPEC, GoalAddress(name), goal(name), 0.3)
            with pytest.raises(
                Unconfirmed, match=r"g4/spec was not written: the store could .* is full; free some"
            ):
                await session.create(GOAL_SPEC, GoalAddress("g4"), goal("g4"))
            async with session.watch(GOAL_SPEC) as watch:
                await watch.synced()
                heard = aiter(watch)
                assert (await anext(heard)).address == G1
                with pytest.raises(Unconfirmed):
                    await session.confirm_new(GOAL_SPEC, GoalAddress("g5"), goal("g5"), 0.3)
                values = [(await anext(heard)).value for _ in range(2)]
                assert values == [goal("g5"), None], "who has heard of it hears that it is gone"
            patient = asyncio.create_task(
                session.confirm(GOAL_SPEC, GoalAddress("g4"), goal("g4"), DEADLINE_S)
            )
            store.full = False
            await patient
            assert (await session.store_troubles()).failing is None
            assert {G1, GoalAddress("g4")} <= set(await session.list(GOAL_SPEC, DEADLINE_S))
    said = [record.getMessage() for record in caplog.records]
    assert said == [
        "the store could not write: database or disk is full; nothing is confirmed until it can",
        "the store can write again",
    ]


async def test_confirmed_is_on_the_disk_and_one_sync_does_for_many(tmp_path, monkeypatch):
    real, synced = os.fdatasync, []

    def sync(file: int) -> None:
        real(file)
        synced.append(file)

    monkeypatch.setattr(os, "fdatasync", sync)
    endpoint = with_port("tcp/127.0.0.1:0")
    with SqliteStore(tmp_path) as store:
        async with (
            run_router((endpoint,), store=store),
            open_session(SessionConfig((endpoint,))) as session,
        ):
            names = [f"g{number}" for number in range(100)]
            await asyncio.gather(
                *(session.confirm(GOAL_SPEC, GoalAddress(name), goal(name)) for name in names)
            )
            assert 1 <= len(synced) <= 10
            session.put(GOAL_SPEC, GoalAddress("soon"), goal("soon"))
            before = len(synced)
            assert len(await session.list(GOAL_SPEC)) == 101
            assert len(synced) == before  # who reads waits for no disk
            assert await session.create(GOAL_SPEC, GoalAddress("new"), goal("new"))
            assert len(synced) == before + 1


async def test_while_the_disk_does_not_sync_nothing_is_confirmed(tmp_path, monkeypatch):
    def broken(_: int) -> None:
        raise OSError(5, "Input/output error")

    endpoint = with_port("tcp/127.0.0.1:0")
    with SqliteStore(tmp_path) as store:
        async with (
            run_router((endpoint,), store=store),
            open_session(SessionConfig((endpoint,))) as session,
        ):
            with monkeypatch.context() as patched:
                patched.setattr(os, "fdatasync", broken)
                async with troubled(session) as trouble:
                    assert trouble == "the store could not write: Input/output error"
                    with pytest.raises(Unconfirmed, match="could not write: Input/output error"):
                        await session.confirm(GOAL_SPEC, G1, goal("g1"), 0.3)
            await session.confirm(GOAL_SPEC, G1, goal("g1"), DEADLINE_S)
            assert (await session.store_troubles()).failing is None


async def test_a_flood_that_fills_the_stores_channel_ends_in_its_order(tmp_path, monkeypatch):
    """The mark of a query waits its turn in a full channel, too, and nothing locks up."""
    monkeypatch.setattr("keyexpr_schema.transport.store.server.CHANNEL", 4)
    endpoint = with_port("tcp/127.0.0.1:0")
    # A link on which nothing moves for seconds, as on a busy machine, is not cut off here: what is
    # put and forgotten would be lost with it.
    patient = SessionConfig((endpoint,), lease_s=DEADLINE_S)
    put_in_force(Limits(slow_reader_s=DEADLINE_S, unconfirmed=10_000))
    try:
        await flooded(tmp_path, patient)
    finally:
        put_in_force(Limits())


async def flooded(folder: Path, config: SessionConfig) -> None:
    with SqliteStore(folder) as store:
        async with (
            run_router(config.endpoints, store=store, lease_s=DEADLINE_S),
            open_session(config) as one,
            open_session(config) as other,
        ):

            async def look() -> int:
                return len(await other.list(GOAL_SPEC, DEADLINE_S))

            looking = [asyncio.create_task(look()) for _ in range(20)]
            for number in range(3000):
                one.put(GOAL_SPEC, GoalAddress(f"g{number}"), goal(f"g{number}"))
            await one.confirm(GOAL_SPEC, GoalAddress("last"), goal("last"), DEADLINE_S)
            await asyncio.gather(*looking)
            assert len(await other.list(GOAL_SPEC, DEADLINE_S)) == 3001
            names = []
            while len(names) < 3001:
                asked = StoreQuery(after=len(names), limit=1000)
                page = await other.query(STORE_JOURNAL, StoreAddress(), asked, DEADLINE_S)
                names += [e.keyexpr.split("/")[1] for e in page.entries]
            assert names == [*(f"g{n}" for n in range(3000)), "last"]


async def test_what_is_beyond_a_limit_is_refused_to_whoever_waits_and_told_to_no_watch(tmp_path):
    endpoint = with_port("tcp/127.0.0.1:0")
    config = SessionConfig(endpoints=(endpoint,), component="robotctl")
    put_in_force(Limits(goals=4, rejects=2))
    try:
        with SqliteStore(tmp_path) as store:
            async with (
                run_router((endpoint,), store=store),
                open_session(config) as session,
                session.watch(GOAL_SPEC) as watch,
            ):
                await watch.synced()
                for name in ("g1", "g2"):
                    await session.confirm(GOAL_SPEC, GoalAddress(name), goal(name))
                full = "its writer has 2 goal_spec keys, and nobody may have more than half"
                with pytest.raises(WriteRefused, match=full):
                    await session.confirm(GOAL_SPEC, GoalAddress("m"), goal("m"))
                for name in ("g3", "g4"):  # these are the store's
                    assert await session.create(GOAL_SPEC, GoalAddress(name), goal(name))
                with pytest.raises(Unconfirmed, match="there are 4 goal_spec keys"):
                    await session.create(GOAL_SPEC, GoalAddress("n"), goal("n"))
                for number in range(20):
                    session.put(GOAL_SPEC, GoalAddress(f"m{number}"), goal("much"))
                await session.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1", "again"))
                changes = [await anext(watch) for _ in range(5)]
                assert [each.address.goal for each in changes] == ["g1", "g2", "g3", "g4", "g1"]
                assert len(await session.list(GOAL_SPEC)) == 4
                refusing = (await session.store_troubles()).refusing
                assert "the store has not taken in 22 writes; the last was goals/m19" in refusing

                async def told():
                    told = await session.list(UNDECODABLE)
                    return told if any("16 more keys" in v.reason for v in told.values()) else None

                assert len(await until(told)) == 3  # two by name, and how many there are besides
                with pytest.raises(UndecodablePayload, match=r"has at most 0\.25"):
                    await session.confirm(GOAL_SPEC, G1, goal("g1", "x" * 300_000))
    finally:
        put_in_force(Limits())
