"""Plain ways to share work out, to compare with: each gives every block a machine.

The order of each machine's blocks is then that of list scheduling, which is kinder than taking them
as they come.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fleet.allocators.min_max_load_milp import MinMaxLoadProgram, solve
from fleet.jobshop.preprocessing import Instance
from fleet.jobshop.problem import Shop
from fleet.jobshop.search.list_scheduling import list_schedule

MILP_S = 10.0
"""Wall time of a solver, s."""
MOST_CHOICES = 30_000
"""Pairs of block and machine up to which the paper's MILP is asked."""
MOST_PAIRS = 400
"""Pairs of blocks that may share a machine up to which the big-M MILP is asked."""


def makespan_s(shop: Shop, machine_of: Sequence[int]) -> float | None:
    """What these machines lead to; `None` if list scheduling runs into a dead end with them."""
    blocks = tuple(
        replace(block, machines=(machine,))
        for block, machine in zip(shop.blocks, machine_of, strict=True)
    )
    found = list_schedule(Instance(replace(shop, blocks=blocks)))
    return None if found is None else found.makespan_s


def nearest(instance: Instance) -> list[int]:
    """In topological order, each block to the able machine that is nearest by then; among equally
    near ones to the one with the fewest."""
    shop = instance.shop
    site = [machine.site for machine in shop.machines]
    count = [0] * len(site)
    chosen = [-1] * len(shop.blocks)
    for block in _in_order(instance):
        target = instance.entry[block]

        def far(machine: int, to: int = target) -> tuple[float, int]:
            way = shop.travel_s[instance.kinds[machine]][site[machine]][to] if to >= 0 else 0.0
            return way, count[machine]

        chosen[block] = machine = min(shop.blocks[block].machines, key=far)
        count[machine] += 1
        site[machine] = instance.exit_of[block] if instance.exit_of[block] >= 0 else site[machine]
    return chosen


def in_turn(instance: Instance) -> list[int]:
    """Round-robin over the machines, those that cannot do a block passed over."""
    machines = len(instance.shop.machines)
    chosen = [-1] * len(instance.shop.blocks)
    turn = 0
    for block in _in_order(instance):
        able = instance.shop.blocks[block].machines
        chosen[block] = min(able, key=lambda m: (m - turn) % machines)
        turn = chosen[block] + 1
    return chosen


def papers_milp(instance: Instance) -> list[int] | None:
    """The least number of operations on the busiest machine, by the mixed-integer program."""
    blocks = instance.shop.blocks
    if sum(len(block.machines) for block in blocks) > MOST_CHOICES:
        return None
    able = {str(b): tuple(map(str, block.machines)) for b, block in enumerate(blocks)}
    load = {str(b): len(block.operations) for b, block in enumerate(blocks)}
    program = MinMaxLoadProgram(able, load)
    program.minimise_max_load()
    values = solve(program.model, MILP_S).values
    robots = program.robots(values) if values else None
    return None if robots is None else [int(robots[str(b)]) for b in range(len(blocks))]


def big_m(instance: Instance) -> float | None:
    """The makespan [s] that a disjunctive program with big M finds in its time (Manne 1960); `None`
    if it finds nothing, with ways, or beyond `MOST_PAIRS`."""
    import pulp

    blocks = instance.shop.blocks
    if instance.travels or len(blocks) > MOST_PAIRS:
        return None
    pairs = [
        (a, b)
        for b in range(len(blocks))
        for a in range(b)
        if not set(blocks[a].machines).isdisjoint(blocks[b].machines)
    ]
    if len(pairs) > MOST_PAIRS:
        return None
    big = sum(max(duration) for duration in instance.durations_s)
    model = pulp.LpProblem("big_m", pulp.LpMinimize)
    top = model.add_variable("top", lowBound=0.0)
    model += top
    start = [model.add_variable(f"s{i}", lowBound=0.0) for i in range(len(instance.predecessors))]
    on = {
        (b, m): model.add_variable(f"x{b}_{m}", cat="Binary")
        for b, block in enumerate(blocks)
        for m in block.machines
    }
    for b, block in enumerate(blocks):
        model += pulp.lpSum(on[b, m] for m in block.machines) == 1
    lasts = []
    for step in range(len(instance.predecessors)):
        own = instance.block_of[step]
        lasts.append(
            start[step]
            + pulp.lpSum(
                instance.durations_s[step][instance.kinds[m]] * on[own, m]
                for m in blocks[own].machines
            )
        )
        model += lasts[step] <= top
    for step, befores in enumerate(instance.predecessors):
        for before in befores:
            model += start[step] >= lasts[before]
    for a, b in pairs:
        first = model.add_variable(f"y{a}_{b}", cat="Binary")
        begin_a, begin_b = (start[instance.operations_of[x][0]] for x in (a, b))
        end_a, end_b = (lasts[instance.operations_of[x][-1]] for x in (a, b))
        for m in set(blocks[a].machines) & set(blocks[b].machines):
            apart = big * (2 - on[a, m] - on[b, m])
            model += begin_b >= end_a - big * (1 - first) - apart
            model += begin_a >= end_b - big * first - apart
    values = solve(model, MILP_S).values
    return values["top"] if values else None


def _in_order(instance: Instance) -> list[int]:
    place = {step: i for i, step in enumerate(instance.order)}
    return sorted(
        range(len(instance.shop.blocks)), key=lambda b: place[instance.operations_of[b][0]]
    )
