"""Whoever writes much holds up himself; goals beyond the most at a time wait for others to end."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator

import pytest

from fleet.core import events
from fleet.core.events import Event
from fleet.service.inbox import Inbox
from keyexpr_schema.limits import Limits, put_in_force
from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.world import Fact


@pytest.fixture(autouse=True)
def few_goals() -> Iterator[None]:
    put_in_force(Limits(open_goals=4))
    yield
    put_in_force(Limits())


class Waiting:
    """An inbox, the goals that its planner has, and what it has told."""

    def __init__(self) -> None:
        self.goals: frozenset[str] = frozenset()
        self.told: list[str | None] = []
        self.inbox = Inbox(lambda: self.goals, self.told.append)

    def put(self, writer: str, *found: Event) -> None:
        for event in found:
            self.inbox.put_nowait(event, writer)

    def take(self) -> list[str]:
        """All that can be had, in short; goals are known from then on."""
        taken = []
        while (event := self.inbox.get_nowait()) is not None:
            taken.append(in_short(event))
            if isinstance(event, events.GoalPut):
                self.goals = self.goals | {event.goal.goal}
        return taken


def goal(name: str) -> Event:
    return events.GoalPut(goal=Goal(goal=name, text="x"), time_s=0.0, wall_time_s=0.0)


def fact(subject: str, value: int = 0) -> Event:
    said = Fact(subject=subject, relation="at", value=value, source="s")
    return events.FactPut(fact=said, time_s=0.0, wall_time_s=0.0)


def gone(subject: str) -> Event:
    return events.FactDeleted(subject=subject, relation="at", time_s=0.0, wall_time_s=0.0)


def dropped(name: str) -> Event:
    return events.GoalDeleted(goal=name, time_s=0.0, wall_time_s=0.0)


def in_short(event: Event) -> str:
    match event:
        case events.GoalPut():
            return event.goal.goal
        case events.FactPut():
            return f"{event.fact.subject}={event.fact.value}"
        case events.FactDeleted():
            return f"no {event.subject}"
        case events.GoalDeleted():
            return f"no {event.goal}"
    return type(event).__name__


def test_each_writer_comes_to_his_turn_and_stays_in_his_order() -> None:
    waiting = Waiting()
    waiting.put("flood", *(fact(f"f{number}") for number in range(50)))
    waiting.put("ana", fact("a1"), fact("a2"))
    waiting.put("bob", fact("b1"))
    timer = events.TimerFired(time_s=0.0, wall_time_s=0.0)
    waiting.inbox.put_nowait(timer)
    first = ["f0=0", "a1=0", "b1=0", "TimerFired", "f1=0", "a2=0"]
    taken = waiting.take()
    assert taken[:6] == first
    assert taken[6:] == [f"f{number}=0" for number in range(2, 50)]
    assert waiting.inbox.empty()


def test_what_is_said_of_one_key_stays_in_order_whoever_says_it() -> None:
    waiting = Waiting()
    waiting.put("flood", *(fact(f"f{number}") for number in range(5)), fact("cup", 1))
    waiting.put("ana", fact("cup", 2), gone("cup"), fact("a"))
    waiting.put("flood", fact("cup", 3))
    taken = waiting.take()
    assert [each for each in taken if "cup" in each] == ["cup=1", "cup=2", "no cup", "cup=3"]
    assert taken.index("a=0") == 1
    waiting.put("ana", fact("cup", 4))  # nothing of it waits any more
    waiting.put("flood", fact("f"))
    assert waiting.take() == ["cup=4", "f=0"]


def test_goals_beyond_the_most_wait_until_others_have_ended() -> None:
    waiting = Waiting()
    waiting.put("ana", *(goal(f"g{number}") for number in range(1, 7)), fact("cup"), goal("g1"))
    assert waiting.take() == ["g1", "g2", "cup=0", "g1"]  # one that is known may change
    assert waiting.inbox.empty()
    waiting.put("ana", goal("g4"), dropped("g3"), goal("g2"))
    assert waiting.take() == ["no g3", "g2"]
    waiting.put("bob", *(goal(f"b{number}") for number in range(1, 5)))
    assert waiting.take() == ["b1", "b2"]  # whoever has many holds nobody up
    waiting.put("eve", goal("e"))
    assert waiting.take() == []
    waiting.put("bob", dropped("b3"), dropped("b4"))
    assert waiting.take() == ["no b3", "no b4"]
    waiting.goals = frozenset()
    assert not waiting.inbox.empty()
    assert waiting.take() == ["g4", "g5", "e"]
    waiting.goals = frozenset()
    assert waiting.take() == ["g6"]
    assert waiting.told[-1] is None
    assert [each.split()[0] for each in waiting.told if each] == ["1", "2", "4"]


async def test_who_waits_gets_the_next_and_others_have_their_turn_meanwhile() -> None:
    waiting = Waiting()
    taking = asyncio.create_task(waiting.inbox.get())
    asyncio.get_running_loop().call_soon(waiting.put, "ana", fact("cup"), fact("jug"))
    assert in_short(await taking) == "cup=0"
    others = asyncio.Event()
    asyncio.get_running_loop().call_soon(others.set)
    assert in_short(await waiting.inbox.get()) == "jug=0"
    assert others.is_set()
