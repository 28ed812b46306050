"""Keys that go by receipt: what the store received last holds, whatever clocks say."""

from __future__ import annotations

import pytest

from keyexpr_schema.errors import Overtaken
from keyexpr_schema.keyspace import FACT, GOAL_SPEC, STORE_CHANGES
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.payloads.system import StoreAddress
from keyexpr_schema.payloads.world import Fact, FactAddress
from keyexpr_schema.transport.session import open_session
from tests.support.polling import DEADLINE_S, until
from tests.support.session_values import AT, fact, goal, take, take_until_value
from tests.zenoh.transport.test_confirmed_writes import behind, counted_questions


async def test_the_last_word_holds_for_store_and_watch(router, session_config, monkeypatch):
    async with (
        open_session(session_config()) as one,
        open_session(session_config()) as other,
        one.watch(FACT, GOAL_SPEC, in_order=True) as watch,
    ):
        await watch.synced()
        await one.confirm(FACT, AT, fact(1))
        behind(other, monkeypatch, 3600)
        await other.confirm(FACT, AT, fact(2))
        # What waits for an answer does not go before what it followed, down the same link.
        await other.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"))
        said = [0]
        async for change in watch:
            if change.key is GOAL_SPEC:
                break
            assert change.received > said[-1]
            said.append(change.received)
            last = change.value
        assert last == fact(2)  # the first may have been replaced before anybody asked
        # What was seen a minute ago, and comes now, is no news.
        with pytest.raises(Overtaken, match="somebody else has said something of it since"):
            await one.confirm(FACT, AT, fact(3), age_s=60.0)
        await other.delete(FACT, AT)
        assert (await take(watch, 1))[0].value is None
        await one.confirm(FACT, AT, fact(4))
        await other.confirm(FACT, AT, fact(5))
        assert (await take_until_value(watch, 5))[-1] == 5
        router.restart()

        async def as_before() -> bool:
            return await one.get(FACT, AT) == fact(5)

        await until(as_before, "the store to be back")
        await one.confirm(FACT, AT, fact(6))
        assert (await take_until_value(watch, 6))[-1] == 6


async def test_a_watch_misses_nothing_that_a_session_has_held_back(session_config):
    """Two words of one worker: while the first was on its way, which nobody counts, it wrote down
    the second, and sent it when the first was confirmed."""
    async with (
        open_session(session_config()) as worker,
        open_session(session_config()) as planner,
        planner.watch(FACT, in_order=True) as watch,
    ):
        await watch.synced()
        await worker.confirm(FACT, AT, fact(1))
        (first,) = await take(watch, 1)
        await worker.confirm(FACT, AT, fact(2), age_s=60.0)
        (second,) = await take(watch, 1)
        assert second.value == fact(2)
        assert second.received > first.received


async def test_what_a_session_has_put_itself_costs_no_question(session_config, monkeypatch):
    """It comes with the answer to the next one, in its place."""
    for name in ("OWN_S", "RELIST_S"):
        monkeypatch.setattr(f"keyexpr_schema.transport.watch.{name}", DEADLINE_S)
    async with (
        open_session(session_config()) as planner,
        open_session(session_config()) as worker,
        planner.watch(FACT, in_order=True) as watch,
    ):
        await watch.synced()
        asked = counted_questions(monkeypatch)
        places = [FactAddress(f"box_{number}", "at") for number in range(20)]
        for each in places:
            said = Fact(subject=each.subject, relation="at", value="hall", source="planner")
            await planner.confirm(FACT, each, said)
        await worker.confirm(FACT, AT, fact(1))
        changes = await take(watch, len(places) + 1)
        assert [change.address for change in changes] == [*places, AT]
        received = [change.received for change in changes]
        assert received == sorted(received)
        assert asked.count(STORE_CHANGES.build(StoreAddress())) == 1


async def test_what_a_session_has_put_itself_comes_before_what_it_puts_then(
    session_config, monkeypatch
):
    for name in ("OWN_S", "RELIST_S"):
        monkeypatch.setattr(f"keyexpr_schema.transport.watch.{name}", DEADLINE_S)
    async with (
        open_session(session_config()) as planner,
        planner.watch(FACT, GOAL_SPEC, in_order=True) as watch,
    ):
        await watch.synced()
        await planner.confirm(FACT, AT, fact(1))
        await planner.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"))
        assert [change.key for change in await take(watch, 2)] == [FACT, GOAL_SPEC]
