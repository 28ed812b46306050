"""A store whose writers' clocks were ahead is put right: later writes hold, and nothing is lost."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from fleet.errors import StoreError, StoreInUse
from fleet.stores.clock_repair import Ahead, repair, stamped_ahead
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.transport.store.storage import Write

DAY_S = 86_400.0


def write(name: str, at_s: float, data: bytes = b"1", *, deleted: bool = False) -> Write:
    return Write(f"home/goals/{name}/spec", int(at_s * 2**32) << 128 | 7, deleted, "", data)


def shown(store: SqliteStore) -> dict[str, bytes]:
    return {each.keyexpr: each.data for each in store.select("**")}


def test_what_a_clock_that_was_ahead_has_written_can_be_changed_again(tmp_path: Path) -> None:
    now_s = time.time()
    ahead = [
        write("a", now_s + DAY_S, b"first"),
        write("gone", now_s + DAY_S + 1, deleted=True),
        write("b", now_s + DAY_S + 2, b"second"),
    ]
    with SqliteStore(tmp_path, wall_time_s=lambda: now_s + DAY_S) as store:
        store.apply([write("c", now_s - 5), *reversed(ahead)])
        assert store.apply([write("a", now_s, b"later")]) == 0  # as it is: hidden
        before, position = shown(store), store.changes(["**"], "", 100).position
        with pytest.raises(StoreInUse, match="stop it"):
            repair(tmp_path, now_s)
    found = stamped_ahead(tmp_path, now_s)
    assert [(each.key, each.deleted) for each in found] == [
        (each.keyexpr, each.deleted) for each in ahead
    ]
    assert found[0] == Ahead("home/goals/a/spec", pytest.approx(DAY_S, abs=1.0), False)
    assert stamped_ahead(tmp_path, now_s) == found  # a look changes nothing
    assert repair(tmp_path, now_s) == found
    assert repair(tmp_path, now_s) == []
    with SqliteStore(tmp_path) as store:
        assert shown(store) == before
        assert store.changes(["**"], position, 100).whole  # who knew it lists it anew
        stamps = [w.stamp for w in store.newest([each.keyexpr for each in ahead]) if w is not None]
        assert stamps == sorted(stamps)
        soon_s = now_s + 0.001
        again = [write("a", soon_s, b"later"), write("gone", soon_s, b"back"), write("c", soon_s)]
        assert store.apply(again) == 3
        assert shown(store)["home/goals/a/spec"] == b"later"
        assert shown(store)["home/goals/gone/spec"] == b"back"


def test_where_there_is_no_store_nothing_is_made(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="there is no store in"):
        repair(tmp_path / "none", 0.0)
    assert not list(tmp_path.iterdir())
