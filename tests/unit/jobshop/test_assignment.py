"""The cheapest assignment, against that of scipy."""

from __future__ import annotations

import random

import pytest
from scipy.optimize import linear_sum_assignment

from fleet.jobshop.assignment import cheapest_assignment


@pytest.mark.parametrize("alike", [False, True])
def test_no_assignment_costs_less(alike: bool) -> None:
    chance = random.Random(7)
    for _ in range(300):
        rows = chance.randint(1, 9)
        columns = rows + chance.randint(0, 4)
        costs = [
            [float(chance.randint(0, 3)) if alike else chance.uniform(0, 9) for _ in range(columns)]
            for _ in range(rows)
        ]
        column_of = cheapest_assignment(costs)
        assert len({*column_of}) == rows and {*column_of} <= {*range(columns)}
        theirs = sum(costs[i][j] for i, j in zip(*linear_sum_assignment(costs), strict=True))
        assert sum(costs[i][j] for i, j in enumerate(column_of)) == pytest.approx(theirs)


def test_of_nothing_nothing_is_assigned() -> None:
    assert cheapest_assignment([]) == []
