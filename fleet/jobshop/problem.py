"""The neutral scheduling problem: operations, blocks, machines. It knows nothing of robots.

It covers the job shop (every operation a block of its own, with one machine), the flexible job shop
(several machines), and fleets: a *block* is a run of operations that one machine does in order,
without another block in between, as a robot does an actor's tasks; an operation may belong to two
blocks, as a hand-over does, and then needs both machines at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from math import inf, isfinite


class Position(IntEnum):
    """Where in its machine's sequence a block may stand."""

    FIRST = 0
    """Before every block that is not `FIRST`: it needs the machine as it is now."""
    ANYWHERE = 1
    LAST = 2
    """Nothing comes after it: it leaves the machine with a load."""


@dataclass(frozen=True)
class Operation:
    """What one machine does, or several together.

    `blocks` are the blocks that it belongs to, the one whose machine sets its duration first.
    `after` are operations that must have ended. `duration_s` is by machine kind. With a `target`
    site, the machine first drives there from where it is; it is at `arrives` afterwards.
    `weight` says how much its end counts where makespans are equal; `due_s` when it should end.
    """

    blocks: tuple[int, ...]
    duration_s: tuple[float, ...]
    after: tuple[int, ...] = ()
    target: int | None = None
    arrives: int | None = None
    weight: float = 0.0
    due_s: float = inf


@dataclass(frozen=True)
class Block:
    """Operations (by index, in their order) that one of `machines` does in a row."""

    operations: tuple[int, ...]
    machines: tuple[int, ...]
    position: Position = Position.ANYWHERE
    apart: frozenset[int] = frozenset()
    """Blocks that must be on other machines."""


@dataclass(frozen=True)
class Machine:
    """A machine: its kind (a column of durations), the site it starts from, when it is free [s]."""

    kind: int = 0
    site: int = 0
    ready_s: float = 0.0


class BadShop(ValueError):
    """The problem contradicts itself; the message says where."""


@dataclass(frozen=True)
class Shop:
    """A scheduling problem. `travel_s[kind][origin][target]` are seconds between sites.

    Raises:
        BadShop: an index is out of range, an operation is in a block that does not list it, a
            block has no machine, or operations wait for each other in a circle.
    """

    operations: tuple[Operation, ...]
    blocks: tuple[Block, ...]
    machines: tuple[Machine, ...]
    travel_s: tuple[tuple[tuple[float, ...], ...], ...] = field(default=())

    def __post_init__(self) -> None:
        for number, block in enumerate(self.blocks):
            if not block.machines or not block.operations:
                raise BadShop(f"block {number} has no machine, or no operation")
            if not all(0 <= m < len(self.machines) for m in block.machines):
                raise BadShop(f"block {number} names a machine that does not exist")
            if not all(number in self.operations[op].blocks for op in block.operations):
                raise BadShop(f"block {number} lists an operation that does not list it")
        for number, operation in enumerate(self.operations):
            if not operation.blocks or not all(
                number in self.blocks[block].operations for block in operation.blocks
            ):
                raise BadShop(f"operation {number} is in a block that does not list it")
            if not all(isfinite(d) and d >= 0 for d in operation.duration_s):
                raise BadShop(f"operation {number}: durations must be finite and not negative")


@dataclass(frozen=True)
class Schedule:
    """A schedule: the machine of every block, the order of blocks, when operations end [s].

    Every machine takes its blocks in the order in which they stand in `order`. `lower_bound_s` is
    proven: no schedule is shorter.
    """

    machine_of: tuple[int, ...]
    order: tuple[int, ...]
    start_s: tuple[float, ...]
    end_s: tuple[float, ...]
    lower_bound_s: float = 0.0
    notes: tuple[str, ...] = ()

    @property
    def makespan_s(self) -> float:
        """When the last operation ends."""
        return max(self.end_s, default=0.0)

    @property
    def gap(self) -> float:
        """How far from optimal at most: `(makespan - bound) / makespan`; 0 is proven optimal."""
        makespan_s = self.makespan_s
        if makespan_s <= 0:
            return 0.0
        return max(0.0, (makespan_s - self.lower_bound_s) / makespan_s)


def topological(befores: Sequence[Sequence[int]]) -> list[int]:
    """Indexes in an order that respects `befores`.

    Raises:
        BadShop: there is a circle.
    """
    later: list[list[int]] = [[] for _ in befores]
    missing = [len(b) for b in befores]
    for number, rows in enumerate(befores):
        for before in rows:
            later[before].append(number)
    order = [number for number, count in enumerate(missing) if count == 0]
    for number in order:
        for after in later[number]:
            missing[after] -= 1
            if missing[after] == 0:
                order.append(after)
    if len(order) < len(befores):
        raise BadShop("operations wait for each other in a circle")
    return order
