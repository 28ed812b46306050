"""How good and how fast makespan scheduling is, by size, beside plain alternatives; on public
instances; and when a robot is lost or late.

`python -m benchmarks.allocation.bench_makespan` prints the tables. Wall times are of this machine
and of whatever else it was doing. `bound` is proven, so that the ratio says how far from optimal at
most. Robots leave for a task only once all before it is done, so that with travel much of the way
is part of every schedule, and the bound, which knows little of it, is far below.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from random import Random

from rich.console import Console
from rich.table import Table

from benchmarks.allocation.baselines import big_m, in_turn, makespan_s, nearest, papers_milp
from benchmarks.allocation.shop_files import NAMES, load
from benchmarks.allocation.shops import random_shop, with_under_way, without_machines
from fleet.jobshop.portfolio import solve
from fleet.jobshop.preprocessing import Instance
from fleet.jobshop.problem import Machine, Shop
from fleet.jobshop.rescheduling import reschedule
from fleet.jobshop.search.list_scheduling import list_schedule
from fleet.jobshop.time_budget import TimeBudget

SIZES = ((8, 3), (10, 3), (20, 4), (50, 5), (100, 10), (1000, 50), (10_000, 1000))
LIMITS_S = (1.0, 10.0)
MEETINGS = 0.2
"""Share of goals that are hand-overs, which need two robots at once, where there is travel."""
COALITIONS = 0.5
"""The same at 8 x 3."""
LOST, LATE_S = 2, 300.0
"""The robot that is lost, or late by so much [s]."""
LOSS = (1000, 50)
PUBLIC_S = 30.0
RESCHEDULING_S = 0.7


@dataclass(frozen=True)
class Size:
    """One random shop: makespans [s] and how long each took [s], by who made them."""

    tasks: int
    robots: int
    travel: bool
    bound_s: float
    makespan_s: dict[str, float]
    took_s: dict[str, float]
    proven: bool
    how: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Public:
    """One public instance; `found_s` is None where the optimum was not met."""

    name: str
    optimum: float
    makespan: float
    bound: float
    took_s: float
    how: str


@dataclass(frozen=True)
class Rescheduling:
    """One robot lost or late in a plan of 1,000 tasks for 50 robots; times in s."""

    what: str
    travel: bool
    before_s: float
    had: int
    """Blocks of that robot."""
    under_way: int
    stayed: int
    after_s: float
    best_s: float
    moved: int
    scratch_s: float
    scratch_moved: int
    took_s: float


def sizes(largest: int, limits_s: Sequence[float], announce: Callable[[str], None]) -> list[Size]:
    """Every size with and without travel."""
    found = []
    for tasks, robots in SIZES:
        for travel in (False, True):
            if tasks <= largest:
                announce(f"{tasks} x {robots}{', travel' if travel else ''}")
                found.append(size(tasks, robots, travel, limits_s))
    return found


def size(tasks: int, robots: int, travel: bool, limits_s: Sequence[float], seed: int = 0) -> Size:
    """One shop by all of them; none of ours may be worse than the list schedule."""
    meetings = (COALITIONS if tasks == 8 else MEETINGS) if travel else 0.0
    shop = random_shop(tasks, robots, travel, meetings, seed)
    ready = Instance(shop)
    made: dict[str, float] = {}
    took: dict[str, float] = {}
    how: dict[str, str] = {}

    def measure(name: str, run: Callable[[], float | None]) -> None:
        began_s = time.perf_counter()
        found_s = run()
        if found_s is not None:
            made[name], took[name] = found_s, time.perf_counter() - began_s

    def by_hand(choose: Callable[[Instance], list[int] | None]) -> float | None:
        machine_of = choose(ready)
        return None if machine_of is None else makespan_s(shop, machine_of)

    def listed() -> float | None:
        found = list_schedule(Instance(shop))
        return None if found is None else found.makespan_s

    measure("greedy nearest", lambda: by_hand(nearest))
    measure("round-robin", lambda: by_hand(in_turn))
    measure("paper's MILP", lambda: by_hand(papers_milp))
    measure("big-M MILP", lambda: big_m(ready))
    measure("list schedule", listed)
    bound_s, proven = 0.0, False
    for limit_s in limits_s:
        name = f"makespan, {limit_s:g} s"
        began_s = time.perf_counter()
        found = solve(shop, TimeBudget(limit_s))
        took[name] = time.perf_counter() - began_s
        assert found is not None
        made[name], how[name] = found.makespan_s, ", ".join(found.notes)
        bound_s = max(bound_s, found.lower_bound_s)
        proven = proven or found.gap < 1e-4
        assert found.makespan_s <= made["list schedule"] + 1e-6, "worse than the list schedule"
    return Size(tasks, robots, travel, bound_s, made, took, proven, how)


def coalitions(limit_s: float = 10.0, seeds: int = 10) -> list[tuple[float, float]]:
    """8 tasks, half of the goals hand-overs, 3 robots: gap, and how long it took [s]."""
    found = []
    for seed in range(seeds):
        shop = random_shop(8, 3, True, COALITIONS, seed)
        began_s = time.perf_counter()
        made = solve(shop, TimeBudget(limit_s))
        assert made is not None
        found.append((made.gap, time.perf_counter() - began_s))
    return found


def public(limit_s: float, announce: Callable[[str], None]) -> list[Public]:
    """The public instances; how long until the proof, or the limit."""
    found = []
    for name in NAMES:
        announce(name)
        instance = load(name)
        began_s = time.perf_counter()
        made = solve(instance.shop, TimeBudget(limit_s))
        took_s = time.perf_counter() - began_s
        assert made is not None and instance.optimum_s is not None
        how = ", ".join(made.notes)
        found.append(
            Public(name, instance.optimum_s, made.makespan_s, made.lower_bound_s, took_s, how)
        )
    return found


def rescheduling() -> list[Rescheduling]:
    """A robot lost, and one late, before 1,000 tasks, without and with travel."""
    found = []
    for travel in (False, True):
        shop = random_shop(*LOSS, travel, MEETINGS if travel else 0.0)
        planned = solve(shop, TimeBudget(2.0), exact=False)
        assert planned is not None
        for what in ("lost", "late"):
            left = without_machines(shop, frozenset({LOST})) if what == "lost" else _late(shop)
            begun = under_way(shop, planned.machine_of, planned.order, LOST)
            left = with_under_way(left, planned.machine_of, begun)
            began_s = time.perf_counter()
            made = reschedule(left, planned.machine_of, planned.order, TimeBudget(RESCHEDULING_S))
            took_s = time.perf_counter() - began_s
            scratch = list_schedule(Instance(left))
            assert made is not None and scratch is not None
            pairs = zip(scratch.machine_of, planned.machine_of, strict=True)
            found.append(
                Rescheduling(
                    what,
                    travel,
                    planned.makespan_s,
                    planned.machine_of.count(LOST),
                    len(begun),
                    sum(made.schedule.machine_of[b] == planned.machine_of[b] for b in begun),
                    made.schedule.makespan_s,
                    made.best_makespan_s,
                    len(made.moved),
                    scratch.makespan_s,
                    sum(a != b for a, b in pairs),
                    took_s,
                )
            )
    return found


def _late(shop: Shop) -> Shop:
    machines = list(shop.machines)
    one = machines[LOST]
    machines[LOST] = Machine(one.kind, one.site, one.ready_s + LATE_S)
    return Shop(shop.operations, shop.blocks, tuple(machines), shop.travel_s)


def under_way(
    shop: Shop, machine_of: tuple[int, ...], order: tuple[int, ...], lost: int
) -> frozenset[int]:
    """The first block of every machine but the lost one, where it waits for nothing."""
    first: dict[int, int] = {}
    for block in order:
        first.setdefault(machine_of[block], block)
    chosen = [
        block
        for machine, block in first.items()
        if machine != lost
        and all(not shop.operations[op].after for op in shop.blocks[block].operations[:1])
        and all(len(shop.operations[op].blocks) == 1 for op in shop.blocks[block].operations)
    ]
    Random(0).shuffle(chosen)
    return frozenset(chosen)


Rows = tuple[tuple[str, ...], list[tuple[str, ...]]]
"""Headings, and rows."""


def size_rows(found: Sequence[Size]) -> Rows:
    """Makespan by the best bound, and how long it took."""
    names = tuple(dict.fromkeys(name for one in found for name in one.makespan_s))
    rows = []
    for one in found:
        cells = [
            f"{one.makespan_s[name] / one.bound_s:.3f} ({one.took_s[name]:.2f} s)"
            if name in one.makespan_s
            else "-"
            for name in names
        ]
        travel = "yes" if one.travel else "no"
        proven = "yes" if one.proven else "no"
        rows.append((f"{one.tasks} x {one.robots}", travel, *cells, proven))
    return ("tasks x robots", "travel", *names, "proven optimal"), rows


def public_rows(found: Sequence[Public]) -> Rows:
    """Optimum, what was found and proven, and when."""
    return ("instance", "optimum", "makespan", "bound", "ended after", "how"), [
        (
            one.name,
            f"{one.optimum:g}",
            f"{one.makespan:g}",
            f"{one.bound:g}",
            f"{one.took_s:.1f} s",
            one.how,
        )
        for one in found
    ]


def rescheduling_rows(found: Sequence[Rescheduling]) -> Rows:
    """What was before, what is now, what a new plan would have been."""
    head = (
        "robot", "travel", "before", "its blocks", "under way, stayed", "after", "best found",
        "moved", "from scratch", "moved by that", "took",
    )  # fmt: skip
    return head, [
        (
            one.what,
            "yes" if one.travel else "no",
            f"{one.before_s:.0f} s",
            str(one.had),
            f"{one.under_way}, {one.stayed}",
            f"{one.after_s:.0f} s",
            f"{one.best_s:.0f} s",
            str(one.moved),
            f"{one.scratch_s:.0f} s",
            str(one.scratch_moved),
            f"{one.took_s:.2f} s",
        )
        for one in found
    ]


def as_table(title: str, rows: Rows) -> Table:
    """For a terminal."""
    table = Table(*rows[0], title=title)
    for row in rows[1]:
        table.add_row(*row)
    return table


def main() -> None:
    """Print the tables that were asked for."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--largest", type=int, default=10_000, help="leave out more tasks")
    options.add_argument("--only", choices=("random", "public", "loss"))
    options.add_argument("--public-s", type=float, default=PUBLIC_S, help="limit of an instance")
    chosen = options.parse_args()
    console = Console(width=180)
    if chosen.only in (None, "random"):
        rows = size_rows(sizes(chosen.largest, LIMITS_S, console.print))
        console.print(as_table("makespan ÷ proven lower bound (time)", rows))
    if chosen.only in (None, "public"):
        console.print(
            as_table("public instances", public_rows(public(chosen.public_s, console.print)))
        )
    if chosen.only in (None, "loss"):
        console.print(as_table("one of 50 robots, 1,000 tasks", rescheduling_rows(rescheduling())))


if __name__ == "__main__":
    main()
