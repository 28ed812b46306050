"""The scheduling solver on random shops: CP-SAT beside it or not, and what it refuses."""

from __future__ import annotations

import time

import pytest

from benchmarks.allocation.shops import random_shop, without_machines
from fleet.jobshop.portfolio import solve
from fleet.jobshop.preprocessing import Instance
from fleet.jobshop.problem import BadShop, Block, Machine, Operation, Shop
from fleet.jobshop.search.cpsat import CpSat, installed
from fleet.jobshop.search.list_scheduling import list_schedule
from fleet.jobshop.time_budget import TimeBudget
from tests.support.searches import NEVER_S, steps


@pytest.mark.skipif(not installed(), reason="OR-Tools is an extra: cp-sat")
@pytest.mark.parametrize("seed", range(3))
def test_eight_tasks_with_meetings_are_proven_optimal(seed: int) -> None:
    found = solve(random_shop(8, 3, travel=True, meetings=0.5, seed=seed), TimeBudget(NEVER_S))
    assert found is not None
    assert found.gap < 1e-4


def test_without_or_tools_the_rest_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fleet.jobshop.portfolio.installed", lambda: False)
    found = solve(random_shop(30, 4), steps(0.1))
    assert found is not None
    assert not any("CP-SAT" in note for note in found.notes)


@pytest.mark.skipif(not installed(), reason="OR-Tools is an extra: cp-sat")
def test_cp_sat_is_ended_in_the_middle() -> None:
    ready = Instance(random_shop(40, 4))
    hint = list_schedule(ready)
    assert hint is not None
    run = CpSat(ready, hint, 0.0, time.time() + 60.0, 0)
    assert not run.ended
    run.close()
    assert run.ended


def test_a_shop_that_contradicts_itself_is_refused() -> None:
    one = Operation((0,), (1.0,))
    with pytest.raises(BadShop, match="no machine"):
        Shop((one,), (Block((0,), ()),), (Machine(),))
    with pytest.raises(BadShop, match="does not exist"):
        Shop((one,), (Block((0,), (3,)),), (Machine(),))
    with pytest.raises(BadShop, match="circle"):
        Instance(
            Shop(
                (Operation((0,), (1.0,), after=(1,)), Operation((1,), (1.0,), after=(0,))),
                (Block((0,), (0,)), Block((1,), (0,))),
                (Machine(),),
            )
        )
    with pytest.raises(BadShop, match="no machine"):
        without_machines(Shop((one,), (Block((0,), (0,)),), (Machine(),)), frozenset({0}))
