"""The page of the allocation benchmarks: made of results, whichever there are."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from benchmarks.allocation import report
from benchmarks.allocation.bench_household import Run
from benchmarks.allocation.bench_makespan import Public, Rescheduling, Size
from benchmarks.allocation.household import CLOCKS, STRATEGIES, scenarios
from benchmarks.tables import as_json

RUNS = [
    Run(scenario, seed, strategy, clock, name, 110.0, 100.0, 0.2, 0.12, 0.1)
    for scenario in scenarios()
    for seed in range(2)
    for strategy in STRATEGIES
    for clock in CLOCKS
    for name in ("makespan", "milp")
]
SIZE = Size(8, 3, True, 100.0, {"list schedule": 120.0, "makespan, 1 s": 100.0},
            {"list schedule": 0.001, "makespan, 1 s": 0.5}, True)  # fmt: skip


def about(results: object) -> dict[str, object]:
    return {
        "command": "c", "machine": "m", "load_before": 0.5, "took_s": 1.0, "results": results
    }  # fmt: skip


def test_the_page_has_a_section_for_each_part_with_its_command(tmp_path: Path) -> None:
    told = {
        "household": about([asdict(run) for run in RUNS]),
        "sizes": about([asdict(SIZE)]),
        "coalitions": about([[0.0, 0.4], [0.1, 1.2]]),
        "public": about([asdict(Public("ft06", 55, 55, 55, 0.3, "annealing"))]),
        "rescheduling": about(
            [asdict(Rescheduling("lost", False, 600, 20, 9, 9, 610, 605, 30, 604, 800, 0.7))]
        ),
        "balanced": about(
            [{"kind": "alike", "s": 0.1, "mb": 3.0, "most": 10, "least": 10, "proven": True}]
        ),
    }
    report.write(tmp_path, told)
    page = (tmp_path / "allocation.md").read_text(encoding="utf-8")
    assert page.count("`c`: 1 s on m; load average before it began: 0.5.") == len(told)
    assert "| big-dag | makespan | 20.0 ± 0.0 % | 12.0 ± 0.0 %" in page
    assert "more than at the bound: big-dag 2.0, per-goal 2.0, monolithic 2.0" in page
    assert "| 8 x 3 | yes | 1.200 (0.00 s) | 1.000 (0.50 s) | yes |" in page
    assert "| 2 | 1 | 0.80 s | 1.20 s |" in page
    assert "{" not in page
    for plot in ("idle", "sizes", "rescheduling"):
        assert f"(allocation-{plot}.png)" in page
        assert (tmp_path / f"allocation-{plot}.png").stat().st_size > 5000


def test_numbers_are_kept_to_six_digits() -> None:
    told = {"public": about([{"took_s": 1.23456789, "name": "ft06", "optimum": 55}])}
    assert '"took_s":1.23457' in as_json(told) and '"optimum":55' in as_json(told)
