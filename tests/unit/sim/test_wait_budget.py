"""Two robots wait for each other; many do not stand still for one."""

from __future__ import annotations

from sim.server.wait_budget import RESERVE_S, SHARE, WaitBudget

WAIT_S = 0.02


def waits(held_up: int, thinking: int) -> int:
    """How often a world waits before it cannot afford it any more."""
    budget, number = WaitBudget(), 0
    while budget.left_s > 0.0:
        budget.spend(WAIT_S, held_up, thinking)
        number += 1
    return number


def test_the_more_robots_are_held_up_the_shorter_the_world_waits() -> None:
    assert abs(waits(1, 1) - RESERVE_S / WAIT_S) <= 1
    assert abs(waits(25, 25) - waits(1, 1)) <= 1
    assert abs(49 * waits(49, 1) - waits(1, 1)) < 49


def test_what_is_used_up_comes_back_as_the_world_goes_on_but_no_more_than_that() -> None:
    budget = WaitBudget()
    budget.spend(RESERVE_S, 1, 1)
    assert budget.left_s == 0.0
    budget.earn(1.0)
    assert budget.left_s == SHARE
    budget.earn(1e6)
    assert budget.left_s == RESERVE_S
