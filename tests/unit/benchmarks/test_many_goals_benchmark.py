"""The benchmark of many goals, at a size that is none."""

from __future__ import annotations

from benchmarks.planning.goals_in_jobs import jobs
from benchmarks.planning.many_goals import LIMITS_S, STRATEGIES, Size, fleet_of, measured
from fleet.service.composition import compose


def test_every_strategy_is_measured_with_and_without_limits() -> None:
    size = Size(4, 2, 1, 5.0)
    rows = list(measured([size], compose()))
    assert [(row.strategy, row.limit_s) for row in rows] == [
        (strategy, limit_s) for strategy in STRATEGIES for limit_s in (None, *LIMITS_S)
    ]
    assert {row.goals for row in rows} == {4}
    assert all((row.makespan_s is None) == (row.limit_s is not None) for row in rows)


def test_planning_jobs_are_done_until_all_goals_are_planned() -> None:
    world, goals = fleet_of(Size(4, 2, 1, 5.0))
    found = jobs(world, goals, STRATEGIES[0], LIMITS_S[0], compose())
    assert found.goals == (4,)
    assert len(found.took_s) == 1
    assert found.makespan_s > 0.0
