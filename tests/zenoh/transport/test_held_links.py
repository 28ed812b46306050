"""Who floods a store is slowed down at his link, and nobody else is."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass

import pytest
from msgspec import structs

from fleet.service.router_process import with_port
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.errors import Overtaken, WriteRefused
from keyexpr_schema.facts import Value
from keyexpr_schema.keyspace import FACT, STORE_STAMPS
from keyexpr_schema.limits import Limits, put_in_force
from keyexpr_schema.payloads.system import StoreAddress, StoreStampsQuery
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
def limits(request) -> dict[str, int]:
    """Limits of the store besides, if a test has some."""
    return getattr(request, "param", {})


@pytest.fixture
def made(monkeypatch, limits) -> Iterator[list[HeldLinks]]:
    """What holds links, of each store; who is held is so until that is closed."""
    made: list[HeldLinks] = []

    def make(session):
        made.append(HeldLinks(session))
        return made[-1]

    monkeypatch.setattr("keyexpr_schema.transport.store.server.HeldLinks", make)
    monkeypatch.setattr("keyexpr_schema.transport.store.pacing.MOST_S", 10 * DEADLINE_S)
    # Who is held leaves room to hold one more, who should not be.
    monkeypatch.setattr("keyexpr_schema.transport.store.held_links.most_held", lambda: 2)
    put_in_force(Limits(unconfirmed=COMMON, unconfirmed_per_s=1 / DEADLINE_S, **limits))
    yield made
    put_in_force(Limits())


@dataclass
class Fleet:
    """A store, its router's links, and two who write."""

    store: SqliteStore
    links: HeldLinks
    flooding: Session
    other: Session
    flooded: int = 0
    """How many values were put that nobody waits for."""

    def flood(self, values: int, value: Value = 1) -> list[str]:
        """Put so many more; their keys."""
        about = [f"much{number}" for number in range(self.flooded, self.flooded + values)]
        self.flooded += values
        for subject in about:
            said = structs.replace(fact(0), subject=subject, value=value)
            self.flooding.put(FACT, FactAddress(subject, "at"), said)
        return [FACT.build(FactAddress(subject, "at")) for subject in about]

    async def until_held(self, value: Value = 1) -> str:
        """Flood until somebody is held; what the store says of it."""

        def held() -> str | None:
            self.flood(50, value)
            return self.links.slowing

        return await until(held, "a link that is held")

    def stored(self) -> list[str]:
        """What is there, in the order of the stamps."""
        found = self.store.select("robotfleet/world/facts/*/at")
        return [each.keyexpr.split("/")[-2] for each in sorted(found, key=lambda w: w.stamp)]


@pytest.fixture
async def fleet(tmp_path, made) -> AsyncIterator[Fleet]:
    endpoint = with_port("tcp/127.0.0.1:0")
    config = SessionConfig((endpoint,))
    with SqliteStore(tmp_path) as store:
        async with (
            run_router((endpoint,), store=store),
            open_session(config) as flooding,
            open_session(config) as other,
        ):
            yield Fleet(store, made[0], flooding, other)
            made[0].close()


async def test_who_floods_is_held_and_who_writes_beside_him_is_not(fleet):
    slowed = await fleet.until_held()
    before = fleet.flooded
    fleet.flood(50)
    assert "slowed down one writer" in slowed
    assert not await _confirm(fleet.other, OTHERS, at_once=100)
    assert (await fleet.other.store_troubles(DEADLINE_S)).slowing == slowed

    def came() -> list[int]:
        return [int(each.removeprefix("much")) for each in fleet.stored() if "much" in each]

    assert OWN_AT_ONCE + COMMON <= len(came()) <= before
    assert len(fleet.stored()) == OTHERS + len(came())
    fleet.links.close()
    await fleet.flooding.confirm(FACT, FactAddress("last", "at"), fact(1), DEADLINE_S)
    assert came() == list(range(before + 50))


@pytest.mark.parametrize("limits", [{"value_kb": 1}], indirect=True)
async def test_who_floods_with_what_is_not_taken_in_is_held_as_well(fleet):
    """Others hear it."""
    assert "slowed down one writer" in await fleet.until_held("x" * 2000)
    assert not fleet.stored()


async def test_who_floods_is_held_though_others_ask_for_what_he_writes(fleet):
    """As those do who have heard of it, and do not know whether the store has taken it in."""
    for _ in range(4 * MANY // 50):
        keys = tuple(fleet.flood(50))
        answer = await fleet.other.query(
            STORE_STAMPS, StoreAddress(), StoreStampsQuery(keys=keys), DEADLINE_S
        )
        assert len(answer.timestamps) == len(keys)
    assert "slowed down one writer" in await until(lambda: fleet.links.slowing)


async def test_who_waits_for_confirmations_is_not_held_when_his_clock_was_set_back(fleet):
    """His stamps are nobody's then whom the router knows."""
    fleet.other.link.stamps.begin_anew(fleet.other.link.stamps.now_s())
    assert not await _confirm(fleet.other, OTHERS, at_once=100)
    assert len(fleet.stored()) == OTHERS
    assert fleet.links.slowing is None


@pytest.mark.parametrize("limits", [{"facts": 100}], indirect=True)
async def test_who_waits_for_confirmations_is_not_held_where_they_are_refused(fleet):
    """He waits for the answer, whatever that is."""
    slowed = await fleet.until_held()
    half = 50  # nobody may have more of what there is room for
    assert await _confirm(fleet.other, OTHERS, at_once=100) == OTHERS - half
    assert fleet.links.slowing == slowed


async def test_who_waits_for_confirmations_is_not_held_where_somebody_has_said_it_since(fleet):
    assert not await _confirm(fleet.flooding, 100, at_once=100)
    for _ in range(OTHERS // 100):
        assert await _confirm(fleet.other, 100, at_once=100, age_s=100.0) == 100
    assert fleet.links.slowing is None


async def test_who_waits_for_the_confirmation_of_much_that_is_large_is_not_held(fleet):
    slowed = await fleet.until_held()
    assert not await _confirm(fleet.other, MANY, at_once=MANY, value="x" * 20_000)
    assert fleet.links.slowing == slowed


async def _confirm(
    session: Session, many: int, at_once: int, value: Value = 1, age_s: float = 0.0
) -> int:
    """Confirm so many; how many of them are not taken in."""
    refused = 0
    for begin in range(0, many, at_once):
        answers = await asyncio.gather(
            *(
                session.confirm(
                    FACT,
                    FactAddress(f"a{number}", "at"),
                    structs.replace(fact(0), subject=f"a{number}", value=value),
                    DEADLINE_S,
                    age_s=age_s,
                )
                for number in range(begin, min(many, begin + at_once))
            ),
            return_exceptions=True,
        )
        for answer in answers:
            assert answer is None or isinstance(answer, (WriteRefused, Overtaken)), answer
            refused += answer is not None
    return refused


async def test_a_link_that_is_not_his_alone_is_not_held(tmp_path, made):
    """What comes from behind another router comes with what others have written there."""
    endpoint, further = (with_port("tcp/127.0.0.1:0") for _ in range(2))
    with SqliteStore(tmp_path) as store:
        async with (
            run_router((endpoint,), store=store),
            run_router((further,), (endpoint,)),
            open_session(SessionConfig((further,))) as flooding,
        ):
            await until(lambda: made[0].routers == 1, "the store's router to know the other one")
            # The further router brings on what nobody waits for once it knows of the store.
            await flooding.confirm(FACT, FactAddress("first", "at"), fact(1), DEADLINE_S)
            for number in range(MANY):
                flooding.put(FACT, FactAddress(f"much{number}", "at"), fact(number))
            await flooding.confirm(FACT, FactAddress("last", "at"), fact(1), DEADLINE_S)
            assert made[0].slowing is None
            assert len(store.select("robotfleet/world/facts/*/at")) == MANY + 2
