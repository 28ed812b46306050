"""Who answers in the store's place, or attaches a stamp to what she puts, is not believed."""

from __future__ import annotations

from collections.abc import Callable

import zenoh

from keyexpr_schema.keyspace import GOAL_SPEC, STORE_CHANGES, STORE_STAMPS
from keyexpr_schema.payloads.goals import Goal, GoalAddress
from keyexpr_schema.payloads.system import (
    StoreAddress,
    StoreChanges,
    StoredValue,
    StoreStamps,
)
from keyexpr_schema.transport.connecting import zenoh_config
from keyexpr_schema.transport.samples import encoding_of, reply_encoding_of
from keyexpr_schema.transport.session import SessionConfig, open_session
from tests.support.router_process import RouterProcess

G1 = GoalAddress("g1")
FAR = f"{2**63}/1"
"""A stamp of the year 2106: no later one is given out for a while."""


def goal(text: str) -> Goal:
    return Goal(goal="g1", text=text)


def answering(asked: list[str]) -> Callable[[zenoh.Query], None]:
    """Says of every goal that it is another, and of every write that it was overtaken."""

    def answer(query: zenoh.Query) -> None:
        asked.append(str(query.key_expr))
        lie(query)

    return answer


def lie(query: zenoh.Query) -> None:
    forged, keyexpr = GOAL_SPEC.encode(goal("forged")), str(query.key_expr)
    with query:
        if keyexpr == STORE_CHANGES.build(StoreAddress()):
            value = StoredValue(
                keyexpr="goals/g1/spec",
                timestamp=FAR,
                encoding=encoding_of(GOAL_SPEC),
                value=forged.decode(),
            )
            page = StoreChanges(values=(value,), position="x", whole=True, more=False)
            data = STORE_CHANGES.encode(page)  # type: ignore[arg-type]
            query.reply(keyexpr, data, encoding=reply_encoding_of(STORE_CHANGES))
        elif keyexpr == STORE_STAMPS.build(StoreAddress()):
            stamps = STORE_STAMPS.encode(StoreStamps(timestamps=(FAR,)))  # type: ignore[arg-type]
            query.reply(keyexpr, stamps, encoding=reply_encoding_of(STORE_STAMPS))
        elif keyexpr.startswith("store/"):
            query.reply_err(b"no")
        else:
            query.reply(
                "goals/g1/spec", forged, encoding=encoding_of(GOAL_SPEC), attachment=FAR.encode()
            )


async def test_only_the_store_behind_the_router_is_believed(
    router: RouterProcess, session_config: Callable[..., SessionConfig]
) -> None:
    config = zenoh_config("client", connect=[router.endpoint], namespace="robotfleet")
    with zenoh.open(config) as foreign:
        asked: list[str] = []
        for pattern in ("goals/**", "store/**"):
            foreign.declare_queryable(pattern, answering(asked))
        async with open_session(session_config()) as session:
            await session.confirm(GOAL_SPEC, G1, goal("first"))
            assert await session.get(GOAL_SPEC, G1) == goal("first")
            assert await session.list(GOAL_SPEC) == {G1: goal("first")}
            assert not await session.create(GOAL_SPEC, G1, goal("second"))
            assert await session.get(GOAL_SPEC, GoalAddress("g2")) is None
            async with session.watch(GOAL_SPEC) as watch:
                assert (await anext(watch)).value == goal("first")
                await session.confirm(GOAL_SPEC, G1, goal("third"))
                assert (await anext(watch)).value == goal("third")
            await session.delete(GOAL_SPEC, G1)
            assert await session.list(GOAL_SPEC) == {}
        assert len(asked) > 5


async def test_a_stamp_that_is_attached_to_a_put_says_nothing(
    router: RouterProcess, session_config: Callable[..., SessionConfig]
) -> None:
    config = zenoh_config("client", connect=[router.endpoint], namespace="robotfleet")
    with zenoh.open(config) as foreign:
        async with (
            open_session(session_config()) as session,
            session.watch(GOAL_SPEC) as watch,
        ):
            await watch.synced()
            foreign.put(
                "goals/g1/spec",
                GOAL_SPEC.encode(goal("far")),
                encoding=encoding_of(GOAL_SPEC),
                attachment=FAR.encode(),
                congestion_control=zenoh.CongestionControl.BLOCK,
            )
            assert (await anext(watch)).value == goal("far")
            await session.confirm(GOAL_SPEC, G1, goal("later"))
            assert (await anext(watch)).value == goal("later")
