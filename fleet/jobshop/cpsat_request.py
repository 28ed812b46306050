"""A shop as CP-SAT's process reads it, and whether it is of a size for that."""

from __future__ import annotations

import os
from math import floor
from typing import Any

from fleet.jobshop.compiled import Compiled
from fleet.jobshop.list_scheduling import Answer

MAX_CHOICES = 4000
"""Blocks times pools of machines up to which CP-SAT is asked, without travel."""
MAX_ARCS = 12_000
"""Pairs of blocks on a machine, over all machines, up to which it is asked, with travel."""
MOST_WORKERS = 8
"""Threads of CP-SAT; one more than there are cores, so that one can prove while others search."""
UNITS_PER_S = 1000
"""Times become whole milliseconds, rounded down, so that a bound stays a bound; times that are
whole seconds stay exact."""


def helps(shop: Compiled) -> bool:
    """Whether the model is small enough to be of use."""
    blocks = shop.shop.blocks
    if shop.travels:
        if any(exit_ < 0 for exit_ in shop.exit_of):
            return False  # where a machine is then depends on more than the block before
        return sum(len(b.machines) for b in blocks) * len(blocks) <= MAX_ARCS
    group_of = {machine: g for g, group in enumerate(groups_of(shop)) for machine in group}
    return sum(len({group_of[m] for m in block.machines}) for block in blocks) <= MAX_CHOICES


def request_of(
    shop: Compiled, hint: Answer, bound_s: float, until_s: float, seed: int
) -> dict[str, Any]:
    """What cpsat_process.py reads; `until_s` is on `time.time()`."""
    unit = unit_of(shop)
    groups = groups_of(shop)

    def whole(seconds: float) -> int:
        return floor(seconds * unit + 1e-6)

    group_of = {m: g for g, group in enumerate(groups) for m in group}
    machines = shop.shop.machines
    ends = hint.rated.ends_s
    starts = _starts(shop, hint)
    return {
        "until": until_s,
        "workers": min((os.cpu_count() or 1) + 1, MOST_WORKERS),
        "seed": seed,
        "horizon": whole(hint.rated.makespan_s) + 1,
        "bound": whole(bound_s - 1e-9),
        "travel": [[[whole(s) for s in row] for row in rows] for rows in shop.shop.travel_s]
        if shop.travels
        else None,
        "groups": [
            {
                "kind": machines[group[0]].kind,
                "ready": whole(machines[group[0]].ready_s),
                "site": machines[group[0]].site,
                "size": len(group),
            }
            for group in groups
        ],
        "steps": [
            {
                "block": step.block,
                "befores": step.befores,
                "durations": [whole(d) for d in step.duration_s],
                "target": step.target,
                "tail": whole(step.tail_s),
            }
            for step in sorted(step for flow in shop.flow for step in flow)
        ],
        "blocks": [
            {
                "groups": sorted({group_of[m] for m in block.machines}),
                "steps": shop.steps_of[b],
                "place": int(block.place),
                "apart": sorted(block.apart),
                "entry": next(
                    (s for s in shop.steps_of[b] if shop.block_of[s] == b and shop.targets[s] >= 0),
                    -1,
                ),
                "exit": shop.exit_of[b],
            }
            for b, block in enumerate(shop.shop.blocks)
        ],
        "hint": {
            "starts": [whole(s) for s in starts],
            "ends": [whole(e) for e in ends],
            "groups": [group_of[m] for m in hint.machine_of],
        },
    }


def _starts(shop: Compiled, hint: Answer) -> list[float]:
    kinds = shop.kinds
    return [
        max(0.0, hint.rated.ends_s[s] - shop.durations[s][kinds[hint.machine_of[b]]])
        for s, b in enumerate(shop.block_of)
    ]


def unit_of(shop: Compiled) -> int:
    """How many of the model's units are a second."""
    return 1 if shop.whole else UNITS_PER_S


def groups_of(shop: Compiled) -> list[list[int]]:
    """Machines that are alike in everything; with travel each is its own group."""
    machines = shop.shop.machines
    if shop.travels:
        return [[m] for m in range(len(machines))]
    masks = [0] * len(machines)
    for number, block in enumerate(shop.shop.blocks):
        for m in block.machines:
            masks[m] |= 1 << number
    found: dict[tuple[int, float, int], list[int]] = {}
    for m, machine in enumerate(machines):
        found.setdefault((machine.kind, machine.ready_s, masks[m]), []).append(m)
    return list(found.values())
