"""Budgets of searches, by a clock that is given."""

from __future__ import annotations

from fleet.jobshop.time_budget import StepClock, TimeBudget


class Clock:
    """Stands still until it is set."""

    now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def test_a_budget_begins_when_it_is_made_and_its_first_share_with_it() -> None:
    clock = Clock()
    budget = TimeBudget(16.0, clock)
    first = budget.until(0.5)
    clock.now_s += 4.0
    assert (budget.spent, budget.left_s, first.left_s) == (0.25, 12.0, 4.0)
    clock.now_s += 4.0
    assert first.over and not budget.over
    clock.now_s += 100.0
    assert budget.over and budget.left_s == 0.0


def test_a_part_is_of_what_is_left_and_never_more() -> None:
    clock = Clock()
    budget = TimeBudget(16.0, clock)
    clock.now_s += 8.0
    assert budget.part(0.25).left_s == 2.0
    assert budget.part(0.25, least_s=3.0).left_s == 3.0
    assert budget.part(0.25, least_s=30.0).left_s == 8.0
    assert TimeBudget(0.0, clock).over


def test_a_clock_of_steps_goes_on_when_it_is_read() -> None:
    def reads(budget: TimeBudget) -> int:
        count = 0
        while not budget.over:
            count += 1
        return count

    clock = StepClock(0.25)
    assert [reads(TimeBudget(5.0, clock)) for _ in range(3)] == [19] * 3
