"""Public job-shop and flexible job-shop instances through the core that schedules robots."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.allocation.shop_files import INSTANCES, BadInstance, load, read_instance
from fleet.jobshop.portfolio import solve
from fleet.jobshop.search.cpsat import installed
from fleet.jobshop.time_budget import StepClock, TimeBudget

KNOWN = {
    "ft06": 55, "la01": 666, "la02": 655, "la03": 597, "la04": 590, "la05": 593,
    "mk01": 40, "mk02": 26, "mk03": 204,
}  # fmt: skip
SIZES = {"ft06": (36, 6), "mk01": (55, 6), "mk02": (58, 6), "mk03": (150, 8)}
NEVER_S = 600.0
"""A search that has not ended by itself by then never will: it takes seconds."""
QUICK = ("la01", "la05", "mk03")
"""Solved to the bound without CP-SAT."""


@pytest.mark.parametrize("name", KNOWN)
def test_an_instance_says_its_source_and_optimum(name: str) -> None:
    instance = load(name)
    assert instance.optimum_s == KNOWN[name]
    operations, machines = SIZES.get(name, (50, 5))
    assert len(instance.shop.operations) == operations
    assert len(instance.shop.machines) == machines


@pytest.mark.timeout(2 * NEVER_S)
@pytest.mark.parametrize("name", QUICK)
def test_rules_and_annealing_reach_the_bound(name: str) -> None:
    instance = load(name)
    found = solve(instance.shop, TimeBudget(20.0, StepClock()), exact=False)
    assert found is not None
    assert found.makespan_s == found.lower_bound_s == KNOWN[name]


@pytest.mark.slow
@pytest.mark.timeout(2 * NEVER_S)
@pytest.mark.skipif(not installed(), reason="OR-Tools is an extra: cp-sat")
@pytest.mark.parametrize("name", [name for name in KNOWN if name not in QUICK])
def test_the_optimum_is_found_and_proven(name: str) -> None:
    """Of both the instance (a wrong number would have another optimum) and the scheduler.

    The search ends with the proof. How long that takes is measured in the benchmark.
    """
    found = solve(load(name).shop, TimeBudget(NEVER_S))
    assert found is not None
    assert found.makespan_s == KNOWN[name]
    assert found.lower_bound_s == KNOWN[name]


def test_instances_are_all_read() -> None:
    assert {path.stem for path in INSTANCES.iterdir()} == set(KNOWN)


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.txt", "2 1\n0 3\n", "the first line says 2 jobs, and there are 1"),
        ("b.txt", "1 2\n0 3 1\n", "pairs of machine, duration"),
        ("c.fjs", "1 2\n2 1 1 5\n", "ends too early"),
        ("d.fjs", "1 2\n1 1 1 5 9\n", "too long"),
        ("e.txt", "1 2\n0 x\n", "invalid literal"),
        ("f.txt", "", "range"),
    ],
)
def test_a_file_in_another_format_is_refused(
    tmp_path: Path, name: str, text: str, says: str
) -> None:
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(BadInstance, match=says):
        read_instance(path)
