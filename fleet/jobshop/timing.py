"""When everything ends, for one order of knots and one machine for every block."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import NamedTuple

from fleet.jobshop.compiled import Compiled, Step
from fleet.jobshop.problem import BadShop, Place, Shop, Timed, topological

ENDS_WEIGHT = 1e-3
"""How much the weighted mean end counts beside the makespan: it decides between equal makespans and
gives a search a slope to follow."""
LATE_WEIGHT = 100.0
"""A second of lateness after a due time counts as so many seconds of makespan."""
LAST = int(Place.LAST)


class Rated(NamedTuple):
    """`cost` is what searches minimise; `ends_s` by step."""

    cost: float
    makespan_s: float
    ends_s: list[float]


def rate(
    shop: Compiled, order: Sequence[int], machine_of: Sequence[int], limit: float = inf
) -> Rated | None:
    """Earliest ends if machines take knots in this `order`, which must respect dependencies.

    `None` if machines would wait for each other, if a block stands where it must not, or as soon as
    the makespan is sure to exceed `limit`.
    """
    kinds, places, travel_s = shop.kinds, shop.places, shop.shop.travel_s
    free = [machine.ready_s for machine in shop.shop.machines]
    site = [machine.site for machine in shop.shop.machines]
    ends = [0.0] * len(shop.befores)
    taken = [0] * len(free) if shop.has_places else None
    flows, late, total, makespan = shop.flow, 0.0, 0.0, 0.0
    for knot in order:
        flow: Sequence[Step] = flows[knot]
        if len(shop.knot_blocks[knot]) > 1:
            blocks = shop.knot_blocks[knot]
            if len({machine_of[b] for b in blocks}) < len(blocks):
                ordered = interleaved(flow, blocks, machine_of)
                if ordered is None:
                    return None
                flow = ordered
        for (
            number, block, befores, opens, closes,
            duration_s, target, arrives, tail_s, weight, due_s,
        ) in flow:  # fmt: skip
            time = 0.0
            for before in befores:
                if ends[before] > time:
                    time = ends[before]
            for opened in opens:
                machine = machine_of[opened]
                if free[machine] > time:
                    time = free[machine]
                if taken is not None:
                    if taken[machine] == LAST or taken[machine] > places[opened]:
                        return None
                    taken[machine] = places[opened]
            machine = machine_of[block]
            kind = kinds[machine]
            time += duration_s[kind]
            if target >= 0:
                time += travel_s[kind][site[machine]][target]
            if arrives >= 0:
                site[machine] = arrives
            if time + tail_s > limit:
                return None
            ends[number] = time
            if time > makespan:
                makespan = time
            if weight:
                total += weight * time
            if time > due_s:
                late += time - due_s
            for closed in closes:
                free[machine_of[closed]] = time
    cost = makespan + ENDS_WEIGHT * total / shop.weight_sum + LATE_WEIGHT * late
    return None if cost > limit else Rated(cost, makespan, ends)


def interleaved(
    flow: Sequence[Step], blocks: Sequence[int], machine_of: Sequence[int]
) -> list[Step] | None:
    """A knot's steps when several of its blocks share a machine, one of them after the other."""
    previous: dict[int, int] = {}
    latest: dict[int, int] = {}
    for block in blocks:
        machine = machine_of[block]
        if machine in latest:
            previous[block] = latest[machine]
        latest[machine] = block
    mine = {step.number for step in flow}
    done: set[int] = set()
    closed: set[int] = set()
    ordered: list[Step] = []
    rest = list(flow)
    while rest:
        waiting = []
        for step in rest:
            if all(b in done or b not in mine for b in step.befores) and all(
                previous.get(b, b) in closed or b not in previous for b in step.opens
            ):
                ordered.append(step)
                done.add(step.number)
                closed.update(step.closes)
            else:
                waiting.append(step)
        if len(waiting) == len(rest):
            return None
        rest = waiting
    return ordered


def timed(
    shop: Shop,
    order: Sequence[int],
    machine_of: Sequence[int],
    lower_bound_s: float = 0.0,
    notes: tuple[str, ...] = (),
) -> Timed | None:
    """The schedule in terms of the shop's operations; `order` lists blocks. `None` on deadlock.

    Machines take their blocks in `order`; unlike `rate` it allows any order of blocks.
    """
    full = Compiled(shop, merge=False)
    befores = [list(rows) for rows in full.befores]
    previous: dict[int, int] = {}
    for block in order:
        machine = machine_of[block]
        if machine in previous:
            befores[full.steps_of[block][0]].append(full.steps_of[previous[machine]][-1])
        previous[machine] = block
    try:
        sequence = topological(befores)
    except BadShop:
        return None
    rows = {step.number: step for flow in full.flow for step in flow}
    free = [machine.ready_s for machine in shop.machines]
    site = [machine.site for machine in shop.machines]
    starts, ends = [0.0] * len(befores), [0.0] * len(befores)
    for number in sequence:
        step = rows[number]
        machine = machine_of[step.block]
        kind = full.kinds[machine]
        start = max((ends[b] for b in befores[number]), default=0.0)
        start = max([start, *(free[machine_of[b]] for b in step.opens)])
        duration = step.duration_s[kind]
        if step.target >= 0:
            duration += shop.travel_s[kind][site[machine]][step.target]
        if step.arrives >= 0:
            site[machine] = step.arrives
        starts[number], ends[number] = start, start + duration
        for block in step.closes:
            free[machine_of[block]] = ends[number]
    return Timed(tuple(machine_of), tuple(order), tuple(starts), tuple(ends), lower_bound_s, notes)
