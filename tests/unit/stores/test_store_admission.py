"""Beyond its limits a store takes nothing in, and says so."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.limits import Limits
from keyexpr_schema.transport.store.admission import Admission
from keyexpr_schema.transport.store.storage import Write

NOW_S = 1_000_000.0
LIMITS = Limits(value_kb=1, document_mb=1, goals=2, facts=3, keys=4)


def stamp(after_s: float, writer: int = 7) -> int:
    return int((NOW_S + after_s) * 2**32) << 128 | writer


WRITERS = iter(range(1, 1000))


def goal(
    name: str,
    after_s: float = 0.0,
    realm: str = "r",
    *,
    deleted: bool = False,
    writer: int | None = None,
) -> Write:
    """A write of somebody else each time, or of `writer`."""
    data = b"" if deleted else b"x"
    at = stamp(after_s, writer or next(WRITERS))
    return Write(f"{realm}/goals/{name}/spec", at, deleted, "", data)


@pytest.fixture
def store(tmp_path: Path) -> Iterator[SqliteStore]:
    with SqliteStore(tmp_path) as opened:
        yield opened


@pytest.fixture
def admission(store: SqliteStore) -> Admission:
    return Admission(store, LIMITS, lambda: NOW_S, lambda: NOW_S)


def put(store: SqliteStore, admission: Admission, *writes: Write) -> list[str]:
    admitted = admission.admitted(writes)
    store.apply(admitted)
    return [write.keyexpr.split("/")[2] for write in admitted]


def test_there_is_room_for_so_many_keys_of_a_kind_in_each_realm(
    store: SqliteStore, admission: Admission
) -> None:
    assert put(store, admission, goal("a"), goal("b"), goal("c"), goal("a", 1.0)) == ["a", "b", "a"]
    assert put(store, admission, goal("c", 2.0), goal("c", 2.0, "other")) == ["c"]
    refused = admission.refused("r/goals/c/spec")
    assert refused is not None
    assert refused.why == (
        "there are 2 goal_spec keys, which is the most that is taken in: delete some"
    )
    assert refused.timestamp.startswith(str(stamp(2.0) >> 128))
    assert "not taken in 2 writes; the last was goals/c/spec" in (admission.refusing or "")


def test_what_is_deleted_makes_room(store: SqliteStore, admission: Admission) -> None:
    put(store, admission, goal("a"), goal("b"))
    assert put(store, admission, goal("a", 1.0, deleted=True), goal("c", 1.0)) == ["a", "c"]
    put(store, admission, Write("r/goals/*/spec", stamp(2.0), True, "", b""))
    assert put(store, admission, goal("d", 3.0), goal("e", 3.0), goal("f", 3.0)) == ["d", "e"]
    older = goal("d", 1.0, deleted=True)
    assert put(store, admission, older, goal("f", 3.0)) == []  # it deletes nothing


def test_what_was_there_before_counts_and_what_was_not_applied_does_not(store: SqliteStore) -> None:
    store.apply([goal("a")])
    admission = Admission(store, LIMITS, lambda: NOW_S, lambda: NOW_S)
    assert len(admission.admitted([goal("b"), goal("c")])) == 1
    admission.uncertain()
    assert put(store, admission, goal("d")) == ["d"]


def test_a_value_that_is_too_large_is_not_taken_in(admission: Admission) -> None:
    assert admission.takes("r/goals/a/spec", stamp(0.0), 1024)
    assert not admission.takes("r/goals/a/spec", stamp(0.0), 1025)
    assert admission.takes("r/plans/p/spec", stamp(0.0), 2**20)  # large by nature
    refused = admission.refused("r/goals/a/spec")
    assert refused is not None
    assert refused.why == "it has 0.000978 MiB, and a goal_spec has at most 0.000977"


def test_a_write_from_the_future_is_not_believed(store: SqliteStore) -> None:
    admission = Admission(store, LIMITS, lambda: NOW_S, lambda: NOW_S)
    assert admission.takes("r/goals/a/spec", stamp(4.0), 0)
    assert not admission.takes("r/goals/a/spec", stamp(86400.0), 0)
    assert not admission.takes("r/**", stamp(86400.0), 0)
    set_back = Admission(store, LIMITS, lambda: NOW_S - 3600.0, lambda: NOW_S)
    assert set_back.takes("r/goals/a/spec", stamp(1.0), 0)  # our own stamps are never set back


def test_refusals_are_told_for_a_while(store: SqliteStore) -> None:
    now_s = NOW_S
    admission = Admission(store, LIMITS, lambda: now_s, lambda: now_s)
    assert admission.refusing is None
    admission.takes("r/goals/a/spec", stamp(0.0), 5000)
    assert admission.refusing is not None
    now_s += 601.0
    assert admission.refusing is None


def test_nobody_has_more_than_half_of_the_keys(store: SqliteStore) -> None:
    admission = Admission(store, Limits(goals=6), lambda: NOW_S, lambda: NOW_S)
    flood = [goal(f"f{number}", writer=1) for number in range(9)]
    assert put(store, admission, *flood) == ["f0", "f1", "f2"]
    refused = admission.refused("r/goals/f3/spec")
    assert refused is not None
    assert (
        refused.why == "its writer has 3 goal_spec keys, and nobody may have more than half of all"
    )
    assert put(store, admission, goal("a"), goal("f0", 1.0, writer=2)) == ["a", "f0"]
    assert put(store, admission, goal("f4", 1.0, writer=1)) == ["f4"]  # f0 is not his any more
    admission.uncertain()  # it is counted anew
    assert put(store, admission, goal("f5", 1.0, writer=1), goal("b")) == ["b"]
    assert put(store, admission, goal("f4", 2.0, deleted=True), goal("f5", 2.0, writer=1)) == [
        "f4",
        "f5",
    ]


def test_what_was_said_before_what_is_there_does_not_count(
    store: SqliteStore, admission: Admission
) -> None:
    """Of keys that go by receipt; the store leaves it out just so."""

    def fact(name: str, writer: int, received: int, late_us: int = 0) -> Write:
        keyexpr, at = f"r/world/facts/{name}/at", stamp(0.0, writer)
        return Write(keyexpr, at, False, "", b"x", late_us, received)

    came = store.receipt() + 10_000_000
    writes = [
        fact("a", 1, came),
        fact("a", 2, came + 9, late_us=10),
        fact("b", 2, came + 20, late_us=5_000_000),
        fact("b", 3, came + 30, late_us=4_000_000),
        fact("b", 2, came + 40, late_us=6_000_000),
    ]
    admitted = admission.admitted(writes)
    assert admitted == [writes[0], writes[2], writes[3]]
    assert store.apply(writes) == 3
    assert [write.stamp & 7 for write in store.select("**")] == [1, 3]
