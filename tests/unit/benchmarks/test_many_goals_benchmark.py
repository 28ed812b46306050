"""The benchmark of many goals, at a size that is none."""

from __future__ import annotations

from benchmarks.planning.many_goals import LIMITS_S, STRATEGIES, Size, measured
from fleet.service.composition import compose


def test_every_strategy_is_measured_with_and_without_limits() -> None:
    size = Size(4, 2, 1, 5.0)
    rows = list(measured([size], compose()))
    assert [(row.strategy, row.limit_s) for row in rows] == [
        (strategy, limit_s) for strategy in STRATEGIES for limit_s in (None, *LIMITS_S)
    ]
    assert {row.goals for row in rows} == {4}
    assert all((row.makespan_s is None) == (row.limit_s is not None) for row in rows)
