"""What a session may count on, whatever keeps the values: our store, or Zenoh's storage manager.

`plain` does what a storage of zenohd does; `zenohd` is one, where it is installed.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from msgspec.structs import replace

from fleet.service.router_process import with_port
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.errors import Overtaken
from keyexpr_schema.keyspace import GOAL_SPEC, GOAL_TREE
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.transport.link import Put
from keyexpr_schema.transport.router import run_router
from keyexpr_schema.transport.samples import encoding_of, timestamp_of_stamp
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from keyexpr_schema.transport.stamps import stamp_of_text
from tests.support.plain_storage import plain_storage
from tests.support.polling import DEADLINE_S, until
from tests.support.session_values import goal
from tests.support.zenohd import zenohd

G1 = GoalAddress("g1")
HOUR_S = 3600.0


@asynccontextmanager
async def _ours(folder: Path) -> AsyncIterator[str]:
    endpoint = with_port("tcp/127.0.0.1:0")
    with SqliteStore(folder) as store:
        async with run_router((endpoint,), store=store):
            yield endpoint


@asynccontextmanager
async def _plain(_: Path) -> AsyncIterator[str]:
    async with plain_storage() as (endpoint, _storage):
        yield endpoint


@asynccontextmanager
async def sessions(kind: str, folder: Path) -> AsyncIterator[tuple[Session, Session]]:
    """Two sessions of one realm, with a store of that kind."""
    stores = {"ours": _ours, "plain": _plain, "zenohd": zenohd}
    async with stores[kind](folder) as endpoint:
        config = SessionConfig((endpoint,))
        async with open_session(config) as one, open_session(config) as other:
            yield one, other


any_store = pytest.mark.parametrize("kind", ["ours", "plain", "zenohd"])


def ahead(session: Session, monkeypatch: pytest.MonkeyPatch, seconds: float) -> None:
    """Set the clock by which this session stamps what it writes."""
    now = session.link.new_timestamp

    def shifted() -> object:
        return timestamp_of_stamp(stamp_of_text(str(now())) + (int(seconds * 2**32) << 128))

    monkeypatch.setattr(session.link, "new_timestamp", shifted)


@any_store
async def test_what_is_confirmed_is_there_for_others(kind: str, tmp_path: Path) -> None:
    async with sessions(kind, tmp_path) as (one, other):
        await asyncio.gather(
            *(one.confirm(GOAL_SPEC, GoalAddress(f"n{n}"), goal(f"n{n}")) for n in range(20))
        )
        assert await other.list(GOAL_SPEC) == {
            GoalAddress(f"n{n}"): goal(f"n{n}") for n in range(20)
        }
        assert await other.get(GOAL_SPEC, GoalAddress("n3")) == goal("n3")
        assert await other.get(GOAL_SPEC, G1) is None


@any_store
async def test_the_latest_holds_whatever_comes_last(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with sessions(kind, tmp_path) as (one, behind):
        await one.confirm(GOAL_SPEC, G1, goal("g1", "first"))
        ahead(behind, monkeypatch, -HOUR_S)
        with pytest.raises(Overtaken):
            await behind.confirm(GOAL_SPEC, G1, goal("g1", "second"))
        with pytest.raises(Overtaken):
            await behind.delete(GOAL_SPEC, G1)
        assert await one.get(GOAL_SPEC, G1) == goal("g1", "first")


@any_store
async def test_what_is_deleted_stays_so(kind: str, tmp_path: Path) -> None:
    """An older value that comes late does not bring it back."""
    async with sessions(kind, tmp_path) as (one, other):
        await one.confirm(GOAL_SPEC, G1, goal("g1"))
        early = one.link.new_timestamp()
        await one.delete(GOAL_SPEC, G1)
        assert await other.get(GOAL_SPEC, G1) is None
        late = GOAL_SPEC.encode(goal("g1", "late"))
        await one.link.send(Put(GOAL_SPEC.build(G1), late, encoding_of(GOAL_SPEC), early))
        await one.confirm(GOAL_SPEC, GoalAddress("after"), goal("after"))
        assert set(await other.list(GOAL_SPEC)) == {GoalAddress("after")}


@any_store
async def test_a_tree_is_deleted_as_a_whole(kind: str, tmp_path: Path) -> None:
    async with sessions(kind, tmp_path) as (one, other):
        for name in ("g1", "g2"):
            await one.confirm(GOAL_SPEC, GoalAddress(name), goal(name))
        await other.delete_tree(GOAL_TREE, "g1")
        assert set(await one.list(GOAL_SPEC)) == {GoalAddress("g2")}


@any_store
async def test_who_comes_late_is_shown_what_is_there_and_then_what_changes(
    kind: str, tmp_path: Path
) -> None:
    async with sessions(kind, tmp_path) as (one, other):
        await one.confirm(GOAL_SPEC, G1, goal("g1", "before"))
        async with other.watch(GOAL_SPEC) as watch:
            seen = await asyncio.wait_for(anext(watch), DEADLINE_S)
            assert (seen.address, seen.value) == (G1, goal("g1", "before"))
            await one.confirm(GOAL_SPEC, G1, goal("g1", "after"))
            assert (await asyncio.wait_for(anext(watch), DEADLINE_S)).value == goal("g1", "after")
            await one.delete(GOAL_SPEC, G1)
            assert (await asyncio.wait_for(anext(watch), DEADLINE_S)).value is None


@any_store
async def test_what_is_there_is_not_created_again_and_a_change_sees_it(
    kind: str, tmp_path: Path
) -> None:
    async with sessions(kind, tmp_path) as (one, other):
        assert await one.create(GOAL_SPEC, G1, goal("g1", "first"))
        assert not await other.create(GOAL_SPEC, G1, goal("g1", "second"))
        assert await other.get(GOAL_SPEC, G1) == goal("g1", "first")
        await one.update(GOAL_SPEC, G1, lambda _: goal("g1", "third"))
        changed = await other.update(
            GOAL_SPEC, G1, lambda seen: replace(seen or goal("g1"), priority=2)
        )
        assert (changed.text, changed.priority) == ("third", 2)
        assert await one.get(GOAL_SPEC, G1) == changed


@any_store
async def test_put_and_forget_arrives_while_the_link_is_up(kind: str, tmp_path: Path) -> None:
    async with sessions(kind, tmp_path) as (one, other):
        one.put(GOAL_SPEC, G1, goal("g1"))

        async def there() -> bool:
            return await other.get(GOAL_SPEC, G1) == goal("g1")

        await until(there)
