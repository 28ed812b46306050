"""A watch misses nothing, never goes back, and believes no empty store."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from typing import Any

import msgspec
import pytest
import zenoh

from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.keyspace import FACT, GOAL_SPEC, REPORT, SIM_SENSES, STORE_CHANGES
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.payloads.simulation import SimRobotAddress
from keyexpr_schema.payloads.system import StoreAddress, StoreChanges, StoreChangesQuery
from keyexpr_schema.payloads.tasks import Report, ReportAddress, ReportState
from keyexpr_schema.payloads.world import FactAddress
from keyexpr_schema.transport.connecting import zenoh_config
from keyexpr_schema.transport.link import COLLECTED, Put
from keyexpr_schema.transport.session import Narrowed, Session, Watch, open_session
from keyexpr_schema.transport.stamps import stamp_of_text
from keyexpr_schema.transport.store.storage import Write
from tests.support.polling import DEADLINE_S, until
from tests.support.router_process import RouterProcess
from tests.support.session_values import (
    AT,
    fact,
    goal,
    not_connected,
    senses,
    take,
    take_until_value,
)


async def test_a_watch_shows_what_is_stored_then_changes_then_deletions(session_config):
    async with open_session(session_config()) as session:
        await session.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"))
        async with session.watch(GOAL_SPEC, (FACT, {"subject": "cup_1"})) as watch:
            await watch.synced()
            [first] = await take(watch, 1)
            assert (first.key, first.address, first.value) == (
                GOAL_SPEC,
                GoalAddress("g1"),
                goal("g1"),
            )
            await session.confirm(FACT, AT, fact(1))
            await session.confirm(FACT, FactAddress("cup_2", "at"), fact(5))
            await session.delete(GOAL_SPEC, GoalAddress("g1"))
            changes = await take(watch, 2)
            assert [(c.key, c.value) for c in changes] == [(FACT, fact(1)), (GOAL_SPEC, None)]


async def test_what_is_collected_comes_in_the_order_in_which_it_was_put(session_config):
    """Each key has a subscription of its own, and all of them wait for the same moment."""
    async with open_session(session_config()) as session:
        async with session.watch(GOAL_SPEC, FACT, collect_s=0.3) as watch:
            await watch.synced()
            for number in range(1, 41):
                await session.confirm(FACT, AT, fact(number))
                await session.confirm(GOAL_SPEC, GoalAddress(f"g{number}"), goal(f"g{number}"))
            changes = await take(watch, 80)
    stamps = [stamp_of_text(change.timestamp) for change in changes]
    assert stamps == sorted(stamps)
    assert [change.value.value for change in changes[::2]] == list(range(1, 41))


async def test_what_waits_to_be_collected_comes_before_what_the_store_says(session_config):
    async with open_session(session_config()) as session:
        async with session.watch(FACT, collect_s=DEADLINE_S) as watch:
            await watch.synced()
            for number in range(1, 11):
                await session.confirm(FACT, AT, fact(number))
            watch.relist()
            changes = await take(watch, 10)
    assert [change.value.value for change in changes] == list(range(1, 11))


async def test_where_more_came_than_can_wait_it_is_said(session_config):
    async with open_session(session_config()) as session:
        taken: list[str] = []
        pattern = FACT.pattern()
        receiver = (pattern, lambda sample: taken.append(sample.keyexpr))
        behind: list[str] = []
        async with (
            session.link.collected([receiver]) as collect,
            session.link.subscribed(
                GOAL_SPEC.pattern(), lambda sample: behind.append(sample.keyexpr)
            ),
        ):
            for count in (COLLECTED - 1, COLLECTED + 5):
                for number in range(count):
                    session.put(FACT, FactAddress(f"cup_{number}", "at"), fact(number))
                # Puts go one after the other: what comes behind them, all who listen have got.
                session.put(GOAL_SPEC, GoalAddress("g"), goal("g"))
                await until(lambda: behind, "what was put last")
                behind.clear()
                lost = collect()
                assert lost == (count > COLLECTED)
                assert len(taken) == min(count, COLLECTED)
                assert taken[-1] == FACT.build(FactAddress(f"cup_{count - 1}", "at"))
                taken.clear()


@pytest.mark.parametrize("collect_s", [None, 0.02])
async def test_a_watch_across_kill_9_misses_nothing_and_never_goes_back(
    router, session_config, collect_s
):
    async with (
        open_session(session_config(component="reader")) as reader,
        open_session(session_config(component="writer")) as writer,
        reader.watch(FACT, collect_s=collect_s) as watch,
    ):
        await watch.synced()
        for number in range(0, 60, 20):
            for value in range(number, number + 10):
                await writer.confirm(FACT, AT, fact(value))
            # What is on its way to a reader is lost with the router.
            seen = await take_until_value(watch, number + 9)
            router.restart()
            for value in range(number + 10, number + 20):
                await writer.confirm(FACT, AT, fact(value), DEADLINE_S)
            seen += await take_until_value(watch, number + 19)
            assert seen == sorted(seen)
            assert set(range(number, number + 10)) <= set(seen)


async def test_what_was_written_while_a_reader_was_cut_off_reaches_it(router, session_config):
    async with open_session(session_config()) as reader, reader.watch(FACT) as watch:
        await watch.synced()
        router.kill()
        await until(lambda: not_connected(reader))
        router.restart()
        async with open_session(session_config()) as writer:
            await writer.confirm(FACT, AT, fact(7))
        assert (await take_until_value(watch, 7))[-1] == 7


async def test_a_deletion_that_a_watch_missed_is_found_by_listing(router, session_config):
    """Deleted in the store while no router ran, so that no message ever told of it."""
    async with open_session(session_config(lease_s=1.0)) as reader, reader.watch(FACT) as watch:
        async with open_session(session_config()) as writer:
            await writer.confirm(FACT, AT, fact(1))
            await take_until_value(watch, 1)
        router.stop()
        await until(lambda: not_connected(reader))
        _delete_in_store(router.data_dir, "robotfleet/" + FACT.build(AT))
        router.restart()
        [change] = await take(watch, 1)
        assert (change.address, change.value) == (AT, None)


def _delete_in_store(data_dir: Any, keyexpr: str) -> None:
    with SqliteStore(data_dir) as store:
        [known] = store.select(keyexpr)
        assert store.apply([Write(keyexpr, known.stamp + (1 << 128), True, "", b"")]) == 1


async def test_an_empty_router_is_not_taken_for_deletion(router, session_config):
    """A router without its store answers nothing; what is known stays known."""
    async with open_session(session_config()) as reader, reader.watch(FACT) as watch:
        async with open_session(session_config()) as writer:
            await writer.confirm(FACT, AT, fact(1))
        await take_until_value(watch, 1)
        router.kill()
        config = zenoh_config("router", listen=[router.endpoint])
        with await asyncio.to_thread(zenoh.open, config):
            await reader.wait_connected(DEADLINE_S)
            with pytest.raises(TimeoutError):
                await take(watch, 1, 2.0)
        router.restart()
        async with open_session(session_config()) as writer:
            await writer.confirm(FACT, AT, fact(2))
        assert await take_until_value(watch, 2) == [2]


async def test_a_slow_reader_gets_only_the_latest_of_a_stream(session_config):
    async with (
        open_session(session_config()) as reader,
        open_session(session_config()) as writer,
        reader.watch(SIM_SENSES) as watch,
        reader.watch(SIM_SENSES) as quick,
    ):
        for number in range(1, 51):
            writer.put(SIM_SENSES, SimRobotAddress("r1"), senses(float(number)))
        # What another reader has seen before its last, the slow one has got.
        heard, count = asyncio.create_task(times_up_to(quick, 50.0)), 50
        while not heard.done():  # a stream may be dropped
            count += 1
            writer.put(SIM_SENSES, SimRobotAddress("r1"), senses(float(count)))
            await asyncio.wait({heard}, timeout=1.0)
        [newest] = await take(watch, 1)
        assert newest.value.time_s >= max([2.0, *heard.result()[:-1]])


async def times_up_to(watch: Watch, time_s: float) -> list[float]:
    """Of what a watch shows, until it is later than that."""
    seen = [0.0]
    while seen[-1] <= time_s:
        seen.append((await anext(watch)).value.time_s)
    return seen


class Questions:
    """Counts what a session asks from here on, and the values that came back."""

    def __init__(self, session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
        self.asked: list[str] = []
        self.values = 0
        self._query = session.link.query
        monkeypatch.setattr(session.link, "query", self.query)

    async def query(self, keyexpr: str, *args: Any, **more: Any) -> Any:
        replies = await self._query(keyexpr, *args, **more)
        self.asked.append(keyexpr)
        changes = STORE_CHANGES.build(StoreAddress())
        for sample in replies.values:
            page = (
                msgspec.json.decode(sample.data, type=StoreChanges) if keyexpr == changes else None
            )
            self.values += len(page.values) if page is not None else 1
        return replies


async def updated(watch: Watch) -> None:
    """Have a watch ask what it missed, and wait until it has."""
    before = watch.updates
    watch.relist()
    await until(partial(since, watch, before), "an update of the watch")


def since(watch: Watch, before: int) -> bool:
    return watch.updates > before


@pytest.mark.parametrize("stored", [1, 300])
async def test_an_idle_watch_asks_one_question_and_hears_nothing(
    session_config: Any, monkeypatch: pytest.MonkeyPatch, stored: int
) -> None:
    async with open_session(session_config()) as session:
        for number in range(stored):
            await session.confirm(GOAL_SPEC, GoalAddress(f"g{number}"), goal(f"g{number}"))
        async with session.watch(GOAL_SPEC, FACT, REPORT) as watch:
            await watch.synced()
            questions = Questions(session, monkeypatch)
            await updated(watch)
            assert questions.asked == [STORE_CHANGES.build(StoreAddress())]
            assert questions.values == 0


async def test_after_a_reconnection_only_what_changed_is_read(
    router: RouterProcess, session_config: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with open_session(session_config()) as reader, reader.watch(GOAL_SPEC) as watch:
        async with open_session(session_config()) as writer:
            for number in range(50):
                await writer.confirm(GOAL_SPEC, GoalAddress(f"g{number}"), goal(f"g{number}"))
        await take(watch, 50)
        for _ in range(2):  # the first may have begun before the last was put
            await updated(watch)
        router.stop()
        await until(lambda: not_connected(reader))
        _delete_in_store(router.data_dir, "robotfleet/" + GOAL_SPEC.build(GoalAddress("g7")))
        questions = Questions(reader, monkeypatch)
        router.restart()
        [change] = await take(watch, 1)
        assert (change.address, change.value) == (GoalAddress("g7"), None)
        assert questions.values == 1
        assert watch.listings == 1


def report(plan: str, attempt: int = 1) -> Report:
    return Report(
        robot="r1", plan=plan, revision=1, task="t1", attempt=attempt, epoch=1, incarnation="i1",
        state=ReportState.SUCCEEDED,
    )  # fmt: skip


async def test_a_narrowed_watch_lists_what_matters_and_hears_of_everything(
    session_config: Any,
) -> None:
    open_plans = {"open"}
    async with open_session(session_config()) as session:
        for plan in ("open", "over", "long-over"):
            await session.confirm(REPORT, ReportAddress.of(report(plan)), report(plan))
        narrowed = Narrowed(REPORT, "plan", lambda: open_plans)
        async with session.watch(narrowed) as watch:
            [listed] = await take(watch, 1)
            await watch.synced()
            assert listed.value == report("open")
            await session.confirm(REPORT, ReportAddress.of(report("over", 2)), report("over", 2))
            assert (await take(watch, 1))[0].value == report("over", 2)
            assert watch.remembered == 2
            await updated(watch)
            assert watch.remembered == 1, "what nobody asks for is not kept in memory"
            open_plans.clear()
            await updated(watch)
            assert watch.remembered == 0


async def test_what_was_known_before_and_is_gone_is_shown_as_deleted(session_config: Any) -> None:
    known = [(GOAL_SPEC, GoalAddress(name)) for name in ("g1", "g2")]
    async with open_session(session_config()) as session:
        await session.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"))
        async with session.watch(GOAL_SPEC, FACT, known=known) as watch:
            await watch.synced()
            shown = {change.address.goal: change.value for change in await take(watch, 2)}
            assert shown == {"g1": goal("g1"), "g2": None}


@asynccontextmanager
async def bare_router(endpoint: str) -> AsyncIterator[None]:
    """A router that stores nothing."""
    config = zenoh_config("router", listen=[endpoint])
    with await asyncio.to_thread(zenoh.open, config):
        yield


async def test_what_was_known_before_is_not_gone_where_no_store_answers(
    router: RouterProcess, session_config: Any
) -> None:
    router.kill()
    known = [(GOAL_SPEC, GoalAddress("g1"))]
    told: list[str | None] = []
    async with (
        bare_router(router.endpoint),
        open_session(session_config()) as session,
        session.watch(GOAL_SPEC, known=known, on_trouble=told.append) as watch,
    ):
        await until(lambda: told, "word that no store answers")
        assert "no store behind it" in str(told)
        assert watch.exists(GOAL_SPEC, GoalAddress("g1"))
        stamp, address = session.link.new_timestamp(), GoalAddress("g2")
        g2 = Put(GOAL_SPEC.build(address), GOAL_SPEC.encode(goal("g2")), "", stamp)
        await session.link.send(g2)
        [change] = await take(watch, 1)
        assert change.value == goal("g2")


async def test_a_store_that_cannot_be_read_is_told_once_and_read_when_it_can_be(
    router: RouterProcess, session_config: Any, caplog: pytest.LogCaptureFixture
) -> None:
    """A store that fails at first, at the end of a real link."""
    router.kill()
    asked: list[StoreChangesQuery] = []
    well = asyncio.Event()

    async def answer(_: StoreAddress, query: StoreChangesQuery) -> StoreChanges:
        asked.append(query)
        if not well.is_set():
            raise OSError("the disk is on fire")
        return StoreChanges(values=(), position="one/1/1", whole=not query.position, more=False)

    told: list[str | None] = []
    async with (
        bare_router(router.endpoint),
        open_session(session_config()) as store,
        store.serve(STORE_CHANGES, answer),
        open_session(session_config()) as session,
        session.watch(GOAL_SPEC, on_trouble=told.append) as watch,
    ):
        await until(lambda: len(asked) >= 3, "three questions")
        assert len(told) == 1
        assert "the disk is on fire" in str(told[0])
        assert watch.listings == 0
        well.set()
        await watch.synced()
        await until(lambda: len(told) == 2, "the end of the trouble")
        assert told[1] is None
    warnings = [r.getMessage() for r in caplog.records if r.levelname == "WARNING"]
    assert len([line for line in warnings if "cannot be read" in line]) == 1
