"""People who choose names in the same moment: every wish lives, or its owner hears a refusal."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack
from typing import Any

import pytest

from cli.client.names import TakenMeanwhile, put_if_unchanged
from cli.client.planner_requests import planned_otherwise
from cli.client.publish import put_goal, put_statement
from cli.client.world import put_object, put_place
from cli.errors import BadArgument, Refused
from keyexpr_schema.keyspace import (
    GOAL_SPEC,
    GOAL_STATUS,
    OBJECT,
    PLACE,
    PLAN_PROPOSAL,
    STATEMENT,
)
from keyexpr_schema.payloads.goals import GoalAddress, GoalState, GoalStatus
from keyexpr_schema.payloads.plans import Plan, PlanAddress
from keyexpr_schema.payloads.waits import WaitKind, WaitReason
from keyexpr_schema.payloads.world import PlaceAddress
from keyexpr_schema.transport.session import Session, open_session

PEOPLE = 8
Act = Callable[[int, Session], Awaitable[Any]]


@pytest.fixture
async def people(session_config) -> AsyncIterator[list[Session]]:
    """Sessions of people who all do something at once."""
    async with AsyncExitStack() as stack:
        yield [
            await stack.enter_async_context(open_session(session_config())) for _ in range(PEOPLE)
        ]


async def at_once(
    people: list[Session], act: Callable[[int, Session], Awaitable[Any]]
) -> list[Any]:
    """What each got: a value, or the refusal."""
    return await asyncio.gather(
        *(act(number, session) for number, session in enumerate(people)), return_exceptions=True
    )


def wishes(outcomes: list[Any]) -> list[Any]:
    """Those who heard success; all others heard a refusal that says what to do."""
    for each in outcomes:
        assert not isinstance(each, BaseException) or isinstance(each, BadArgument), each
    return [each for each in outcomes if not isinstance(each, BaseException)]


async def test_goals_of_the_same_words_are_so_many_goals(people):
    outcomes = wishes(await at_once(people, lambda n, s: put_goal(s, "Bring the cup", None, n)))
    stored = await people[0].list(GOAL_SPEC)
    assert len(outcomes) == len(stored) == PEOPLE
    assert sorted(goal.priority for goal in stored.values()) == list(range(PEOPLE))
    assert sorted(goal.ordinal for goal in stored.values()) == list(range(1, PEOPLE + 1))


async def test_of_goals_with_the_same_id_one_is_taken_and_the_others_are_refused(people):
    outcomes = await at_once(people, lambda n, s: put_goal(s, f"Bring cup {n}", "mine"))
    (one,) = wishes(outcomes)
    assert list((await people[0].list(GOAL_SPEC)).values()) == [one]
    refused = [str(each) for each in outcomes if isinstance(each, BadArgument)]
    assert set(refused) == {f"there is a goal 'mine' already: “{one.text}”; use another --id"}


async def test_statements_whose_words_make_the_same_name_are_all_stored(people):
    outcomes = wishes(await at_once(people, lambda n, s: put_statement(s, "cup!" + "!" * n)))
    stored = await people[0].list(STATEMENT)
    assert {s.text for s in stored.values()} == {s.text for s in outcomes}
    assert len(outcomes) == len(stored) == PEOPLE


async def test_a_statement_under_an_id_replaces_what_its_speaker_knew_and_nothing_newer(
    people, monkeypatch
):
    all_know = asyncio.Barrier(PEOPLE)

    async def put_when_all_know(*arguments: Any) -> None:
        await all_know.wait()
        await put_if_unchanged(*arguments)

    with monkeypatch.context() as patched:
        patched.setattr("cli.client.publish.put_if_unchanged", put_when_all_know)
        outcomes = await at_once(people, lambda n, s: put_statement(s, f"Cup {n} is here.", "s1"))
    (one,) = wishes(outcomes)
    assert list((await people[0].list(STATEMENT)).values()) == [one]
    again = await put_statement(people[1], "The cup is there.", "s1")
    assert list((await people[0].list(STATEMENT)).values()) == [again]


async def test_objects_of_a_kind_get_different_numbers(people):
    def add(number: int, session: Session) -> Awaitable[Any]:
        return put_object(session, f"cup_{'abcdefgh'[number]}", "cup", None, (), None, None)

    assert len(wishes(await at_once(people, add))) == PEOPLE
    stored = await people[0].list(OBJECT)
    assert sorted(thing.ordinal for thing in stored.values()) == list(range(1, PEOPLE + 1))


async def test_one_name_is_not_both_a_place_and_an_object(people):
    def add(number: int, session: Session) -> Awaitable[Any]:
        if number % 2:
            return put_object(session, "depot", "box", None, (), None, None)
        return put_place(session, "depot", None, (), (), ())

    outcomes = wishes(await at_once(people, add))
    assert len({type(each) for each in outcomes}) == 1
    assert len(await people[0].list(PLACE)) + len(await people[0].list(OBJECT)) == 1


async def test_changes_of_different_fields_and_distances_are_all_kept(people):
    await put_place(people[0], "hall", None, (), (), ())

    def add(number: int, session: Session) -> Awaitable[Any]:
        return put_place(session, f"room_{number}", None, (), (), (f"hall={number + 1}",))

    assert len(wishes(await at_once(people, add))) == PEOPLE
    hall = await people[0].get(PLACE, PlaceAddress("hall"))
    assert hall is not None
    assert hall.travel_m == {f"room_{n}": float(n + 1) for n in range(PEOPLE)}


async def test_of_plans_proposed_under_one_name_one_is_stored(people):
    address = PlanAddress("mine")

    async def propose(number: int, session: Session) -> Plan | None:
        plan = Plan(plan="mine", goals=(), conditions=(), tasks=(), made_by=f"person {number}")
        try:
            await put_if_unchanged(session, PLAN_PROPOSAL, address, plan, None)
        except TakenMeanwhile:
            return None
        return plan

    outcomes = await at_once(people, propose)
    (one,) = [each for each in outcomes if each is not None]
    assert await people[0].get(PLAN_PROPOSAL, address) == one


async def test_a_plan_that_is_refused_before_its_goal_says_so_is_not_waited_for(people):
    planner, person = people[:2]

    async def say(kind: WaitKind, reason: str | None) -> None:
        waits = (WaitReason(kind=kind, plan="plan-1" if kind is WaitKind.PLAN else None),)
        status = GoalStatus(goal="g", state=GoalState.WAITING, waits_for=waits, reason=reason)
        await planner.confirm(GOAL_STATUS, GoalAddress("g"), status)

    await say(WaitKind.PLAN, None)
    asks = asyncio.create_task(planned_otherwise(person, ("g",), Refused("refused")))
    await say(WaitKind.NO_PLAN, "no robot is connected")
    with pytest.raises(Refused, match=r"no robot is connected|refused"):
        await asks
