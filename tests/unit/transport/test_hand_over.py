"""What comes in other threads is called on the loop: all of it, in order, with few wakings."""

from __future__ import annotations

import asyncio
import threading
from typing import Any

from keyexpr_schema.transport.hand_over import HandOver
from tests.support.polling import until


class Counting:
    """A loop of which the wakings are counted."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self.wakings = 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._loop, name)

    def call_soon_threadsafe(self, *args: Any) -> Any:
        self.wakings += 1
        return self._loop.call_soon_threadsafe(*args)


async def test_many_calls_wake_a_busy_loop_once() -> None:
    loop: Any = Counting(asyncio.get_running_loop())
    hand_over = HandOver(loop)
    called: list[int] = []
    thread = threading.Thread(
        target=lambda: [hand_over(called.append, number) for number in range(1000)]
    )
    thread.start()
    thread.join()  # the loop is held up meanwhile
    await until(lambda: len(called) == 1000)
    assert called == list(range(1000))
    assert loop.wakings == 1


async def test_nothing_is_lost_between_two_wakings() -> None:
    hand_over = HandOver(asyncio.get_running_loop())
    called: list[tuple[int, int]] = []

    def give(source: int) -> None:
        for number in range(5000):
            hand_over(called.append, (source, number))

    threads = [threading.Thread(target=give, args=(source,)) for source in range(3)]
    for thread in threads:
        thread.start()
    await until(lambda: len(called) == 15_000)
    for thread in threads:
        thread.join()
    for source in range(3):
        assert [number for one, number in called if one == source] == list(range(5000))


async def test_a_call_that_fails_is_told_and_holds_up_none_behind_it() -> None:
    loop = asyncio.get_running_loop()
    told: list[Any] = []
    loop.set_exception_handler(lambda _, context: told.append(context["exception"]))
    hand_over = HandOver(loop)
    called: list[int] = []
    error = ValueError("no")

    def fail() -> None:
        raise error

    hand_over(called.append, 1)
    hand_over(fail)
    hand_over(called.append, 2)
    await until(lambda: called == [1, 2])
    assert told == [error]


def test_a_loop_that_is_closed_calls_nothing() -> None:
    loop = asyncio.new_event_loop()
    hand_over = HandOver(loop)
    loop.close()
    assert not hand_over(print, "never")
