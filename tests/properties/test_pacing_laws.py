"""Laws of how fast those may go on who write and wait for no confirmation."""

from __future__ import annotations

import itertools

from hypothesis import given, settings
from hypothesis import strategies as st

from keyexpr_schema.transport.store.pacing import (
    LEAST_S,
    MOST_S,
    OWN_AT_ONCE,
    OWN_SHARE,
    Pacing,
    cost,
)
from tests.support.reached import reaches

AT_ONCE, PER_S = 200, 100.0
WRITES = itertools.count()
STEP = st.tuples(st.integers(0, 2), st.floats(0.0, 0.5), st.integers(1, 150))
"""Who writes, after which pause [s], how many in a row."""


@reaches("held", "all of one's own", "all of the common")
@given(st.lists(STEP, min_size=1, max_size=40))
@settings(max_examples=150, deadline=None)
def test_a_burst_goes_through_and_then_no_more_than_the_rate(reached, steps):
    """Each does wait for as long as he is told; whoever waits writes nothing meanwhile."""
    pacing = Pacing(AT_ONCE, PER_S)
    now_s = 0.0
    free_s = dict.fromkeys(range(3), 0.0)
    written = dict.fromkeys(range(3), 0)
    waits = 0
    for who, pause_s, many in steps:
        now_s += pause_s
        for _ in range(many):
            if free_s[who] > now_s:
                break
            wait_s = pacing.spend(str(who), next(WRITES), 1.0, now_s)
            written[who] += 1
            assert wait_s == 0.0 or LEAST_S <= wait_s <= MOST_S
            free_s[who] = now_s + wait_s
            if wait_s:
                waits += 1
                reached["held"] += 1
                reached["all of the common"] += 1
            reached["all of one's own"] += written[who] == OWN_AT_ONCE
        slack = PER_S * LEAST_S + 3
        own = OWN_AT_ONCE + OWN_SHARE * PER_S * now_s + slack
        assert sum(max(0.0, each - own) for each in written.values()) <= (
            AT_ONCE + PER_S * now_s + slack
        )
    if all(each <= OWN_AT_ONCE for each in written.values()):
        assert not waits, "nobody waits who has not used up his own"


@reaches("floods beside", "is put again", "writes besides")
@given(st.integers(1, 20), st.integers(1, 25), st.booleans(), st.integers(0, 1))
@settings(max_examples=60, deadline=None)
def test_who_waits_for_answers_is_never_slowed_down(reached, flooders, at_once, again, besides):
    """However many others flood, and whatever the answers are: what he has waited for he has again,
    as often as it was put."""
    pacing = Pacing(AT_ONCE, PER_S)
    for flooder in range(flooders):
        while not pacing.spend(f"flooder {flooder}", next(WRITES), 1.0, 0.0):
            pass
        reached["floods beside"] += 1
    for number in range(50):
        spent = cost(number * 1000 % 60_000)
        writes = list(itertools.islice(WRITES, at_once))
        for write in (*writes, *writes[: at_once * again]):
            assert pacing.spend("one", write, spent, 0.0) == 0.0
        for _ in range(besides):
            assert pacing.spend("one", next(WRITES), 1.0, 0.0) == 0.0
        pacing.answered("one", writes)
        reached["is put again"] += again
        reached["writes besides"] += besides


@reaches("asks of another's", "asks twice", "asks of what was not put")
@given(st.lists(st.sampled_from(("another's", "twice", "what was not put")), max_size=40))
@settings(deadline=None)
def test_who_waits_for_nothing_has_nothing_again(reached, asked):
    """Nobody has more again than what he has put and was not answered yet."""
    pacing = Pacing(AT_ONCE, PER_S)
    writes = list(itertools.islice(WRITES, 10))
    for write in writes:
        pacing.spend("one", write, 1.0, 0.0)
    pacing.answered("one", writes)
    flooded = list(itertools.islice(WRITES, OWN_AT_ONCE))
    for write in flooded:
        assert pacing.spend("one", write, 1.0, 0.0) == 0.0
    pacing.spend("other", next(WRITES), 1.0, 0.0)
    for what in asked:
        if what == "another's":
            pacing.answered("other", flooded)
        else:
            pacing.answered("one", writes if what == "twice" else [next(WRITES)])
        reached[f"asks of {what}" if what != "twice" else "asks twice"] += 1
    more = 0
    while not pacing.spend("one", next(WRITES), 1.0, 0.0):
        more += 1
    assert more <= AT_ONCE + PER_S * LEAST_S


@given(st.lists(st.integers(0, 10**9), min_size=1, max_size=20), st.booleans())
def test_what_is_larger_counts_for_more(sizes, latest):
    costs = [cost(size, latest) for size in sorted(sizes)]
    assert costs == sorted(costs)
    assert costs[0] > 0


def test_those_who_flood_share_the_rate_and_each_has_a_tenth():
    pacing = Pacing(AT_ONCE, PER_S)
    flooders = [f"flooder {number}" for number in range(20)]
    free_s = dict.fromkeys(flooders, 0.0)
    written = dict.fromkeys(flooders, 0)
    begin_s, end_s = 60.0, 120.0
    for step in range(round(end_s * 100)):
        now_s = step / 100
        for each in flooders:
            while free_s[each] <= now_s:
                free_s[each] = now_s + pacing.spend(each, next(WRITES), 1.0, now_s)
                written[each] += now_s >= begin_s
    took_s = end_s - begin_s
    least = OWN_SHARE * PER_S * took_s
    assert all(least * 0.9 <= each for each in written.values())
    assert sum(written.values()) <= (PER_S + 20 * OWN_SHARE * PER_S) * took_s * 1.05


def test_who_is_gone_is_forgotten():
    pacing = Pacing(AT_ONCE, PER_S)
    pacing.spend("one", 1, 1.0, 0.0)
    assert len(pacing) == 1
    pacing.forget("one")
    pacing.answered("one", [1])
    assert len(pacing) == 0


def test_of_who_is_never_near_his_limit_nothing_piles_up():
    """A thousand robots that say every second where they are."""
    pacing = Pacing(1_000, 500.0)
    for second in range(30):
        for robot in range(1_000):
            assert pacing.spend(str(robot), next(WRITES), cost(200, latest=True), second) == 0.0
    assert pacing.unanswered <= 2 * len(pacing) == 2_000
