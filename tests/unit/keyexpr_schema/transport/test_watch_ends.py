"""What a watch ends with, in the cases that `tests/properties/test_watch_laws.py` has found."""

from __future__ import annotations

import tempfile
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path

import pytest

from keyexpr_schema.keyspace import FACT, STOP
from keyexpr_schema.limits import Limits
from keyexpr_schema.payloads.stops import StopAddress
from keyexpr_schema.payloads.world import Fact, FactAddress
from keyexpr_schema.transport.samples import Sample, encoding_of
from keyexpr_schema.transport.selection import Selection
from keyexpr_schema.transport.stamps import stamp_of, ticks_of_time
from keyexpr_schema.transport.watch import RELIST_S
from tests.support.virtual_time import EPOCH_S, lived, passing
from tests.support.watched_life import Life

REPORT_1, GOAL_1, GOAL_2, STOP_1 = 2, 4, 5, 7
ONE, TWO, THREE = 0, 1, 2
SAID_S = RELIST_S + 1.0
"""After so long the store has said to all what it has."""
RIGHT_CLOCKS = (0.0,) * 11
NARROWED = ["in order, narrowed"]
"""The watch that is not about everything."""
LIMITS = Limits(value_kb=1)
AT = FactAddress("cup_1", "at")


def ends_well(
    script: Callable[[Life], Awaitable[None]],
    ahead_s: Sequence[float] = RIGHT_CLOCKS,
    limits: Limits = LIMITS,
    *,
    puts_back: bool = True,
) -> None:
    """In the end every watch has shown what the store has."""

    async def life() -> None:
        with tempfile.TemporaryDirectory() as folder:
            began = Life(Path(folder), 0, limits, puts_back=puts_back)
            async with began.begun(ahead_s) as life:
                life.router.slowest_s = 0.001
                await passing(1.0)
                await script(life)
                await life.come_to_rest()
                stored = life.stored()
                assert [found for each in life.watchers if (found := each.differs(stored))] == []

    lived(life)


def test_a_deletion_that_never_left_is_taken_back_however_long_no_router_was_there():
    """Its writer hears it himself, and nobody else does."""

    async def script(life: Life) -> None:
        life.confirm(ONE, GOAL_1)
        await passing(SAID_S)
        life.router.stop()
        life.put(ONE, GOAL_1, deleted=True)
        await passing(200.0)

    ends_well(script)


def test_what_is_put_back_and_refused_is_not_believed_for_ever():
    """It passed, the store did not take it, and was set back before anybody asked: so it seems to
    be lost. Who puts it back has a clock behind that of its writer."""

    async def script(life: Life) -> None:
        life.router.copy()
        life.confirm(TWO, STOP_1, size=1000)
        await passing(0.05)
        life.router.go_back()
        await passing(1.0)

    ends_well(script, (0.0, 3.0, *RIGHT_CLOCKS[2:]))


def test_what_cannot_be_put_back_is_not_believed_for_ever():
    """Another has taken the room in the store meanwhile. By the clock of who puts it back it is
    older than what was lost."""

    async def script(life: Life) -> None:
        life.confirm(ONE, GOAL_1)
        await passing(SAID_S)
        life.router.stop()
        for each in life.watchers:
            each.session.link.cut = True
        life.router.go_back(to_nothing=True)
        life.confirm(TWO, GOAL_2)
        await passing(1.0)

    ends_well(script, (4.5, *RIGHT_CLOCKS[3:], -4.5, -4.5), Limits(goals=1))


def test_who_contradict_each_other_again_and_again_cost_no_question_each():
    """Of each watch, that is, and there may be a thousand."""

    async def script(life: Life) -> None:
        plain = life.watchers[0]
        assert plain.watch is not None
        life.confirm(ONE, REPORT_1)
        await passing(SAID_S)
        asked, shown = plain.watch.updates, len(plain.all_shown)
        for number in range(100):
            life.confirm(TWO if number % 2 else ONE, REPORT_1)
            await passing(0.02)
        assert len(plain.all_shown) - shown > 50
        assert plain.watch.updates - asked <= 3

    ends_well(script)


def test_while_a_store_can_write_nothing_nothing_is_taken_back():
    async def script(life: Life) -> None:
        life.router.fill(True)
        life.put(ONE, STOP_1)
        await passing(60.0)
        keyexpr = STOP.build(StopAddress("s1"))
        assert [each.name for each in life.watchers if keyexpr not in each.shown] == NARROWED
        assert not [each for each in life.watchers if len(each.said.get(keyexpr, ())) > 2]

    ends_well(script)


@pytest.mark.parametrize("deleted", [True, False])
def test_what_comes_late_to_a_store_that_was_emptied_counts(deleted):
    """Though it counts as received before what the store has forgotten."""

    async def script(life: Life) -> None:
        life.confirm(ONE, REPORT_1)
        await passing(1.0)
        if deleted:
            life.delete(THREE, REPORT_1)
        await passing(1.0)
        life.router.go_back(to_nothing=True)
        await passing(2.0)
        life.put(TWO, REPORT_1, age_s=10.0)

    ends_well(script, puts_back=False)


def test_what_has_an_earlier_stamp_counts_in_a_store_that_was_emptied():
    """Than a deletion that the store has forgotten."""

    async def script(life: Life) -> None:
        life.confirm(ONE, GOAL_1)
        await passing(SAID_S)
        life.delete(ONE, GOAL_1)
        await passing(SAID_S)
        life.router.go_back(to_nothing=True)
        await passing(SAID_S)
        life.put(TWO, GOAL_1)

    ends_well(script, (0.0, -40.0, *RIGHT_CLOCKS[2:]))


class Undecodable:
    """Nothing is."""

    def report(self, keyexpr: str, data: bytes, reason: str, *, decodes: bool = False) -> None:
        raise AssertionError(reason)


def relist(after_s: float = 0.0) -> None:
    """Nobody asks here."""


def selection(shown: list[object]) -> Selection:
    def deliver(_: str, change: object) -> None:
        shown.append(change.value and change.value.value)  # type: ignore[attr-defined]

    return Selection(FACT, FACT.pattern(), None, Undecodable(), deliver, relist)  # type: ignore[arg-type]


def said(value: int, by: int, received: int = 0) -> Sample:
    fact = Fact(subject="cup_1", relation="at", value=value, source="test")
    stamp = stamp_of(ticks_of_time(EPOCH_S + value), by)
    return Sample(FACT.build(AT), FACT.encode(fact), encoding_of(FACT), stamp, False, received)


def test_who_contradicts_somebody_and_goes_on_still_contradicts_him():
    """The store is asked soon which of them holds, not when it is asked for everything."""

    async def life() -> None:
        shown: list[object] = []
        of_facts = selection(shown)
        of_facts.heard(said(1, by=7))
        assert not of_facts.contested
        of_facts.heard(said(2, by=8))
        assert of_facts.contested
        of_facts.heard(said(3, by=8))
        assert of_facts.contested
        of_facts.changed(said(3, by=8, received=10))
        assert not of_facts.contested
        assert shown == [1, 2, 3]

    lived(life)


def test_what_takes_the_place_of_something_that_is_on_its_way_to_the_store_is_asked_for():
    """The store said it before it heard of the other."""

    async def life() -> None:
        shown: list[object] = []
        of_facts = selection(shown)
        of_facts.heard(said(2, by=8))
        of_facts.changed(said(1, by=7, received=10))
        assert of_facts.contested
        known = of_facts.doubtful(float("inf"))
        of_facts.believe(known, {FACT.build(AT): said(2, by=8, received=20)})
        assert not of_facts.contested
        of_facts.changed(said(3, by=7, received=15))
        assert shown == [2, 1, 2]

    lived(life)


def test_what_the_store_has_is_asked_for_once():
    async def life() -> None:
        shown: list[object] = []
        of_facts = selection(shown)
        of_facts.heard(said(1, by=7))
        known = of_facts.doubtful(float("inf"))
        assert list(known) == [FACT.build(AT)]
        of_facts.believe(known, {})
        assert of_facts.doubtful(float("inf")) == {}
        assert shown == [1]

    lived(life)
