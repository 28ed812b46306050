"""Task graphs: order, reachability, cycles. Reachability as bit sets in Python integers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from heapq import heapify, heappop, heappush


class Cycle(Exception):
    """The graph has a cycle; `tasks` are those on it or behind it."""

    def __init__(self, tasks: Sequence[str]) -> None:
        super().__init__(f"cycle among {', '.join(tasks)}")
        self.tasks = tuple(tasks)


class TaskGraph:
    """A DAG of task names. Edges point from a task to those that come after it.

    Raises:
        Cycle: on construction, if there is one.
        KeyError: on construction, if an edge names a task that does not exist.
    """

    def __init__(self, after: Mapping[str, Iterable[str]]) -> None:
        """`after` maps every task to the tasks that it waits for."""
        self.predecessors: dict[str, frozenset[str]] = {
            task: frozenset(befores) for task, befores in after.items()
        }
        self.successors: dict[str, set[str]] = {task: set() for task in self.predecessors}
        for task, befores in self.predecessors.items():
            for before in befores:
                self.successors[before].add(task)
        self.order = self._topological()
        self._index = {task: number for number, task in enumerate(self.order)}
        self._ancestors = [0] * len(self.order)
        for number, task in enumerate(self.order):
            bits = 0
            for before in self.predecessors[task]:
                index = self._index[before]
                bits |= self._ancestors[index] | 1 << index
            self._ancestors[number] = bits

    def _topological(self) -> tuple[str, ...]:
        rank = {task: number for number, task in enumerate(self.predecessors)}
        missing = {task: len(befores) for task, befores in self.predecessors.items()}
        ready = [rank[task] for task, count in missing.items() if count == 0]
        names = list(self.predecessors)
        heapify(ready)
        order: list[str] = []
        while ready:
            task = names[heappop(ready)]
            order.append(task)
            for later in self.successors[task]:
                missing[later] -= 1
                if missing[later] == 0:
                    heappush(ready, rank[later])
        if len(order) < len(names):
            done = set(order)
            raise Cycle([task for task in names if task not in done])
        return tuple(order)

    def earliest(self, duration_s: Mapping[str, float]) -> dict[str, tuple[float, float]]:
        """When each task starts and ends, s, if each starts as soon as it may."""
        spans: dict[str, tuple[float, float]] = {}
        for task in self.order:
            start_s = max((spans[before][1] for before in self.predecessors[task]), default=0.0)
            spans[task] = start_s, start_s + duration_s[task]
        return spans

    def precedes(self, first: str, second: str) -> bool:
        """Whether `first` ends before `second` starts in every order the graph allows."""
        return bool(self._ancestors[self._index[second]] >> self._index[first] & 1)

    def mask(self, tasks: Iterable[str]) -> int:
        """These tasks as a bit set; `last_before` takes it."""
        bits = 0
        for task in tasks:
            bits |= 1 << self._index[task]
        return bits

    def before(self, task: str) -> int:
        """The tasks that end before it starts in every order, as a bit set."""
        return self._ancestors[self._index[task]]

    def behind(self, task: str) -> int:
        """The tasks that it ends before in every order, as a bit set."""
        return self._descendants[self._index[task]]

    @cached_property
    def _descendants(self) -> list[int]:
        found = [0] * len(self.order)
        for number in reversed(range(len(self.order))):
            for later in self.successors[self.order[number]]:
                index = self._index[later]
                found[number] |= found[index] | 1 << index
        return found

    def named(self, mask: int) -> tuple[str, ...]:
        """The tasks in a bit set, in the graph's order."""
        found = []
        while mask:
            bit = mask & -mask
            found.append(self.order[bit.bit_length() - 1])
            mask ^= bit
        return tuple(found)

    def last_before(self, task: str, mask: int) -> tuple[str, ...]:
        """Of the tasks in `mask`, those before `task` with no other of them in between."""
        return self.last_of(self._ancestors[self._index[task]] & mask)

    def last_of(self, mask: int) -> tuple[str, ...]:
        """Of the tasks in `mask`, those with no other of them behind them."""
        found = []
        while mask:
            index = mask.bit_length() - 1
            found.append(self.order[index])
            mask &= ~(self._ancestors[index] | 1 << index)
        return tuple(found)

    def first_not_after(self, task: str, mask: int) -> str | None:
        """Of the tasks in `mask`, the first in `order` that is neither this one nor after it."""
        number = self._index[task]
        mask &= ~(self._descendants[number] | 1 << number)
        return self.order[(mask & -mask).bit_length() - 1] if mask else None

    def reduced(self) -> dict[str, tuple[str, ...]]:
        """The fewest edges with the same meaning: task to the tasks it waits for directly."""
        result: dict[str, tuple[str, ...]] = {}
        for task in self.predecessors:
            covered = 0
            for before in self.predecessors[task]:
                covered |= self._ancestors[self._index[before]]
            direct = [b for b in self.predecessors[task] if not covered >> self._index[b] & 1]
            result[task] = tuple(sorted(direct, key=self._index.__getitem__))
        return result
