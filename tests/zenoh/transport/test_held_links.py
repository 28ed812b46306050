"""Who floods a store is slowed down at his link, and nobody else is."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Iterator
from dataclasses import replace

import pytest
from msgspec import structs

from fleet.service.router_process import with_port
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.facts import Value
from keyexpr_schema.keyspace import FACT
from keyexpr_schema.limits import Limits, in_force, put_in_force
from keyexpr_schema.payloads.world import FactAddress
from keyexpr_schema.transport.router import run_router
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from keyexpr_schema.transport.store.held_links import HeldLinks
from keyexpr_schema.transport.store.pacing import OWN_AT_ONCE
from tests.support.polling import DEADLINE_S, until
from tests.support.session_values import fact

COMMON = 10
MANY = OWN_AT_ONCE + COMMON + 50
OTHERS = 2 * OWN_AT_ONCE


@pytest.fixture
def made(monkeypatch) -> Iterator[list[HeldLinks]]:
    """What holds links, of each store; who is held is so until that is closed."""
    made: list[HeldLinks] = []

    def make(session):
        made.append(HeldLinks(session))
        return made[-1]

    monkeypatch.setattr("keyexpr_schema.transport.store.server.HeldLinks", make)
    monkeypatch.setattr("keyexpr_schema.transport.store.pacing.MOST_S", 10 * DEADLINE_S)
    # Who is held leaves room to hold one more, who should not be.
    monkeypatch.setattr("keyexpr_schema.transport.store.held_links.most_held", lambda: 2)
    put_in_force(Limits(unconfirmed=COMMON, unconfirmed_per_s=1 / DEADLINE_S))
    yield made
    put_in_force(Limits())


async def test_who_floods_is_held_and_who_writes_beside_him_is_not(tmp_path, made):
    endpoint = with_port("tcp/127.0.0.1:0")
    config = SessionConfig((endpoint,))
    with SqliteStore(tmp_path) as store:
        async with (
            run_router((endpoint,), store=store),
            open_session(config) as flooding,
            open_session(config) as other,
        ):
            put = itertools.count()

            def flood(values: int) -> None:
                for number in itertools.islice(put, values):
                    flooding.put(FACT, FactAddress(f"much{number}", "at"), fact(number))

            def held() -> str | None:
                flood(50)
                return made[0].slowing

            slowed = await until(held, "a link that is held")
            before = next(put)
            flooding.put(FACT, FactAddress(f"much{before}", "at"), fact(before))
            flood(50)
            assert "slowed down one writer" in slowed
            await _confirm(other, OTHERS, at_once=100)
            assert (await other.store_troubles(DEADLINE_S)).slowing == slowed

            def came() -> list[int]:
                found = store.select("robotfleet/world/facts/*/at")
                much = sorted((w.stamp, w.keyexpr) for w in found if "much" in w.keyexpr)
                return [int(keyexpr.split("/")[-2].removeprefix("much")) for _, keyexpr in much]

            assert OWN_AT_ONCE + COMMON <= len(came()) <= before
            assert len(store.select("robotfleet/world/facts/*/at")) == OTHERS + len(came())
            made[0].close()
            await flooding.confirm(FACT, FactAddress("last", "at"), fact(1), DEADLINE_S)
            assert came() == list(range(before + 51))


async def test_who_floods_with_what_is_not_taken_in_is_held_as_well(tmp_path, made):
    """Others hear it."""
    endpoint = with_port("tcp/127.0.0.1:0")
    put_in_force(replace(in_force(), value_kb=1))
    large = structs.replace(fact(0), value="x" * 2000)
    with SqliteStore(tmp_path) as store:
        async with (
            run_router((endpoint,), store=store),
            open_session(SessionConfig((endpoint,))) as flooding,
        ):

            def held() -> str | None:
                for number in range(50):
                    flooding.put(FACT, FactAddress(f"much{number}", "at"), large)
                return made[0].slowing

            assert "slowed down one writer" in await until(held, "a link that is held")
            assert not store.select("robotfleet/**")
            made[0].close()


async def test_who_waits_for_confirmations_is_not_held_when_his_clock_was_set_back(tmp_path, made):
    """His stamps are nobody's then whom the router knows."""
    endpoint = with_port("tcp/127.0.0.1:0")
    with SqliteStore(tmp_path) as store:
        async with (
            run_router((endpoint,), store=store),
            open_session(SessionConfig((endpoint,))) as session,
        ):
            session.link.stamps.begin_anew(session.link.stamps.now_s())
            await _confirm(session, OTHERS, at_once=100)
            assert len(store.select("robotfleet/world/facts/*/at")) == OTHERS
            assert made[0].slowing is None


async def test_who_waits_for_the_confirmation_of_much_that_is_large_is_not_held(tmp_path, made):
    endpoint = with_port("tcp/127.0.0.1:0")
    config = SessionConfig((endpoint,))
    with SqliteStore(tmp_path) as store:
        async with (
            run_router((endpoint,), store=store),
            open_session(config) as flooding,
            open_session(config) as session,
        ):

            def held() -> str | None:
                for number in range(50):
                    flooding.put(FACT, FactAddress(f"much{number}", "at"), fact(number))
                return made[0].slowing

            slowed = await until(held, "a link that is held")
            await _confirm(session, MANY, at_once=MANY, value="x" * 20_000)
            assert made[0].slowing == slowed
            made[0].close()


async def _confirm(session: Session, many: int, at_once: int, value: Value = 1) -> None:
    for begin in range(0, many, at_once):
        await asyncio.gather(
            *(
                session.confirm(
                    FACT,
                    FactAddress(f"a{number}", "at"),
                    structs.replace(fact(0), subject=f"a{number}", value=value),
                    DEADLINE_S,
                )
                for number in range(begin, min(many, begin + at_once))
            )
        )


async def test_a_link_that_is_not_his_alone_is_not_held(tmp_path, made):
    """What comes from behind another router comes with what others have written there."""
    endpoint, further = (with_port("tcp/127.0.0.1:0") for _ in range(2))
    with SqliteStore(tmp_path) as store:
        async with (
            run_router((endpoint,), store=store),
            run_router((further,), (endpoint,)),
            open_session(SessionConfig((further,))) as flooding,
        ):
            for number in range(MANY):
                flooding.put(FACT, FactAddress(f"much{number}", "at"), fact(number))
            await flooding.confirm(FACT, FactAddress("last", "at"), fact(1), DEADLINE_S)
            assert made[0].slowing is None
            assert len(store.select("robotfleet/world/facts/*/at")) == MANY + 1
