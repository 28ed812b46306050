"""Laws of a store: what it shows depends on what was written, not on when it arrived."""

from __future__ import annotations

import tempfile
from pathlib import Path

import zenoh
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.transport.samples import timestamp_of_stamp
from keyexpr_schema.transport.stamps import stamp_of_text, text_of_stamp
from keyexpr_schema.transport.store.patterns import matcher
from keyexpr_schema.transport.store.storage import JournalQuery, Write
from tests.support.reached import reaches
from tests.support.stored import as_written

KEYS = st.sampled_from([f"north/world/facts/{name}/at" for name in "abc"])
WRITES = st.lists(
    st.builds(
        Write,
        KEYS,
        st.integers(1, 50).map(lambda n: n << 128 | 7),
        st.booleans(),
        st.just("application/json"),
        st.binary(max_size=4),
    ),
    unique_by=lambda write: write.stamp,
    max_size=12,
)
STAMPS = st.builds(
    lambda time, source: time << 128 | source,
    st.integers(1 << 40, 2**63),
    st.integers(1, 2**128 - 1),
)


def shown(batches: list[list[Write]], reopen: bool = False) -> list[Write]:
    with tempfile.TemporaryDirectory() as directory:
        with SqliteStore(Path(directory)) as store:
            for batch in batches:
                store.apply(batch)
            found = store.select("**")
        if reopen:
            with SqliteStore(Path(directory)) as store:
                assert store.select("**") == found
        return as_written(found)


def latest(writes: list[Write]) -> list[Write]:
    newest: dict[str, Write] = {}
    for write in sorted(writes, key=lambda write: write.stamp):
        newest[write.keyexpr] = write
    return sorted((w for w in newest.values() if not w.deleted), key=lambda w: w.keyexpr)


@reaches("overwritten", "deleted")
@given(WRITES, st.randoms(use_true_random=False), st.integers(1, 5))
@settings(max_examples=60, deadline=None)
def test_the_latest_wins_in_any_order_in_any_batches_twice_and_after_reopening(
    reached, writes, random, size
):
    shuffled = [*writes, *writes]
    random.shuffle(shuffled)
    batches = [shuffled[start : start + size] for start in range(0, len(shuffled), size)]
    expected = latest(writes)
    assert shown(batches, reopen=True) == expected
    reached["overwritten"] += len({write.keyexpr for write in writes}) < len(writes)
    reached["deleted"] += len({write.keyexpr for write in writes}) > len(expected)


@given(WRITES)
@settings(max_examples=40, deadline=None)
def test_a_repeated_write_changes_nothing_and_is_not_journaled(writes):
    with tempfile.TemporaryDirectory() as directory, SqliteStore(Path(directory)) as store:
        store.apply(writes)
        entries, last = store.journal("north", JournalQuery(0, 1000))
        assert [entry.number for entry in entries] == list(range(1, last + 1))
        assert store.apply(writes) == 0
        assert store.journal("north", JournalQuery(0, 1000)) == (entries, last)
        assert store.journal("nort", JournalQuery(0, 1000)) == ([], last)


CHUNK = st.sampled_from(["a", "b", "ab", "abc", "@a", "a.b"])
WILD = st.one_of(CHUNK, st.sampled_from(["*", "**", "a$*", "$*b", "$*"]))


@reaches("matched", "not matched")
@given(st.lists(WILD, min_size=1, max_size=5), st.lists(CHUNK, min_size=1, max_size=5))
@settings(max_examples=500)
def test_wildcards_match_as_zenoh_matches(reached, wild, chunks):
    pattern = str(zenoh.KeyExpr.autocanonize("/".join(wild)))
    key = "/".join(chunks)
    ours = matcher(pattern).fullmatch("/" + key) is not None
    assert ours == zenoh.KeyExpr(pattern).intersects(key), (pattern, key)
    reached["matched" if ours else "not matched"] += 1


@given(STAMPS, STAMPS)
def test_stamps_keep_every_bit_and_a_rebuilt_timestamp_is_never_newer(one, other):
    assert stamp_of_text(text_of_stamp(one)) == one
    rebuilt = stamp_of_text(str(timestamp_of_stamp(one)))
    assert one - (20 << 128) <= rebuilt <= one
    a, b = timestamp_of_stamp(one), timestamp_of_stamp(other)
    assert (a < b) == (stamp_of_text(str(a)) < stamp_of_text(str(b)))


@reaches("deleted", "paged", "forgot nothing")
@given(WRITES, st.lists(st.integers(0, 3), min_size=1, max_size=8), st.integers(1, 3))
@settings(max_examples=60, deadline=None)
def test_who_follows_the_changes_page_by_page_knows_what_the_store_holds(
    reached, writes, sizes, limit
):
    """Whatever is written between two pages."""
    known: dict[str, bytes] = {}
    position, rest = "", list(writes)
    with tempfile.TemporaryDirectory() as directory, SqliteStore(Path(directory)) as store:
        for size in [*sizes, len(rest), 0, 0, 0, 0, 0, 0, 0, 0, 0]:
            store.apply(rest[:size])
            rest = rest[size:]
            page = store.changes(["north/world/facts/*/at"], position, limit)
            assert page.whole == (not position)
            position = page.position
            reached["paged"] += page.more
            for write in page.writes:
                if write.deleted:
                    reached["deleted"] += known.pop(write.keyexpr, None) is not None
                else:
                    known[write.keyexpr] = write.data
        reached["forgot nothing"] += bool(known)
        assert not page.more
        assert known == {write.keyexpr: write.data for write in store.select("**")}
