"""Laws of the writes on their way into a store."""

from __future__ import annotations

import tempfile
from collections import Counter, defaultdict
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.transport.stamps import source_of_stamp
from keyexpr_schema.transport.store.storage import Write
from keyexpr_schema.transport.store.write_queues import WriteQueues
from tests.support.reached import reaches

PUT = st.tuples(st.sampled_from([1, 1, 1, 1, 2, 3]), st.sampled_from("abcdef"))
"""Who writes which key; the first writes most."""
TAKE = st.integers(1, 5)
ASK = st.sets(st.sampled_from("abcdef"), min_size=1, max_size=3)


def keyexpr(name: str) -> str:
    return f"north/world/facts/{name}/at"


@reaches("held", "answered at once", "writers in turn", "waited for a key of another's")
@given(st.lists(st.one_of(PUT, PUT, PUT, TAKE, ASK), max_size=60))
@settings(max_examples=150, deadline=None)
def test_nothing_is_lost_each_writer_and_key_in_order_and_questions_wait_for_theirs(
    reached, what_happens
):
    queues: WriteQueues[int] = WriteQueues()
    put: list[Write] = []
    applied: list[Write] = []
    asked: dict[int, list[Write]] = {}
    """What was put before a question, of its keys."""

    def take(most: int) -> None:
        batch = queues.take(most)
        assert len(batch) <= most
        assert batch or not len(queues)  # the oldest of all can always be taken
        waiting = [w for w in put if w not in applied]
        free = {source_of_stamp(w.stamp) for w in waiting if is_free(w, waiting)}
        turns = Counter(source_of_stamp(w.stamp) for w in batch)
        if len(batch) == most >= len(free):
            assert all(turns[writer] for writer in free), "nobody waits for more than one of each"
            reached["writers in turn"] += len(free) > 1
        applied.extend(batch)
        for question in queues.applied():
            assert all(w in applied for w in asked.pop(question))
        assert not [q for q, wanted in asked.items() if all(w in applied for w in wanted)]

    def is_free(write: Write, waiting: list[Write]) -> bool:
        """Whether it is the first of its writer and of its key."""
        writer = source_of_stamp(write.stamp)
        first_of_key = next(w for w in waiting if w.keyexpr == write.keyexpr)
        first = next(w for w in waiting if source_of_stamp(w.stamp) == writer)
        reached["waited for a key of another's"] += first is write is not first_of_key
        return write is first is first_of_key

    for number, what in enumerate(what_happens, 1):
        if isinstance(what, int):
            take(what)
        elif isinstance(what, tuple):
            writer, name = what
            write = Write(keyexpr(name), number << 128 | writer, False, "", b"x")
            put.append(write)
            queues.put(write)
        else:
            keys = {keyexpr(name) for name in what}
            wanted = [w for w in put if w.keyexpr in keys and w not in applied]
            held = queues.hold(number, keys, [])
            assert held == bool(wanted)
            reached["held" if held else "answered at once"] += 1
            if held:
                asked[number] = wanted
        assert len(queues) == len(put) - len(applied)
    while len(queues):
        take(5)
    assert not asked
    assert Counter(applied) == Counter(put)
    orders: dict[object, list[int]] = defaultdict(list)
    for each in applied:
        orders[source_of_stamp(each.stamp)].append(each.stamp)
        orders[each.keyexpr].append(each.stamp >> 128)
    assert all(order == sorted(order) for order in orders.values())


GOALS = st.tuples(
    st.integers(1, 3),
    st.sampled_from(["a/spec", "a/status", "b/spec", "a/*", "b/*"]),
    st.integers(1, 20),
)
"""Who writes what about a goal, with which stamp; with a wildcard it is deleted."""


@reaches("deleted", "in another order")
@given(st.lists(GOALS, max_size=14), st.integers(1, 4))
@settings(max_examples=60, deadline=None)
def test_the_store_ends_as_if_all_had_been_applied_as_it_came(reached, said, most):
    """Deletions of all that is about a goal included, whatever anybody's clock says."""
    queues: WriteQueues[int] = WriteQueues()
    writes = [
        Write(f"north/goals/{key}", at << 128 | writer, "*" in key, "", b"%d" % number)
        for number, (writer, key, at) in enumerate(said)
    ]
    with (
        tempfile.TemporaryDirectory() as one,
        tempfile.TemporaryDirectory() as other,
        SqliteStore(Path(one)) as in_turn,
        SqliteStore(Path(other)) as as_it_came,
    ):
        taken: list[Write] = []
        for write in writes:
            queues.put(write)
            as_it_came.apply([write])
        while batch := queues.take(most):
            taken += batch
            in_turn.apply(batch)
            queues.applied()
        keys = ["north/goals/a/spec", "north/goals/a/status", "north/goals/b/spec"]
        found, expected = in_turn.newest(keys), as_it_came.newest(keys)
    as_told = [
        [each and (each.stamp, each.deleted, each.data) for each in f] for f in (found, expected)
    ]
    assert as_told[0] == as_told[1]
    reached["deleted"] += any(each is not None and each.deleted for each in expected)
    reached["in another order"] += taken != writes
