"""CP-SAT in a process of its own: it can be ended at any moment, and keeps what it found."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from importlib.util import find_spec
from math import floor
from pathlib import Path
from typing import Any, NamedTuple

from fleet.jobshop.compiled import Compiled
from fleet.jobshop.cpsat_request import groups_of, request_of, unit_of
from fleet.jobshop.list_scheduling import Answer
from fleet.jobshop.problem import Place

GRACE_S = 0.3
"""How much later than its deadline the process may end before it is ended, s."""


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
        self._groups = groups_of(shop)
        self._unit = unit_of(shop)
        self._until_s = until_s
        request = request_of(shop, hint, bound_s, until_s, seed)
        # A file and not a pipe: nobody reads before the end, and a full pipe would stop the solver.
        self._answers = tempfile.TemporaryFile(mode="w+", encoding="utf-8")  # noqa: SIM115 (close)
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(Path(__file__).with_name("cpsat_process.py"))],
            stdin=subprocess.PIPE,
            stdout=self._answers,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        assert self._process.stdin is not None
        # It may end at once; what it says, or does not, is read as usual.
        with suppress(BrokenPipeError), self._process.stdin as pipe:
            pipe.write(json.dumps(request))

    @property
    def ended(self) -> bool:
        """Whether it has nothing more to say."""
        return self._process.poll() is not None

    def result(self) -> Exact:
        """Wait until its deadline at most; what it found."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(max(self._until_s + GRACE_S - time.time(), 0.0))
        self._end()
        self._answers.seek(0)
        return self._read(self._answers.read())

    def close(self) -> None:
        """End it, whatever it is doing."""
        self._end()
        self._answers.close()

    def _end(self) -> None:
        self._process.kill()  # nothing to one that has ended
        self._process.wait()

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
        machine_of = self._machines(solution, order)
        if not self._in_place(order, machine_of):
            return Exact(None, None, bound, status)
        return Exact(order, machine_of, bound, status)

    def _in_place(self, order: Sequence[int], machine_of: Sequence[int]) -> bool:
        """Whether on every machine those that must be first, or last, are."""
        latest: dict[int, int] = {}
        for block in order:
            place, before = self._shop.places[block], latest.get(machine_of[block])
            if before is not None and (before == Place.LAST or before > place):
                return False
            latest[machine_of[block]] = place
        return True

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


def installed() -> bool:
    """Whether OR-Tools can be imported."""
    return find_spec("ortools") is not None
