"""CP-SAT in a process of its own: it can be ended at any moment, and keeps what it found."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from importlib.util import find_spec
from math import floor
from pathlib import Path
from typing import Any, NamedTuple

from fleet.jobshop.forward_pass import Solution
from fleet.jobshop.preprocessing import Instance
from fleet.jobshop.problem import Position

GRACE_S = 0.3
"""How much later than its deadline the process may end before it is ended, s."""
MAX_CHOICES = 4000
"""Blocks times pools of machines up to which CP-SAT is asked, without travel."""
MAX_ARCS = 12_000
"""Pairs of blocks on a machine, over all machines, up to which it is asked, with travel."""
MOST_WORKERS = 8
"""Threads of CP-SAT; one more than there are cores, so that one can prove while others search."""
UNITS_PER_S = 1000
"""Times become whole milliseconds, rounded down, so that a bound stays a bound; times that are
whole seconds stay exact."""


class CpSatResult(NamedTuple):
    """What CP-SAT found: blocks in order with their machines, if better; and its bound [s].

    In a pool of machines blocks may stand where they must not: that is seen in the forward pass.
    """

    order: list[int] | None
    machine_of: list[int] | None
    lower_bound_s: float
    status: str


class CpSat:
    """One run, begun at construction. The instance must be of a size for which `helps` is true."""

    def __init__(
        self, instance: Instance, hint: Solution, bound_s: float, until_s: float, seed: int
    ) -> None:
        """`until_s` is on `time.time()`."""
        self._instance = instance
        self._groups = groups_of(instance)
        self._unit = unit_of(instance)
        self._until_s = until_s
        request = request_of(instance, hint, bound_s, until_s, seed)
        with ExitStack() as opened:
            # No pipe: nobody reads before the end, and a full one would stop the solver.
            self._answers = opened.enter_context(
                tempfile.TemporaryFile(mode="w+", encoding="utf-8")
            )
            self._process = subprocess.Popen(
                [sys.executable, "-P", str(Path(__file__).with_name("cpsat_process.py"))],
                stdin=subprocess.PIPE,
                stdout=self._answers,
                stderr=subprocess.DEVNULL,
                text=True,
            )
            opened.callback(self._end)
            assert self._process.stdin is not None
            # It may end at once; what it says, or does not, is read as usual.
            with suppress(BrokenPipeError), self._process.stdin as pipe:
                pipe.write(json.dumps(request))
            self._opened = opened.pop_all()

    @property
    def ended(self) -> bool:
        """Whether it has nothing more to say."""
        return self._process.poll() is not None

    def result(self) -> CpSatResult:
        """Wait until its deadline at most; what it found."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(max(self._until_s + GRACE_S - time.time(), 0.0))
        self._end()
        self._answers.seek(0)
        return self._read(self._answers.read())

    def close(self) -> None:
        """End it, whatever it is doing."""
        self._opened.close()

    def _end(self) -> None:
        self._process.kill()  # nothing to one that has ended
        self._process.wait()

    def _read(self, text: str) -> CpSatResult:
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
            return CpSatResult(None, None, bound, status)
        starts, ends = solution["starts"], solution["ends"]
        order = sorted(range(len(starts)), key=lambda b: (starts[b], ends[b]))
        return CpSatResult(order, self._machines(solution, order), bound, status)

    def _machines(self, solution: dict[str, Any], order: Sequence[int]) -> list[int]:
        """Blocks of a pool to its machines: each to one that is free, as intervals are coloured."""
        free = {m: 0.0 for group in self._groups for m in group}
        machine_of = [-1] * len(order)
        positions = self._instance.positions
        for block in sorted(
            order, key=lambda b: (positions[b] != Position.FIRST, solution["starts"][b])
        ):
            machine = min(self._groups[solution["groups"][block]], key=free.__getitem__)
            machine_of[block] = machine
            last = positions[block] == Position.LAST
            free[machine] = float("inf") if last else solution["ends"][block]
        return machine_of


def installed() -> bool:
    """Whether OR-Tools can be imported."""
    return find_spec("ortools") is not None


def helps(instance: Instance) -> bool:
    """Whether the model is small enough to be of use."""
    blocks = instance.shop.blocks
    if instance.travels:
        if any(exit_ < 0 for exit_ in instance.exit_of):
            return False  # where a machine is then depends on more than the block before
        return sum(len(b.machines) for b in blocks) * len(blocks) <= MAX_ARCS
    group_of = {machine: g for g, group in enumerate(groups_of(instance)) for machine in group}
    return sum(len({group_of[m] for m in block.machines}) for block in blocks) <= MAX_CHOICES


def request_of(
    instance: Instance, hint: Solution, bound_s: float, until_s: float, seed: int
) -> dict[str, Any]:
    """What cpsat_process.py reads; `until_s` is on `time.time()`."""
    unit = unit_of(instance)
    groups = groups_of(instance)

    def whole(seconds: float) -> int:
        return floor(seconds * unit + 1e-6)

    group_of = {m: g for g, group in enumerate(groups) for m in group}
    machines = instance.shop.machines
    return {
        "until": until_s,
        "workers": min((os.cpu_count() or 1) + 1, MOST_WORKERS),
        "seed": seed,
        "horizon": whole(hint.makespan_s) + 1,
        "bound": whole(bound_s - 1e-9),
        "travel": [[[whole(s) for s in row] for row in rows] for rows in instance.shop.travel_s]
        if instance.travels
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
        "operations": [
            {
                "block": op.block,
                "predecessors": op.predecessors,
                "durations": [whole(d) for d in op.duration_s],
                "target": op.target,
                "tail": whole(op.tail_s),
            }
            for op in sorted(op for row in instance.component_operations for op in row)
        ],
        "blocks": [
            {
                "groups": sorted({group_of[m] for m in block.machines}),
                "operations": instance.operations_of[b],
                "position": int(block.position),
                "apart": sorted(block.apart),
                "entry": next(
                    (
                        op
                        for op in instance.operations_of[b]
                        if instance.block_of[op] == b and instance.targets[op] >= 0
                    ),
                    -1,
                ),
                "exit": instance.exit_of[b],
            }
            for b, block in enumerate(instance.shop.blocks)
        ],
        "hint": {
            "starts": [whole(s) for s in hint.start_s],
            "ends": [whole(s) for s in hint.end_s],
            "groups": [group_of[m] for m in hint.machine_of],
        },
    }


def unit_of(instance: Instance) -> int:
    """How many of the model's units are a second."""
    return 1 if instance.whole else UNITS_PER_S


def groups_of(instance: Instance) -> list[list[int]]:
    """Machines that are alike in everything; with travel each is its own group."""
    machines = instance.shop.machines
    if instance.travels:
        return [[m] for m in range(len(machines))]
    masks = [0] * len(machines)
    for number, block in enumerate(instance.shop.blocks):
        for m in block.machines:
            masks[m] |= 1 << number
    found: dict[tuple[int, float, int], list[int]] = {}
    for m, machine in enumerate(machines):
        found.setdefault((machine.kind, machine.ready_s, masks[m]), []).append(m)
    return list(found.values())
