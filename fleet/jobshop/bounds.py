"""Lower bounds on the makespan that hold for every schedule.

- Critical path: the longest chain of operations, each at its shortest.
- Load: a set of machines does at least the work that no other machine can do; before it every such
  block has a head, after it a tail (Carlier 1982; for several machines Carlier 1987).
- Pigeonhole: of the m + 1 longest blocks for m machines two share one.
- Weighted load for machines of different speed: for prices `y` with `sum(y) = 1`, no machine ends
  before `sum over blocks of min over machines (y * duration)` (the dual of the fractional
  assignment, Lenstra, Shmoys, Tardos 1990). Any prices are a proof; ours come from a few
  subgradient steps.
- Travel: each block comes after another one, or after a machine's start, each of those once; the
  cheapest assignment is what machines travel at least (the assignment relaxation of routing).

`portfolio.solve` takes the largest of these and of what branch and bound or CP-SAT prove by search.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from math import inf
from typing import NamedTuple

from fleet.jobshop.assignment import cheapest_assignment
from fleet.jobshop.preprocessing import Instance
from fleet.jobshop.problem import Position

STEPS = 300
"""Subgradient steps for the prices, fewer where there is much to add up."""
ADDED_UP = 300_000
"""Options looked at in all those steps together."""
CUTS = 24
"""Heads, and tails, that are tried as thresholds."""
MAX_ASSIGNED = 100
"""Blocks up to which the assignment of travel is solved; less than 0.1 s there."""
MAX_SETS = 200
"""Sets of machines that are looked at; those with the most blocks come first."""


def lower_bound(instance: Instance) -> float:
    """Seconds that no schedule is shorter than: all but the assignment of travel, which is dear."""
    if not instance.predecessors:
        return 0.0
    least = _least(instance)
    heads = _heads(instance, least)
    best = max(
        head + length + tail
        for head, length, tail in zip(heads, least, instance.tails_s, strict=True)
    )
    rows = _rows(instance, least, heads)
    within = _within(rows)
    best = max(best, *(_load(instance, machines, mine) for machines, mine in within.items()))
    return max(best, *(_priced(instance, mine) for mine in within.values()))


def bound_with_travel(instance: Instance) -> float:
    """The load together with the least total travel, s."""
    least = _least(instance)
    within = _within(_rows(instance, least, _heads(instance, least)))
    return max(
        _with_travel(instance, machines, mine) if len(mine) <= MAX_ASSIGNED else 0.0
        for machines, mine in within.items()
    )


def _within(rows: Sequence[_Work]) -> dict[tuple[int, ...], list[_Work]]:
    """For sets of machines: the blocks that only they can do."""
    sets: dict[tuple[int, ...], int] = defaultdict(int)
    for machines, *_ in rows:
        sets[machines] += 1
    chosen = sorted(sets, key=lambda machines: -sets[machines])[:MAX_SETS]
    found: dict[tuple[int, ...], list[_Work]] = {}
    for machines in dict.fromkeys([*chosen, tuple(sorted(set().union(*chosen)))]):
        inside = set(machines)
        inner = {other for other in sets if inside.issuperset(other)}
        found[machines] = [row for row in rows if row.machines in inner]
    return found


class _Work(NamedTuple):
    """A block: what it takes at least on one of its machines, after its head, before its tail."""

    machines: tuple[int, ...]
    least_s: float
    head_s: float
    tail_s: float
    block: int


def _least(instance: Instance) -> list[float]:
    """Seconds that no machine does an operation faster than, its travel included."""
    return [a + b for a, b in zip(instance.least_s, instance.least_travel_s(), strict=True)]


def _heads(instance: Instance, least: Sequence[float]) -> list[float]:
    """Seconds before which no operation can start."""
    heads = [0.0] * len(instance.predecessors)
    first = {operations[0]: block for block, operations in enumerate(instance.operations_of)}
    machines = instance.shop.machines
    for op in instance.order:
        head = max((heads[b] + least[b] for b in instance.predecessors[op]), default=0.0)
        if op in first:
            block = instance.shop.blocks[first[op]]
            head = max(head, min(machines[m].ready_s for m in block.machines))
        heads[op] = head
    return heads


def _rows(instance: Instance, least: Sequence[float], heads: Sequence[float]) -> list[_Work]:
    rows: list[_Work] = []
    for block, operations in enumerate(instance.operations_of):
        inside = sum(least[op] for op in operations)
        machines = tuple(sorted(instance.shop.blocks[block].machines))
        rows.append(
            _Work(machines, inside, heads[operations[0]], instance.tails_s[operations[-1]], block)
        )
    return rows


def _load(instance: Instance, machines: Sequence[int], rows: Sequence[_Work]) -> float:
    count = len(machines)
    ready = sorted(instance.shop.machines[m].ready_s for m in machines)
    best = _filled(sum(row.least_s for row in rows), ready) + min(row.tail_s for row in rows)
    longest = sorted((row.least_s for row in rows), reverse=True)
    if len(longest) > count:
        best = max(best, longest[count - 1] + longest[count] + ready[0])
    cuts = min(CUTS, 4 + ADDED_UP // (len(rows) * CUTS))
    heads = _cuts((row.head_s for row in rows), cuts)
    tails = _cuts((row.tail_s for row in rows), cuts)
    for tail in tails:
        late = [row for row in rows if row.tail_s >= tail]
        for head in heads:
            total = sum(row.least_s for row in late if row.head_s >= head)
            if total > 0:
                best = max(best, head + total / count + tail)
    return best


def _with_travel(instance: Instance, machines: Sequence[int], rows: Sequence[_Work]) -> float:
    """The load with the least total travel instead of each block's own least one."""
    inside = set(machines)
    blocks = instance.shop.blocks
    near = [b for b, block in enumerate(blocks) if not inside.isdisjoint(block.machines)]
    if any(instance.exit_of[b] < 0 for b in near):
        return 0.0  # a block that leaves its machine where it was hands on the one before it
    entering = [row.block for row in rows if instance.entry[row.block] >= 0]
    if not entering:
        return 0.0
    kinds = sorted({instance.kinds[m] for m in machines})
    ahead = [b for b in near if instance.positions[b] != Position.LAST]
    sites = [instance.exit_of[b] for b in ahead] + [
        instance.shop.machines[m].site for m in machines
    ]
    least = {
        (origin, target): min(instance.shop.travel_s[kind][origin][target] for kind in kinds)
        for origin in set(sites)
        for target in {instance.entry[b] for b in entering}
    }
    costs = [[least[site, instance.entry[b]] for site in sites] for b in entering]
    column = {b: j for j, b in enumerate(ahead)}
    never = 1.0 + sum(max(row) for row in costs)
    for row, b in zip(costs, entering, strict=True):
        if b in column:
            row[column[b]] = never
    total = sum(row[j] for row, j in zip(costs, cheapest_assignment(costs), strict=True))
    travel_s = instance.least_travel_s()
    first = [
        next(
            op
            for op in instance.operations_of[b]
            if instance.block_of[op] == b and instance.targets[op] >= 0
        )
        for b in entering
    ]
    work = sum(row.least_s for row in rows) - sum(travel_s[op] for op in first)
    ready = sorted(instance.shop.machines[m].ready_s for m in machines)
    return _filled(work + min(total, never), ready) + min(row.tail_s for row in rows)


def _filled(work_s: float, ready_s: Sequence[float]) -> float:
    """When so much work can be done at the earliest on machines that are free from `ready_s`
    (ascending): a machine that is free too late does nothing."""
    best, begun_s = inf, 0.0
    for count, ready in enumerate(ready_s, start=1):
        begun_s += ready
        best = min(best, (work_s + begun_s) / count)
    return best


def _cuts(values: Iterable[float], cuts: int) -> list[float]:
    distinct = sorted(set(values))
    if len(distinct) <= cuts:
        return distinct
    return [distinct[i * (len(distinct) - 1) // (cuts - 1)] for i in range(cuts)]


def _priced(instance: Instance, rows: Sequence[_Work]) -> float:
    """The weighted load over kinds of machines that are alike in these blocks' eyes, after the
    least head and before the least tail."""
    alike: dict[tuple[int, int], int] = {}
    masks: dict[int, int] = defaultdict(int)
    sets = {machines: i for i, machines in enumerate(dict.fromkeys(row.machines for row in rows))}
    if len(sets) > MAX_SETS:
        return 0.0
    for machines, bit in sets.items():
        for machine in machines:
            masks[machine] |= 1 << bit
    group_of: dict[int, int] = {}
    sizes: list[int] = []
    for machine, mask in masks.items():
        key = (instance.kinds[machine], mask)
        if key not in alike:
            alike[key] = len(alike)
            sizes.append(0)
        group_of[machine] = alike[key]
        sizes[alike[key]] += 1
    kind_of = [kind for kind, _ in alike]
    work: dict[tuple[tuple[int, float], ...], int] = defaultdict(int)
    for machines, _, _, _, block in rows:
        own = instance.own_s[block]
        groups = sorted({group_of[m] for m in machines})
        work[tuple((g, own[kind_of[g]] if own else 0.0) for g in groups)] += 1
    if len(sizes) < 2 or len(work) > 2000:
        return 0.0
    around = min(row.head_s for row in rows) + min(row.tail_s for row in rows)
    return around + _subgradient(list(work.items()), sizes)


def _subgradient(
    work: Sequence[tuple[tuple[tuple[int, float], ...], int]], sizes: Sequence[int]
) -> float:
    count = len(sizes)
    prices = [1.0 / sum(sizes)] * count
    best = 0.0
    options_count = sum(len(options) for options, _ in work)
    for step in range(min(STEPS, 10 + ADDED_UP // options_count)):
        total = 0.0
        load = [0.0] * count
        for options, times in work:
            group, seconds = min(options, key=lambda o: prices[o[0]] * o[1])
            total += times * prices[group] * seconds
            load[group] += times * seconds
        best = max(best, total)
        top = max((load[g] / sizes[g] for g in range(count)), default=0.0)
        if top <= total * (1 + 1e-9):
            break
        # Groups that are asked for too much become dearer, multiplicatively (Plotkin et al. 1995).
        rate = 0.5 / (1 + step * 0.1)
        prices = [
            max(price * (1 + rate * (load[g] / sizes[g] - total) / top), 1e-12)
            for g, price in enumerate(prices)
        ]
        whole = sum(price * size for price, size in zip(prices, sizes, strict=True))
        prices = [price / whole for price in prices]
    return best
