"""Laws of how fast those may go on who write and wait for no confirmation."""

from __future__ import annotations

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
            wait_s = pacing.spend(str(who), 1.0, now_s)
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


@reaches("floods beside")
@given(st.integers(1, 20), st.integers(1, 60))
@settings(max_examples=60, deadline=None)
def test_who_waits_for_confirmations_is_never_slowed_down(reached, flooders, at_once):
    """However many others flood: what was confirmed he has again."""
    pacing = Pacing(AT_ONCE, PER_S)
    for flooder in range(flooders):
        while not pacing.spend(f"flooder {flooder}", 1.0, 0.0):
            pass
        reached["floods beside"] += 1
    for number in range(50):
        size = number * 1000
        for _ in range(at_once):
            assert pacing.spend("one", cost(size % 60_000), 0.0) == 0.0
        for _ in range(at_once):
            pacing.give_back("one", cost(size % 60_000))


@given(st.lists(st.integers(0, 10**9), min_size=1, max_size=20), st.booleans())
def test_what_is_larger_counts_for_more_and_what_is_given_back_is_no_more_than_there_was(
    sizes, latest
):
    costs = [cost(size, latest) for size in sorted(sizes)]
    assert costs == sorted(costs)
    assert costs[0] > 0
    pacing = Pacing(AT_ONCE, PER_S)
    pacing.spend("one", 1.0, 0.0)
    for each in costs:
        pacing.give_back("one", each)
    spent = 0
    while not pacing.spend("one", 1.0, 0.0):
        spent += 1
    assert spent <= OWN_AT_ONCE + AT_ONCE + PER_S * LEAST_S


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
                free_s[each] = now_s + pacing.spend(each, 1.0, now_s)
                written[each] += now_s >= begin_s
    took_s = end_s - begin_s
    least = OWN_SHARE * PER_S * took_s
    assert all(least * 0.9 <= each for each in written.values())
    assert sum(written.values()) <= (PER_S + 20 * OWN_SHARE * PER_S) * took_s * 1.05


def test_who_is_gone_is_forgotten():
    pacing = Pacing(AT_ONCE, PER_S)
    pacing.spend("one", 1.0, 0.0)
    assert len(pacing) == 1
    pacing.forget("one")
    pacing.give_back("one", 1.0)
    assert len(pacing) == 0
