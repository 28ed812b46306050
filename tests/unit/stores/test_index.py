"""The index of a store: a pattern looks only where it can match, and nothing is left behind."""

from __future__ import annotations

import sys

from fleet.stores.index import Index
from keyexpr_schema.transport.store.storage import Write


def write(keyexpr: str, number: int) -> Write:
    return Write(keyexpr, number << 128, False, "", b"x")


def lines_run(function: object, *args: object) -> int:
    """How many lines and calls of Python `function` takes."""
    function(*args)  # type: ignore[operator]  # what is compiled once is not counted
    count = 0

    def trace(*_: object) -> object:
        nonlocal count
        count += 1
        return trace

    sys.settrace(trace)  # type: ignore[arg-type]
    try:
        function(*args)  # type: ignore[operator]
    finally:
        sys.settrace(None)
    return count


def filled(reports: int, robots: int = 10) -> Index:
    index = Index()
    for n in range(1, reports + 1):
        index.set(n, write(f"north/robots/r{n % robots}/reports/p/t{n}/1", n))
    index.set(reports + 1, write("north/robots/r1/orders/p/t", reports + 1))
    return index


def test_orders_are_found_without_a_look_at_the_reports():
    orders = "north/robots/*/orders/*/*"
    few, many = filled(100), filled(5000)
    assert [w.keyexpr for w in many.matching(orders)] == ["north/robots/r1/orders/p/t"]
    assert lines_run(many.matching, orders) == lines_run(few.matching, orders)

    def listed(index: Index) -> None:
        found, more = index.since([orders], 0, 100, 0)
        assert [w.keyexpr for _, w in found] == ["north/robots/r1/orders/p/t"]
        assert not more

    listed(many)
    assert lines_run(listed, many) == lines_run(listed, few)


def test_wildcards_cost_what_is_alive_not_what_is_deleted():
    reports = "north/robots/*/reports/*/*/*"

    def mostly_deleted(dead: int) -> Index:
        index = filled(dead + 5)
        for n in range(1, dead + 1):
            gone = f"north/robots/r{n % 10}/reports/p/t{n}/1"
            index.set(index.last + 1, Write(gone, index.last << 128, True, "", b""))
        return index

    def listed(index: Index) -> None:
        found, more = index.since([reports], 0, 100, index.last)
        assert (len(found), more) == (5, False)

    def answered(index: Index) -> None:
        assert len(index.matching(reports)) == 5

    few, many = mostly_deleted(100), mostly_deleted(5000)
    assert many.tombstones == 5000
    assert lines_run(answered, many) == lines_run(answered, few)
    assert lines_run(listed, many) == lines_run(listed, few)


def test_a_key_is_a_value_or_a_tombstone_and_told_once():
    index = Index()
    for n in range(1, 5):
        index.set(n, Write("north/world/places/a", n << 128, n % 2 == 0, "", b""))
        found, _ = index.since(["**"], 0, 10, 0)
        assert [(number, write.deleted) for number, write in found] == [(n, n % 2 == 0)]
        assert (len(index), index.tombstones) == (1, int(n % 2 == 0))
        assert len(index.matching("**")) == n % 2
    index.forget("north/world/places/a")
    assert (len(index), index.get("north/world/places/a")) == (0, None)


def test_what_changed_since_costs_what_changed():
    reports = "north/robots/*/reports/*/*/*"

    def news(index: Index) -> None:
        found, _ = index.since([reports], index.last - 2, 100, 0)
        assert len(found) == 1

    few = filled(100)
    for many in (filled(5000), filled(5000, robots=1000)):
        assert lines_run(news, many) == lines_run(news, few)


def test_keys_that_come_and_go_leave_nothing():
    index = Index()
    for n in range(1, 20_001):
        index.set(n, write(f"north/plans/p{n}/tasks/t", n))
        if n > 10:
            index.forget(f"north/plans/p{n - 10}/tasks/t")
    assert len(index) == 10
    assert len(index.matching("**")) == 10
    found, _ = index.since(["**"], 0, 100, 0)
    assert [number for number, _ in found] == list(range(19_991, 20_001))
    assert index.remembered < 3000
