"""What the planner publishes: the newest of each key, some at a time, however many there are."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from fleet.core.effects import Publish
from fleet.service import outbox as outbox_module
from fleet.service.outbox import IN_FLIGHT, Outbox
from fleet.service.put_back import PutBack
from keyexpr_schema.errors import WriteRefused
from keyexpr_schema.keyspace import GOAL_SPEC
from keyexpr_schema.payloads.goals import GoalAddress
from tests.support.polling import until
from tests.support.session_values import goal

MANY = 1000


class Store:
    """Stands for a session; what is written is confirmed once that is allowed."""

    def __init__(self) -> None:
        self.written: list[tuple[str, str]] = []
        self.most = self._at_once = 0
        self.allowed = asyncio.Event()
        self.faults: dict[str, Exception] = {}

    async def confirm(
        self, key: Any, address: GoalAddress, payload: Any, timeout_s: float, *, age_s: float
    ) -> None:
        """As a session does."""
        self._at_once += 1
        self.most = max(self.most, self._at_once)
        await self.allowed.wait()
        self._at_once -= 1
        if (fault := self.faults.get(address.goal)) is not None:
            raise fault
        self.written.append((address.goal, payload.text))


def publish(number: int, text: str = "") -> Publish:
    name = f"g{number}"
    return Publish(GOAL_SPEC, GoalAddress(name), goal(name, text or name))


async def test_thousands_of_keys_wait_without_a_task_each_and_the_newest_is_written() -> None:
    store = Store()
    async with Outbox(store).running() as outbox:  # type: ignore[arg-type]
        before = len(asyncio.all_tasks())
        outbox.send(publish(number) for number in range(MANY))
        assert len(asyncio.all_tasks()) - before == IN_FLIGHT
        await until(lambda: store.most == IN_FLIGHT)
        outbox.send([publish(0, "newer"), publish(MANY - 1, "newer")])
        assert len(list(outbox.unconfirmed)) == MANY + 1
        store.allowed.set()
        await outbox.written(GOAL_SPEC.build(GoalAddress(f"g{n}")) for n in range(MANY))
        assert not list(outbox.unconfirmed)
        assert store.most == IN_FLIGHT
        texts = dict(store.written)
        assert len(texts) == MANY
        assert {texts["g0"], texts[f"g{MANY - 1}"]} == {"newer"}
        assert len(store.written) == MANY + 1  # of a key that waits only the newest


async def test_what_comes_as_the_last_writers_end_is_written() -> None:
    store = Store()
    store.allowed.set()
    async with Outbox(store).running() as outbox:  # type: ignore[arg-type]
        numbers = iter(range(MANY))
        for _ in range(10):
            some = [next(numbers) for _ in range(IN_FLIGHT)]
            outbox.send(map(publish, some))
            await outbox.written(GOAL_SPEC.build(GoalAddress(f"g{number}")) for number in some)
        assert len(store.written) == 10 * IN_FLIGHT


async def test_who_is_cancelled_takes_nothing_from_others_who_wait() -> None:
    store = Store()
    async with Outbox(store).running() as outbox:  # type: ignore[arg-type]
        outbox.send([publish(1)])
        keyexpr = GOAL_SPEC.build(GoalAddress("g1"))
        one, other = (asyncio.create_task(outbox.written([keyexpr])) for _ in range(2))
        await until(lambda: store.most)
        one.cancel()
        with pytest.raises(asyncio.CancelledError):
            await one
        store.allowed.set()
        await other
        assert store.written == [("g1", "g1")]


@pytest.mark.parametrize("fault", [WriteRefused("too many", False), RuntimeError("a fault")])
async def test_what_is_refused_holds_nothing_else_up_and_is_written_once_it_can_be(
    monkeypatch, fault
) -> None:
    store = Store()
    store.allowed.set()
    refused = [f"g{number}" for number in range(3 * IN_FLIGHT)]
    store.faults = dict.fromkeys(refused, fault)
    async with Outbox(store).running() as outbox:  # type: ignore[arg-type]
        outbox.send(publish(number) for number in range(MANY))
        await until(lambda: len(store.written) == MANY - len(refused))
        assert len(list(outbox.unconfirmed)) == len(refused)
    # Once there is room it is not long until all are written.
    monkeypatch.setattr(outbox_module, "REFUSED_AGAIN_S", 0.05)
    async with Outbox(store).running() as outbox:  # type: ignore[arg-type]
        outbox.send(publish(number) for number in range(len(refused)))
        await until(lambda: len(list(outbox.unconfirmed)) == len(refused))
        store.faults.clear()
        await outbox.written(GOAL_SPEC.build(GoalAddress(name)) for name in refused)
        assert not list(outbox.unconfirmed)


async def test_what_a_store_has_lost_is_put_back_before_what_else_waits() -> None:
    """However slow its disk is: for so long only it is known what that was."""
    store = Store()
    async with Outbox(store).running() as outbox:  # type: ignore[arg-type]
        outbox.send(publish(number) for number in range(MANY))
        await until(lambda: store.most == IN_FLIGHT)
        lost = [f"lost{number}" for number in range(2 * IN_FLIGHT)]
        outbox.send(
            PutBack(GOAL_SPEC, GoalAddress(name), goal(name), known_since_s=0.0) for name in lost
        )
        store.allowed.set()
        await outbox.written(GOAL_SPEC.build(GoalAddress(f"g{n}")) for n in range(MANY))
        under_way = {f"g{number}" for number in range(IN_FLIGHT)}
        names = [name for name, _ in store.written if name not in under_way]
        assert names[: len(lost)] == lost
