"""What a worker's outbox does where the store has something of the same fact already."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import AsyncExitStack
from pathlib import Path

import pytest
from msgspec.structs import replace

from fleet.service.router_process import with_port
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.errors import UndecodablePayload
from keyexpr_schema.full_disk import FullDisk
from keyexpr_schema.keyspace import FACT, REPORT, STORE_JOURNAL
from keyexpr_schema.limits import Limits, put_in_force
from keyexpr_schema.payloads.system import StoreAddress, StoreQuery
from keyexpr_schema.payloads.tasks import Order, ReportAddress, ReportState, Try
from keyexpr_schema.payloads.world import Fact, FactAddress
from keyexpr_schema.transport.link import Put
from keyexpr_schema.transport.router import run_router
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from tests.support.beside import running_beside
from tests.support.polling import DEADLINE_S, until
from workers.host_clock import running_s
from workers.orders.journal import Journal
from workers.orders.outbox import Outbox, make_report

MakeConfig = Callable[..., SessionConfig]


async def sent(
    config: SessionConfig,
    folder: Path,
    fact: Fact,
    age_s: float = 0.0,
    heard_s: float | None = None,
) -> None:
    """A worker's fact, noted so long ago, on its way until nothing is left to send; by one that
    heard of what it denies at `heard_s`."""
    async with open_session(config) as session:
        with Journal(folder / "hsr.journal") as journal:
            if heard_s is not None:
                journal.seen.note(fact, heard_s)
            outbox = Outbox(session, journal, FullDisk(folder, "it", "it waits", lambda _: None))
            async with running_beside(outbox.run(), "the outbox"):
                await outbox.add(fact, age_s=age_s)
                async with asyncio.timeout(DEADLINE_S):
                    await outbox.emptied()


async def test_what_the_store_has_no_room_for_waits_and_holds_up_nothing(tmp_path: Path) -> None:
    """The last word of it is said once there is room, also by the next run of the worker."""
    endpoint, cup = with_port("tcp/127.0.0.1:0"), FactAddress("cup_1", "at")
    last = replace(SAID, value="hallway")
    report = replace(make_report(ORDER, "r1", ReportState.SUCCEEDED), facts=(last,), told=True)
    put_in_force(Limits(facts=2, value_kb=1))
    try:
        async with AsyncExitStack() as stack:
            store = stack.enter_context(SqliteStore(tmp_path / "store"))
            await stack.enter_async_context(run_router((endpoint,), store=store))
            config = SessionConfig((endpoint,))
            person, other, session = [
                await stack.enter_async_context(open_session(config)) for _ in range(3)
            ]
            await person.confirm(FACT, HERE, at("attic", 1.0))
            spoon = replace(SAID, subject="spoon_1")
            await other.confirm(FACT, FactAddress("spoon_1", "at"), spoon)
            disk = FullDisk(tmp_path, "it", "it waits", lambda _: None)
            with Journal(tmp_path / "hsr.journal") as journal:
                outbox = Outbox(session, journal, disk)
                async with running_beside(outbox.run(), "the outbox"):
                    long = replace(SAID, subject="cup_2", value="x" * 2000)
                    await outbox.add(SAID, long, last, report)
                    async with asyncio.timeout(DEADLINE_S):
                        await outbox.emptied()
                    there = await session.get(REPORT, ReportAddress.of(report))
                    assert there == replace(report, told=False), "nobody has heard of it else"
                    assert await session.list(FACT) == {
                        HERE: at("attic", 1.0), FactAddress("spoon_1", "at"): spoon,
                    }  # fmt: skip
            with Journal(tmp_path / "hsr.journal") as journal:
                outbox = Outbox(session, journal, disk, again_s=0.01)
                async with running_beside(outbox.run(), "the outbox"):
                    await person.delete(FACT, HERE)
                    await until(lambda: not journal.refused)
                assert await session.get(FACT, cup) == last
                entries = await person.query(STORE_JOURNAL, StoreAddress(), StoreQuery())
                said = [each.keyexpr for each in entries.entries if "cup_1" in each.keyexpr]
                assert len(said) == 1  # once
    finally:
        put_in_force(Limits())


async def test_it_is_known_that_a_report_is_not_taken_in_until_it_is(tmp_path: Path) -> None:
    endpoint, heard = with_port("tcp/127.0.0.1:0"), list[str | None]()
    report = make_report(ORDER, "r1", ReportState.SUCCEEDED)
    before = replace(report, attempt=report.attempt + 1)
    put_in_force(Limits(documents=1))
    try:
        async with AsyncExitStack() as stack:
            store = stack.enter_context(SqliteStore(tmp_path / "store"))
            await stack.enter_async_context(run_router((endpoint,), store=store))
            config = SessionConfig((endpoint,))
            other, session = [
                await stack.enter_async_context(open_session(config)) for _ in range(2)
            ]
            await other.confirm(REPORT, ReportAddress.of(before), before)
            journal = stack.enter_context(Journal(tmp_path / "hsr.journal"))
            disk = FullDisk(tmp_path, "it", "it waits", lambda _: None)
            outbox = Outbox(session, journal, disk, on_refused=heard.append)
            async with running_beside(outbox.run(), "the outbox"):
                await outbox.add(report)
                await until(lambda: bool(heard))
                assert heard[0] is not None and "is not stored" in heard[0]
                await other.delete(REPORT, ReportAddress.of(before))
                await until(lambda: len(heard) > 1)
                assert heard[1:] == [None]
                assert await session.get(REPORT, ReportAddress.of(report)) == report
    finally:
        put_in_force(Limits())


@pytest.mark.parametrize(("facts", "left"), [(1, 1), (2000, 0)])
async def test_a_report_that_is_too_large_for_any_reader_holds_up_nothing(
    tmp_path: Path, facts: int, left: int
) -> None:
    """What was seen is left out last: without it, a success counts as one that went as planned."""
    endpoint = with_port("tcp/127.0.0.1:0")
    report = replace(make_report(ORDER, "r1", ReportState.SUCCEEDED), told=True)
    seen = tuple(replace(SAID, subject=f"cup_{n}", value="x" * 1000) for n in range(facts))
    tried = Try(number=1, reason="x" * 2**21, started_s=1.0, ended_s=2.0)
    large = replace(report, facts=seen, tries=(tried,), ended_s=2.0)
    later = replace(make_report(ORDER, "r1", ReportState.SUCCEEDED), attempt=2)
    put_in_force(Limits(document_mb=1))
    try:
        async with AsyncExitStack() as stack:
            store = stack.enter_context(SqliteStore(tmp_path / "store"))
            await stack.enter_async_context(run_router((endpoint,), store=store))
            session = await stack.enter_async_context(open_session(SessionConfig((endpoint,))))
            journal = stack.enter_context(Journal(tmp_path / "hsr.journal"))
            outbox = Outbox(session, journal, FullDisk(tmp_path, "it", "it waits", lambda _: None))
            async with running_beside(outbox.run(), "the outbox"):
                await outbox.add(large, later)
                async with asyncio.timeout(DEADLINE_S):
                    await outbox.emptied()
            said = await session.get(REPORT, ReportAddress.of(large))
            assert said is not None and said.reason is not None
            assert said.reason.startswith("the worker could report no more than that: ")
            ended_s = 2.0 if left else None
            assert replace(said, reason=None) == replace(report, facts=seen[:left], ended_s=ended_s)
            assert await session.get(REPORT, ReportAddress.of(later)) == later
    finally:
        put_in_force(Limits())


def at(place: str, time_s: float, source: str = "hsr") -> Fact:
    return Fact(subject="hsr", relation="at", value=place, source=source, time_s=time_s)


HERE = FactAddress("hsr", "at")


async def is_rubbish(session: Session) -> bool:
    try:
        await session.get(FACT, HERE)
    except UndecodablePayload:
        return True
    return False


@pytest.mark.parametrize(
    ("stored", "expected"),
    [
        pytest.param(at("kitchen", 10.0), "hallway", id="an earlier run's, long on its way"),
        pytest.param(None, "hallway", id="what nobody can read"),
        pytest.param(at("attic", 30.0), "attic", id="a later word of its own"),
        pytest.param(at("attic", 10.0, "person"), "attic", id="somebody else's"),
    ],
)
async def test_a_fact_that_comes_late(
    session_config: MakeConfig, tmp_path: Path, stored: Fact | None, expected: str
) -> None:
    """Noted a minute ago by this run of the worker, and overtaken by what another session wrote."""
    async with open_session(session_config()) as other:
        if stored is not None:
            await other.confirm(FACT, HERE, stored)
        else:
            stamp = other.link.new_timestamp()
            await other.link.send(Put(FACT.build(HERE), b"5", "application/json", stamp))
            await until(lambda: is_rubbish(other), "what nobody can read")
        await sent(session_config(), tmp_path, at("hallway", 20.0), age_s=60.0)
        there = await other.get(FACT, HERE)
        assert there is not None and there.value == expected


ORDER = Order(
    robot="hsr", plan="p", revision=1, task="t1", attempt=1, epoch=1, skill="navigate",
    args={"robot": "hsr", "to": "kitchen"}, deadline_s=60.0,
)  # fmt: skip
SAID = Fact(relation="at", subject="cup_1", value="kitchen", source="planner", time_s=5.0)
GONE = replace(SAID, value=None, source="hsr")
SEEN = replace(SAID, value="hallway", source="locobot", time_s=5.1)


@pytest.mark.parametrize(
    ("there", "left"),
    [
        pytest.param(SAID, GONE, id="what it denies"),
        pytest.param(SEEN, SEEN, id="what another has seen since"),
    ],
)
async def test_only_the_belief_that_was_found_wrong_gives_way(
    session_config: MakeConfig, tmp_path: Path, there: Fact, left: Fact
) -> None:
    """The store counts a fact as received when it takes it in, and that may be later than a robot
    hears of it."""
    heard_s = running_s()
    async with open_session(session_config()) as planner:
        await planner.confirm(FACT, FactAddress("cup_1", "at"), there)
        await sent(session_config(), tmp_path, GONE, heard_s=heard_s)
        assert await planner.get(FACT, FactAddress("cup_1", "at")) == left
