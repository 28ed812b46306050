"""CP-SAT in a process of its own: it can be ended at any moment, and keeps what it found."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from importlib.util import find_spec
from math import floor
from pathlib import Path
from typing import Any, NamedTuple

from fleet.allocators.makespan.compiled import Compiled
from fleet.allocators.makespan.lists import Answer
from fleet.allocators.makespan.problem import Place

MAX_CHOICES = 4000
"""Blocks times pools of machines up to which CP-SAT is asked, without travel."""
MAX_ARCS = 12_000
"""Pairs of blocks on a machine, over all machines, up to which it is asked, with travel."""
GRACE_S = 0.3
"""How much later than its deadline the process may end before it is ended, s."""
UNITS_PER_S = 1000
"""Times become whole milliseconds, rounded down, so that a bound stays a bound; times that are
whole seconds stay exact."""


class Exact(NamedTuple):
    """What CP-SAT found: blocks in order with their machines, if better; and its bound [s]."""

    order: list[int] | None
    machine_of: list[int] | None
    lower_bound_s: float
    status: str


class CpSat:
    """One run, begun at construction. `shop` must be of a size for which `helps` is true."""

    def __init__(
        self, shop: Compiled, hint: Answer, bound_s: float, until_s: float, seed: int
    ) -> None:
        """`until_s` is on `time.time()`."""
        self._shop = shop
        self._groups = _groups(shop)
        self._unit = 1 if shop.whole else UNITS_PER_S
        self._until_s = until_s
        request = self._request(hint, bound_s, until_s, seed)
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(Path(__file__).with_name("cpsat_process.py"))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        assert self._process.stdin is not None
        # It may end at once; what it says, or does not, is read as usual.
        with suppress(BrokenPipeError), self._process.stdin as pipe:
            pipe.write(json.dumps(request))
        self._process.stdin = None

    @property
    def ended(self) -> bool:
        """Whether it has nothing more to say."""
        return self._process.poll() is not None

    def result(self) -> Exact:
        """Wait until its deadline at most; what it found."""
        try:
            wait_s = max(self._until_s + GRACE_S - time.time(), 0.0)
            text, _ = self._process.communicate(timeout=wait_s)
        except subprocess.TimeoutExpired:
            self._process.kill()
            text, _ = self._process.communicate()
        return self._read(text)

    def close(self) -> None:
        """End it, whatever it is doing."""
        self._process.kill()
        self._process.communicate()

    def _read(self, text: str) -> Exact:
        solution: dict[str, Any] | None = None
        bound, status = 0.0, "UNKNOWN"
        for line in text.splitlines():
            try:
                row = json.loads(line)
            except ValueError:
                continue  # cut off in the middle
            if "status" in row:
                status = row["status"]
                if status in ("OPTIMAL", "FEASIBLE", "UNKNOWN"):
                    # The bound is a whole number: the next one up from what is proven.
                    bound = floor(row["bound"] + 1e-6) / self._unit
            else:
                solution = row
        if solution is None:
            return Exact(None, None, bound, status)
        starts, ends = solution["starts"], solution["ends"]
        order = sorted(range(len(starts)), key=lambda b: (starts[b], ends[b]))
        return Exact(order, self._machines(solution, order), bound, status)

    def _machines(self, solution: dict[str, Any], order: Sequence[int]) -> list[int]:
        """Blocks of a pool to its machines: each to one that is free, as intervals are coloured."""
        free = {m: 0.0 for group in self._groups for m in group}
        machine_of = [-1] * len(order)
        places = self._shop.places
        for block in sorted(order, key=lambda b: (places[b] != Place.FIRST, solution["starts"][b])):
            machine = min(self._groups[solution["groups"][block]], key=free.__getitem__)
            machine_of[block] = machine
            last = places[block] == Place.LAST
            free[machine] = float("inf") if last else solution["ends"][block]
        return machine_of

    def _request(self, hint: Answer, bound_s: float, until_s: float, seed: int) -> dict[str, Any]:
        shop, unit = self._shop, self._unit

        def whole(seconds: float) -> int:
            return floor(seconds * unit + 1e-6)

        group_of = {m: g for g, group in enumerate(self._groups) for m in group}
        machines = shop.shop.machines
        ends = hint.rated.ends_s
        starts = _starts(shop, hint)
        return {
            "until": until_s,
            "workers": max(1, min(os.cpu_count() or 1, 8)),
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
                for group in self._groups
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
                        (
                            s
                            for s in shop.steps_of[b]
                            if shop.block_of[s] == b and shop.targets[s] >= 0
                        ),
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


def installed() -> bool:
    """Whether OR-Tools can be imported."""
    return find_spec("ortools") is not None


def helps(shop: Compiled) -> bool:
    """Whether the model is small enough to be of use."""
    blocks = shop.shop.blocks
    if shop.travels:
        if any(exit_ < 0 for exit_ in shop.exit_of):
            return False  # where a machine is then depends on more than the block before
        return sum(len(b.machines) for b in blocks) * len(blocks) <= MAX_ARCS
    group_of = {machine: g for g, group in enumerate(_groups(shop)) for machine in group}
    return sum(len({group_of[m] for m in block.machines}) for block in blocks) <= MAX_CHOICES


def _groups(shop: Compiled) -> list[list[int]]:
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
