"""Laws of who spoke last: the store's receipt says it, and no writer's clock."""

from __future__ import annotations

import tempfile
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.core import events
from fleet.core.state import LOGIC, State
from fleet.core.step import step
from fleet.service.snapshots import Snapshot, decode_snapshot, encode_snapshot
from fleet.stores.receipts import ReceiptClock
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.decoding import decode
from keyexpr_schema.facts import AT
from keyexpr_schema.keyspace import FACT
from keyexpr_schema.payloads.world import Fact, FactAddress
from keyexpr_schema.transport.store.storage import Changes, Write
from tests.support.reached import Reached, reaches

NOW_S = 1_800_000_000
KEY = f"home/{FACT.build(FactAddress('cup_1', AT))}"
SAID = st.tuples(st.integers(1, 3), st.sampled_from(["kitchen", "hallway", "attic"]))
SKEWS_S = st.fixed_dictionaries({n: st.integers(-90_000, 90_000) for n in (1, 2, 3)})


def at(number: int) -> dict[str, float]:
    return {"time_s": NOW_S + number, "wall_time_s": NOW_S + number, "monotonic_s": number}


def begun() -> State:
    started = events.PlannerStarted(epoch=1, incarnation="i", logic=LOGIC, lineage="l", **at(0))
    return step(State(), started)[0]


def heard(state: State, page: Changes, number: int) -> State:
    for write in page.writes:
        fact = decode(write.data, Fact)
        told = events.FactPut(fact=fact, received=write.received, **at(number))
        state, _ = step(state, events.decode_event(events.encode_event(told)))
    return state


@reaches("against the clocks", "heard together", "restarted", "another's")
@given(st.lists(SAID, min_size=2, max_size=8), SKEWS_S, st.lists(st.integers(0, 3), min_size=8))
@settings(max_examples=60, deadline=None)
def test_what_is_believed_is_what_came_last_to_the_store(
    reached: Reached, said: list[tuple[int, str]], skews_s: dict[int, int], acts: list[int]
) -> None:
    """Whatever the writers' clocks say, and whether planner or store begin anew in between."""
    state, position = begun(), ""
    with tempfile.TemporaryDirectory() as folder:
        store = SqliteStore(Path(folder))
        try:
            claims: list[float] = []
            for number, (source, place) in enumerate(said):
                claims.append(NOW_S + skews_s[source] + number)
                fact = Fact(
                    subject="cup_1", relation=AT, value=place,
                    source=f"r{source}", time_s=claims[-1],
                )  # fmt: skip
                stamp = int(claims[-1]) << 160 | source
                store.apply([Write(KEY, stamp, False, "", FACT.encode(fact))])
                act = acts[number]
                if act == 0:
                    reached["heard together"] += 1
                    continue
                if act == 1:
                    store.close()
                    store = SqliteStore(Path(folder))
                if act == 2:
                    read = decode_snapshot(encode_snapshot(Snapshot(state=state)))
                    assert read is not None
                    state, position = read.state, ""
                    reached["restarted"] += 1
                page = store.changes([KEY], position, 100)
                state, position = heard(state, page, number), page.position
            state = heard(state, store.changes([KEY], position, 100), len(said))
            last = state.fact(AT, "cup_1")
            assert last is not None
            assert (last.source, last.value) == (f"r{said[-1][0]}", said[-1][1])
            reached["against the clocks"] += claims[-1] < max(claims)
            reached["another's"] += said[-1][0] != said[-2][0]
        finally:
            store.close()


HELD_BACK = st.lists(st.tuples(st.integers(1, 2), st.integers(0, 10**12)), min_size=2, max_size=8)


@reaches("held back", "overtaken")
@given(HELD_BACK)
@settings(max_examples=60, deadline=None)
def test_the_receipts_of_a_key_only_rise(reached: Reached, said: list[tuple[int, int]]) -> None:
    """However long each write was held back: none of a session is lost, nor looks older."""
    position, receipts, last = "", [0], 0
    with tempfile.TemporaryDirectory() as folder:
        store = SqliteStore(Path(folder))
        try:
            for number, (source, late_us) in enumerate(said):
                stamp = (NOW_S + number) << 160 | source
                store.apply([Write(KEY, stamp, False, "", b"", late_us)])
                page = store.changes([KEY], position, 100)
                position = page.position
                receipts += [write.received for write in page.writes]
                reached["held back"] += source == last and late_us > 0
                reached["overtaken"] += not page.writes
                assert page.writes or source != last
                last = source if page.writes else last
        finally:
            store.close()
    assert receipts == sorted(set(receipts))


@reaches("set back")
@given(st.lists(st.tuples(st.integers(0, 10**6), st.integers(-(10**9), 10**9)), max_size=6))
def test_receipts_only_rise(reached: Reached, runs: list[tuple[int, int]]) -> None:
    """However the host's clock is set between two runs of the store."""
    last, wall_s = 0, float(NOW_S)
    for passed_s, jump_s in runs:
        wall_s += jump_s
        reached["set back"] += jump_s < 0 < last
        ticks = iter((0, 0, passed_s * 10**9))
        clock = ReceiptClock(last, wall_s, lambda ticks=ticks: next(ticks))  # type: ignore[misc]
        first, second = clock.now(), clock.now()
        assert last < first < second
        assert second - first >= passed_s * 10**6
        last = second


def test_what_has_waited_was_received_when_it_came(tmp_path):
    """However long it waits in a queue, and by how much its writer says that it is late besides."""
    with SqliteStore(tmp_path) as store:
        first, second, third = store.receipt(), store.receipt(), store.receipt()

        def came(received: int, source: int, late_us: int = 0) -> int:
            stamp = (NOW_S << 160) | source
            return store.apply([Write(KEY, stamp, False, "", b"x", late_us, received)])

        assert came(second, 1) == 1
        assert came(first, 2) == 0
        assert came(third, 3, late_us=third - first) == 0
        assert came(third, 4) == 1
        (newest,) = store.newest([KEY])
        assert newest is not None
        assert newest.received == third
        assert came(0, 5) == 1
