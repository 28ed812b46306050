"""Idle time of strategies and allocators on households, as in the table of the RobotFleet paper.

`python -m benchmarks.allocation.bench_household` prints it. Schedules are those that the allocators
predict; every one of them has passed the checker. `--llm-config FILE` adds the language model.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean, stdev

from rich.console import Console
from rich.progress import track
from rich.table import Table

from benchmarks.allocation.household import (
    CLOCKS,
    REAL,
    STRATEGIES,
    UNIT,
    WAYS,
    household,
    plan_of,
    scenarios,
    world_of,
)
from fleet.allocators.base import Allocated, Allocator
from fleet.allocators.cost_based import CostBasedAllocator
from fleet.allocators.llm import LlmAllocator
from fleet.allocators.makespan import DEADLINE_S, MakespanAllocator
from fleet.allocators.min_max_load import MinMaxLoadAllocator, TieBreak
from fleet.allocators.round_robin import RoundRobinAllocator
from fleet.core.checker.plan_checker import CheckedPlan, check_plan
from fleet.llm import LanguageModel, load_llm_config
from fleet.scheduling.idle_time import predicted_unit, union_s

PAPER = {"3 robots, 5 goals": 0.350, "5 robots, 10 goals": 0.429}
"""Least idle time that the paper reports for any planner and allocator (reference's definition)."""
SEEDS, SEEDS_WITH_WAYS = 30, 10


@dataclass(frozen=True)
class Run:
    """One allocation. Shares are 0 to 1; `bound_s` is the best proven for the same task graph."""

    scenario: str
    seed: int
    strategy: str
    clock: str
    allocator: str
    makespan_s: float
    bound_s: float
    unit_idle: float
    fleet_idle: float
    least_idle: float
    """Of the fleet, if the same work were done in `bound_s`."""


def allocators(limit_s: float = DEADLINE_S, llm_file: Path | None = None) -> tuple[Allocator, ...]:
    """Those that are compared; the language model only where one is configured."""
    own: tuple[Allocator, ...] = (
        MakespanAllocator(limit_s),
        MinMaxLoadAllocator(TieBreak.NEXT_LOADS),
        MinMaxLoadAllocator(TieBreak.TRAVEL),
        CostBasedAllocator(),
        RoundRobinAllocator(),
    )
    if llm_file is None:
        return own
    return (
        *own,
        LlmAllocator(
            LanguageModel(load_llm_config(llm_file)), MinMaxLoadAllocator(TieBreak.NEXT_LOADS)
        ),
    )


def runs(seeds: int, compared: Sequence[Allocator], console: Console) -> list[Run]:
    """Every household, strategy, clock and allocator."""
    jobs = [
        (scenario, seed, strategy, clock)
        for scenario in scenarios()
        for clock in CLOCKS
        for seed in range(min(seeds, SEEDS_WITH_WAYS) if clock == WAYS else seeds)
        for strategy in STRATEGIES
    ]
    found: list[Run] = []
    for job in track(jobs, "households", console=console, transient=True):
        found += compare(*job, compared)
    return found


def compare(
    scenario: str, seed: int, strategy: str, clock: str, compared: Sequence[Allocator]
) -> list[Run]:
    """All allocators on one task graph."""
    home = household(scenario, seed)
    checked = check_plan(plan_of(home, strategy), world_of(home, clock))
    assert isinstance(checked, CheckedPlan), checked
    answers: dict[str, Allocated] = {}
    for allocator in compared:
        answer = allocator.allocate(checked)
        assert isinstance(answer, Allocated), (allocator.name, answer)
        answers[allocator.name] = answer
    bound_s = max(answer.lower_bound_s or 0.0 for answer in answers.values())
    return [
        Run(
            scenario,
            seed,
            strategy,
            clock,
            name,
            answer.schedule.makespan_s,
            bound_s,
            predicted_unit(checked.plan, answer.allocation).mean,
            1 - _work_s(answer) / (len(home.robots) * answer.schedule.makespan_s),
            max(0.0, 1 - _work_s(answer) / (len(home.robots) * bound_s)),
        )
        for name, answer in answers.items()
    ]


def _work_s(answer: Allocated) -> float:
    """How long robots are busy, all together, s; nobody here is in two tasks at once."""
    schedule = answer.schedule
    return sum(union_s([(schedule.start_s[task], end)]) for task, end in schedule.end_s.items())


HEAD = (
    "strategy", "allocator", "reference's, unit", "fleet, unit", "fleet, real", "least there",
    "makespan ÷ bound", "fleet, with ways", "makespan ÷ bound, with ways",
)  # fmt: skip


def rows(found: Sequence[Run], scenario: str) -> list[tuple[str, ...]]:
    """The table of a scenario: mean ± standard deviation over households."""
    made: list[tuple[str, ...]] = []
    mine = [run for run in found if run.scenario == scenario]
    for strategy in STRATEGIES:
        for name in dict.fromkeys(run.allocator for run in mine):
            some = [run for run in mine if (run.strategy, run.allocator) == (strategy, name)]
            unit, real, ways = (
                [run for run in some if run.clock == clock] for clock in (UNIT, REAL, WAYS)
            )
            made.append(
                (
                    strategy,
                    name,
                    _share([run.unit_idle for run in unit]),
                    _share([run.fleet_idle for run in unit]),
                    _share([run.fleet_idle for run in real]),
                    _share([run.least_idle for run in real]),
                    _ratio(real),
                    _share([run.fleet_idle for run in ways]),
                    _ratio(ways),
                )
            )
    return made


def _share(shares: Sequence[float]) -> str:
    spread = stdev(shares) if len(shares) > 1 else 0.0
    return f"{100 * mean(shares):.1f} ± {100 * spread:.1f} %"


def _ratio(some: Sequence[Run]) -> str:
    ratios = [run.makespan_s / run.bound_s for run in some]
    return f"{mean(ratios):.3f} (worst {max(ratios):.3f})"


def main() -> None:
    """Print the tables."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--seeds", type=int, default=SEEDS)
    options.add_argument("--limit-s", type=float, default=DEADLINE_S, help="for `makespan`")
    options.add_argument("--llm-config", type=Path, help="add the allocator llm with this model")
    given = options.parse_args()
    console = Console(width=180)
    found = runs(given.seeds, allocators(given.limit_s, given.llm_config), console)
    for scenario in scenarios():
        table = Table(*HEAD, title=f"{scenario}; the paper's best: {100 * PAPER[scenario]:.1f} %")
        for row in rows(found, scenario):
            table.add_row(*row)
        console.print(table)


if __name__ == "__main__":
    main()
