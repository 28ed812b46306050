"""A schedule repaired after a machine is lost."""

from __future__ import annotations

from benchmarks.allocation.shops import random_shop, with_under_way, without_machines
from fleet.jobshop.portfolio import solve
from fleet.jobshop.preprocessing import Instance
from fleet.jobshop.rescheduling import WITHIN, reschedule
from fleet.jobshop.search.list_scheduling import list_schedule
from tests.support.searches import steps


def test_a_lost_machine_moves_little() -> None:
    """Its own blocks must move; a whole new schedule would move nearly all.

    That is so where a new one is not shorter by more than `WITHIN`, as in this shop.
    """
    shop = random_shop(300, 20, travel=False, meetings=0.0, seed=3)
    before = solve(shop, steps(0.3), exact=False)
    assert before is not None
    left = without_machines(shop, frozenset({2}))
    found = reschedule(left, before.machine_of, before.order, steps(1.0))
    afresh = list_schedule(Instance(left))
    assert found is not None and afresh is not None
    orphans = before.machine_of.count(2)
    moved_afresh = sum(a != b for a, b in zip(afresh.machine_of, before.machine_of, strict=True))
    assert orphans <= len(found.moved) < moved_afresh / 2
    assert found.schedule.makespan_s <= found.best_makespan_s * (1 + WITHIN) + 1e-6


def test_work_under_way_stays_and_comes_first() -> None:
    shop = random_shop(60, 6, seed=2)
    before = solve(shop, steps(0.1), exact=False)
    assert before is not None
    first = {before.machine_of[b]: b for b in reversed(before.order)}
    begun = frozenset(
        block
        for machine, block in first.items()
        if machine != 1 and len(shop.blocks[block].operations) == 1
    )
    left = with_under_way(without_machines(shop, frozenset({1})), before.machine_of, begun)
    found = reschedule(left, before.machine_of, before.order, steps(0.3))
    assert found is not None and begun
    for block in begun:
        machine = before.machine_of[block]
        assert found.schedule.machine_of[block] == machine
        mine = [b for b in found.schedule.order if found.schedule.machine_of[b] == machine]
        assert mine[0] == block
