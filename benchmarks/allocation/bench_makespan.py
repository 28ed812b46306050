"""How good and how fast makespan scheduling is, by size: the pure core on random shops, public
job-shop instances, and rescheduling after a loss.

`python -m benchmarks.allocation.bench_makespan` prints the tables. Wall times are of this machine
and of whatever else it was doing. `bound` is proven, so that the ratio says how far from optimal at
most. Robots leave for a task only once all before it is done, so that with travel much of the way
is part of every schedule, and the bound, which knows little of it, is far below.
"""

from __future__ import annotations

import argparse
import time
from random import Random

from rich.console import Console
from rich.table import Table

from benchmarks.allocation.shop_files import NAMES, load
from benchmarks.allocation.shops import random_shop
from fleet.allocators.makespan.compiled import Compiled
from fleet.allocators.makespan.lists import construct
from fleet.allocators.makespan.portfolio import solve
from fleet.allocators.makespan.problem import Shop
from fleet.allocators.makespan.reschedule import reschedule, without_machines

SIZES = ((8, 3), (50, 5), (100, 10), (1000, 50), (10_000, 1000))
DEADLINES_S = {8: (1.0,), 50: (1.0, 10.0), 100: (1.0, 10.0), 1000: (1.0, 10.0), 10_000: (1.0, 10.0)}
LOSS = (1000, 50)


def main() -> None:
    """Print the tables that were asked for."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--largest", type=int, default=10_000, help="leave out more tasks")
    options.add_argument("--only", choices=("random", "public", "loss"))
    options.add_argument("--public-s", type=float, default=30.0, help="deadline of an instance")
    chosen = options.parse_args()
    console = Console(width=140)
    if chosen.only in (None, "random"):
        console.print(_random_table(chosen.largest))
    if chosen.only in (None, "public"):
        console.print(_public_table(chosen.public_s))
    if chosen.only in (None, "loss"):
        console.print(_loss_table())


def _random_table(largest: int) -> Table:
    table = Table(
        "tasks x robots", "travel", "meetings", "deadline", "list schedule / bound", "list took",
        "makespan / bound", "took", "how", title="makespan against a proven lower bound",
    )  # fmt: skip
    for tasks, robots in SIZES:
        if tasks > largest:
            continue
        for travel, meetings in ((False, 0.0), (True, 0.2)):
            shop = random_shop(tasks, robots, travel, meetings)
            began_s = time.perf_counter()
            listed = construct(Compiled(shop))
            listed_s = time.perf_counter() - began_s
            assert listed is not None
            for deadline_s in DEADLINES_S[tasks]:
                began_s = time.perf_counter()
                found = solve(shop, deadline_s)
                took_s = time.perf_counter() - began_s
                assert found is not None and found.makespan_s <= listed.rated.makespan_s + 1e-6
                table.add_row(
                    f"{tasks} x {robots}",
                    "yes" if travel else "no",
                    f"{meetings:.0%}",
                    f"{deadline_s:g} s",
                    f"{listed.rated.makespan_s / found.lower_bound_s:.4f}",
                    f"{listed_s:.3f} s",
                    f"{found.makespan_s / found.lower_bound_s:.4f}",
                    f"{took_s:.2f} s",
                    ", ".join(found.notes),
                )
    return table


def _public_table(deadline_s: float) -> Table:
    table = Table(
        "instance", "optimum", "makespan", "bound", "took", "how",
        title=f"public instances, {deadline_s:g} s each",
    )  # fmt: skip
    for name in NAMES:
        instance = load(name)
        began_s = time.perf_counter()
        found = solve(instance.shop, deadline_s)
        took_s = time.perf_counter() - began_s
        assert found is not None
        table.add_row(
            name,
            f"{instance.optimum_s:g}",
            f"{found.makespan_s:g}",
            f"{found.lower_bound_s:g}",
            f"{took_s:.1f} s",
            ", ".join(found.notes),
        )
    return table


def _loss_table() -> Table:
    tasks, robots = LOSS
    table = Table(
        "travel", "before", "orphans", "after", "best found", "moved", "from scratch", "moves",
        "took", title=f"one of {robots} robots lost before {tasks} tasks",
    )  # fmt: skip
    for travel in (False, True):
        shop = random_shop(tasks, robots, travel, 0.2 if travel else 0.0)
        planned = solve(shop, 2.0, exact=False)
        assert planned is not None
        lost = 2
        left = without_machines(shop, frozenset({lost}))
        frozen = under_way(shop, planned.machine_of, planned.order, lost)
        began_s = time.perf_counter()
        found = reschedule(left, planned.machine_of, planned.order, frozen)
        took_s = time.perf_counter() - began_s
        scratch = construct(Compiled(left))
        assert found is not None and scratch is not None
        afresh = sum(a != b for a, b in zip(scratch.machine_of, planned.machine_of, strict=True))
        table.add_row(
            "yes" if travel else "no",
            f"{planned.makespan_s:.0f} s",
            str(planned.machine_of.count(lost)),
            f"{found.timed.makespan_s:.0f} s",
            f"{found.best_makespan_s:.0f} s",
            str(len(found.moved)),
            f"{scratch.rated.makespan_s:.0f} s",
            str(afresh),
            f"{took_s:.2f} s",
        )
    return table


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


if __name__ == "__main__":
    main()
