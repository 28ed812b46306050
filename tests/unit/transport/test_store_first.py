"""What waits for what the store says first, and no longer than it may still say that."""

from __future__ import annotations

from keyexpr_schema.transport.stamps import stamp_of
from keyexpr_schema.transport.store_first import AGAIN_S, TRIES, StoreFirst


class Clock:
    def __init__(self) -> None:
        self.s = 100.0

    def __call__(self) -> float:
        return self.s


def test_what_passes_waits_for_what_passed_before_it_and_not_for_what_came_later() -> None:
    first: StoreFirst[str] = StoreFirst(Clock())
    assert not first.holds
    first.asks("fact", 1)
    first.hold("goal")
    first.asks("other", 2)
    first.hold("plan")
    assert first.answered() == []
    first.came("fact", 7)  # another word of it
    assert first.answered() == []
    first.came("fact", 1)
    assert first.answered() == ["goal"]
    assert first
    first.came("other", 2)
    assert (bool(first), first.holds) == (False, True)  # what comes now is behind the plan
    first.hold("later")
    assert first.answered() == ["plan", "later"]
    assert not first.holds


def test_who_goes_on_saying_what_the_store_does_not_take_in_holds_nothing_up() -> None:
    clock = Clock()
    first: StoreFirst[int] = StoreFirst(clock)
    free: list[int] = []
    waited = 0
    for round_ in range(100):
        first.asks("forged", 3 * round_)
        first.hold(round_)
        first.asks(f"forged {round_}", 3 * round_ + 1)
        first.asks("forged", 3 * round_ + 2)
        clock.s += AGAIN_S
        free += first.answered()
        waited = max(waited, round_ + 1 - len(free))
    assert free == list(range(len(free)))
    assert waited <= 2 * TRIES


def test_a_store_that_answers_soon_is_given_the_time_to_hear_of_it() -> None:
    clock = Clock()
    first: StoreFirst[str] = StoreFirst(clock)
    first.asks("fact", 1)
    first.hold("goal")
    assert [first.answered() for _ in range(10 * TRIES)] == [[]] * 10 * TRIES
    first.asks("fact", 2)
    first.hold("plan")
    clock.s += 2 * TRIES * AGAIN_S
    assert first.answered() == ["goal"]  # the plan is behind the second word
    assert [first.answered() for _ in range(TRIES - 1)] == [[]] * (TRIES - 2) + [["plan"]]


def test_what_there_is_time_for_is_asked_for_once_and_not_when_it_has_come() -> None:
    first: StoreFirst[str] = StoreFirst(lambda: 0.0)
    first.asks_later("own", 1)
    first.asks_later("own", 2)
    assert not first and not first.holds
    first.came("own", 1)
    assert first.asks_now() and first.holds
    first.hold("after it")
    assert not first.asks_now()
    first.came("own", 2)
    assert first.answered() == ["after it"]
    first.asks_later("own", 3)
    first.came("own", 3)
    assert not first.asks_now()


def test_of_two_who_speak_at_once_the_store_may_hear_the_second_one_first() -> None:
    """What passes behind the first one waits for it even so."""
    first: StoreFirst[str] = StoreFirst(Clock())
    one, other = stamp_of(7, 1), stamp_of(7, 2)
    first.asks("report", one)
    first.hold("goal of the first one")
    first.asks("report", other)
    first.came("report", other)
    assert first.answered() == []
    first.came("report", one)
    assert first.answered() == ["goal of the first one"]
    assert not first.holds
