"""What is over leaves the store: tombstones and journal entries, from memory and from the file."""

from __future__ import annotations

import sqlite3
import tracemalloc
from contextlib import closing
from pathlib import Path

from fleet.stores.sqlite import SqliteStore, StoreMemory
from keyexpr_schema.transport.store.storage import JournalQuery, Write
from tests.support.stored import as_written

DAY_S = 86_400.0
PLACES = ["north/world/places/*"]


class Clock:
    """The store's wall clock, by hand."""

    def __init__(self) -> None:
        self.now_s = 1000 * DAY_S

    def __call__(self) -> float:
        return self.now_s


def write(name: str, time: int, *, deleted: bool = False) -> Write:
    data = b"" if deleted else b"x" * 200
    return Write(f"north/world/places/{name}", time << 128 | 7, deleted, "", data)


def rows(path: Path, table: str) -> int:
    with closing(sqlite3.connect(path / "state.sqlite")) as db, db:
        count: int = db.execute(f"SELECT count(*) FROM {table}").fetchone()[0]
    return count


def test_tombstones_hold_for_days_and_then_leave(tmp_path):
    clock = Clock()
    with SqliteStore(tmp_path, wall_time_s=clock) as store:
        store.apply([write("a", 1), write("b", 2)])
        store.apply([write("a", 5, deleted=True)])
        clock.now_s += 6.9 * DAY_S
        assert store.apply([write("a", 4)]) == 0
        store.apply([write("c", 6)])
        assert rows(tmp_path, "latest") == 3
        clock.now_s += 0.2 * DAY_S
        store.apply([write("c", 7)])
        assert rows(tmp_path, "latest") == 2
        assert store.newest(["north/world/places/a"]) == [None]
        # Put again before its tombstone fades, a key stays.
        store.apply([write("b", 8, deleted=True)])
        store.apply([write("b", 9)])
        clock.now_s += 8 * DAY_S
        store.apply([write("c", 10)])
        assert [w.keyexpr[-1] for w in store.select("**")] == ["b", "c"]
    with SqliteStore(tmp_path, wall_time_s=clock) as store:
        assert [w.keyexpr[-1] for w in store.select("**")] == ["b", "c"]


def test_who_has_not_looked_for_longer_than_a_tombstone_lasts_lists_everything(tmp_path):
    clock = Clock()
    with SqliteStore(tmp_path, wall_time_s=clock) as store:
        store.apply([write("a", 1), write("b", 2)])
        before = store.changes(PLACES, "", 10).position
        store.apply([write("a", 3, deleted=True)])
        after = store.changes(PLACES, before, 10).position
        clock.now_s += 8 * DAY_S
        store.apply([write("b", 4)])
        # One saw the deletion, the other would never hear of it.
        assert not store.changes(PLACES, after, 10).whole
        late = store.changes(PLACES, before, 10)
        assert (late.whole, [w.keyexpr[-1] for w in late.writes]) == (True, ["b"])
        # A listing that begins now needs no deletions of before, however many pages it has.
        first = store.changes(PLACES, "", 1)
        assert not store.changes(PLACES, first.position, 1).whole
    with SqliteStore(tmp_path, wall_time_s=clock) as store:
        assert store.changes(PLACES, before, 10).whole
        position = store.changes(PLACES, "", 10).position
        store.apply([write("n", 9)])
        assert [w.keyexpr[-1] for w in store.changes(PLACES, position, 10).writes] == ["n"]


def test_the_number_of_changes_never_returns_though_the_newest_is_forgotten(tmp_path):
    clock = Clock()
    with SqliteStore(tmp_path, wall_time_s=clock) as store:
        store.apply([write("a", 1), write("b", 2), write("b", 3, deleted=True)])
        clock.now_s += 8 * DAY_S
        store.apply([Write("north/none/*", 4 << 128, True, "", b""), write("a", 2)])
        position = store.changes(PLACES, "", 10).position
    with SqliteStore(tmp_path, wall_time_s=clock) as store:
        store.apply([write("c", 5)])
        assert [w.keyexpr[-1] for w in store.changes(PLACES, position, 10).writes] == ["c"]


def test_the_journal_is_cut_by_age_and_by_count(tmp_path):
    clock = Clock()
    memory = StoreMemory(journal_entries=5000, journal_days=2)
    with SqliteStore(tmp_path, memory=memory, wall_time_s=clock) as store:
        for day in range(6):
            clock.now_s += DAY_S
            store.apply([write(f"p{n}", day * 1000 + n + 1) for n in range(1000)])
        found, last = store.journal("north", JournalQuery(limit=10_000))
        assert last == 6000
        assert {round((clock.now_s - entry.wall_time_s) / DAY_S) for entry in found} == {0, 1, 2}
        store.apply([write(f"p{n}", 10_000 + n) for n in range(9000)])
        assert rows(tmp_path, "journal") == 5000


def test_the_journal_is_cut_by_bytes_also_by_the_next_process(tmp_path):
    memory = StoreMemory(journal_mb=1.0)

    def kept(store: SqliteStore) -> tuple[int, int, int]:
        found, last = store.journal("north", JournalQuery(limit=10_000))
        return len(found), found[-1].number - last, sum(len(entry.data) for entry in found)

    def put(store: SqliteStore, number: int, size: int) -> None:
        store.apply(
            [Write(f"north/plans/p{number}/spec", number << 128 | 7, False, "", size * b"x")]
        )

    for run in range(2):
        with SqliteStore(tmp_path, memory=memory) as store:
            for number in range(400 * run + 1, 400 * run + 401):
                put(store, number, 10_000)
                assert kept(store)[2] <= 1.07 * 2**20
            entries, newest, size = kept(store)
            assert newest == 0
            assert 90 <= entries <= 105
            assert size >= 0.9 * 2**20
    with SqliteStore(tmp_path, memory=memory) as store:
        # One that is larger than all there may be leaves room for nothing else.
        put(store, 1000, 3 * 2**20)
        assert kept(store)[:2] == (1, 0)


def test_a_busy_store_forgets_the_oldest_of_too_many_deletions(tmp_path):
    memory = StoreMemory(tombstones=100)
    with SqliteStore(tmp_path, memory=memory) as store:
        store.apply([write("kept", 1)])
        long_ago = store.changes(PLACES, "", 10).position
        for n in range(1, 301):
            store.apply([write(f"p{n}", 4 * n), write(f"p{n}", 4 * n + 1, deleted=True)])
        assert rows(tmp_path, "latest") <= 102
        newest = store.newest([f"north/world/places/p{n}" for n in (190, 300)])
        assert as_written(newest) == [None, write("p300", 1201, deleted=True)]
        assert store.apply([write("p300", 1200)]) == 0
        # Who has not looked since before lists everything: of some deletions nothing is known.
        late = store.changes(PLACES, long_ago, 1000)
        assert (late.whole, [w.keyexpr[-4:] for w in late.writes]) == (True, ["kept"])
    with SqliteStore(tmp_path, memory=memory) as store:
        assert store.apply([write("p300", 1200)]) == 0
        store.apply([write(f"q{n}", 2000 + n, deleted=True) for n in range(10)])
        assert rows(tmp_path, "latest") <= 111


def pages(path: Path) -> tuple[int, int]:
    """Of the file, and those of them that are not used."""
    db = sqlite3.connect(path / "state.sqlite")
    found = tuple(
        db.execute(f"PRAGMA {name}").fetchone()[0] for name in ("page_count", "freelist_count")
    )
    db.close()
    return found  # type: ignore[return-value]


def test_the_file_stops_growing_and_gives_back_what_it_does_not_use(tmp_path):
    clock = Clock()
    memory = StoreMemory(journal_mb=1.0, tombstones=100)
    stamp = 0

    def live(store: SqliteStore, missions: int) -> int:
        nonlocal stamp
        for _ in range(missions):
            stamp += 100
            names = [f"m{stamp}-{n}" for n in range(20)]
            store.apply([write(name, stamp + n) for n, name in enumerate(names)])
            store.apply([write(n, stamp + 50 + at, deleted=True) for at, n in enumerate(names)])
        return pages(tmp_path)[0]

    with SqliteStore(tmp_path, memory=memory, wall_time_s=clock) as store:
        young = live(store, 300)
        assert live(store, 900) <= 1.05 * young
        # Much is stored for once, and deleted.
        some = [write(f"x{n}", stamp + n + 1) for n in range(50_000)]
        store.apply(some)
        full = pages(tmp_path)[0]
        stamp += len(some)
        store.apply([Write("north/world/places/*", stamp + 1 << 128 | 7, True, "", b"")])
        live(store, 900)
        there, unused = pages(tmp_path)
        assert there < full / 3
        assert unused < max(1000, there / 2)


def test_a_file_of_before_is_made_small_when_it_is_opened(tmp_path):
    with SqliteStore(tmp_path) as store:
        store.apply([write(f"x{n}", n + 1) for n in range(20_000)])
    db = sqlite3.connect(tmp_path / "state.sqlite")
    db.execute("PRAGMA auto_vacuum = NONE")
    db.execute("VACUUM")
    db.execute("DELETE FROM latest WHERE number > 10")
    db.execute("DELETE FROM journal WHERE number > 10")
    db.commit()
    db.close()
    assert pages(tmp_path)[1] > 1000
    with SqliteStore(tmp_path) as store:
        assert pages(tmp_path)[1] == 0
        assert [w.keyexpr[-1] for w in store.select("**")] == list("0123456789")
        assert len(store.journal("north", JournalQuery())[0]) == 10


def test_a_simulation_and_states_are_not_in_the_journal(tmp_path):
    with SqliteStore(tmp_path) as store:
        stamp = 5 << 128
        keys = ["sim/truth/cup_1", "sim/scene", "robots/r1/state", "robots/r1/orders/p/t"]
        store.apply([Write(f"north/{key}", stamp, False, "", b"{}") for key in keys])
        entries, _ = store.journal("north", JournalQuery())
        assert [entry.keyexpr for entry in entries] == ["north/robots/r1/orders/p/t"]
        assert len(store.select("north/**")) == 4


def test_the_journal_finds_what_is_asked_for(tmp_path):
    clock = Clock()
    with SqliteStore(tmp_path, wall_time_s=clock) as store:
        for n in range(1, 21):
            clock.now_s += 10
            goal = Write(f"north/goals/g{n}/spec", n << 129, False, "", b"{}")
            store.apply([goal, write(f"p{n}", n << 1 | 1)])

        def numbers(**asked) -> list[int]:
            entries, _ = store.journal("north", JournalQuery(**asked))
            assert entries == sorted(entries, key=lambda each: each.number)
            return [entry.number for entry in entries]

        assert numbers(newest=True, limit=3) == [38, 39, 40]
        assert numbers(newest=True, limit=2, pattern="goals/*/spec") == [37, 39]
        assert numbers(pattern="goals/g3/spec") == [5]
        assert numbers(pattern="goals/g1*/spec") == []  # a wildcard is a whole chunk, or `$*`
        assert numbers(pattern="goals/g1$*/spec", limit=2) == [1, 19]
        assert numbers(since_s=clock.now_s - 15) == [37, 38, 39, 40]
        assert numbers(since_s=clock.now_s + 1) == []
        assert numbers(since_s=0, limit=2) == [1, 2]
        assert numbers(after=38, since_s=clock.now_s - 1000) == [39, 40]


def test_keys_that_come_and_go_leave_memory_and_file_flat(tmp_path):
    """So many that each would be seen, over weeks by the store's clock."""
    clock = Clock()
    memory = StoreMemory(journal_entries=2000, journal_days=3, tombstone_days=1)
    sizes: list[tuple[int, int, int]] = []
    with SqliteStore(tmp_path, memory=memory, wall_time_s=clock) as store:
        stamp = 0
        tracemalloc.start()
        for mission in range(600):
            clock.now_s += DAY_S / 50
            # Names come back long after their tombstones: what is known of names is cached.
            names = [f"m{mission % 100}-{n}" for n in range(20)]
            for deleted in (False, True):
                stamp += 20
                store.apply([write(m, stamp + n, deleted=deleted) for n, m in enumerate(names)])
            if mission % 200 == 199:
                used = tracemalloc.get_traced_memory()[0]
                sizes.append((rows(tmp_path, "latest"), rows(tmp_path, "journal"), used))
        tracemalloc.stop()
    assert all(latest <= 52 * 20 for latest, _, _ in sizes)
    assert all(journal <= 3000 for _, journal, _ in sizes)
    assert sizes[-1][2] < 1.2 * sizes[0][2]
