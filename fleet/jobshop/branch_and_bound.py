"""Every schedule of a small shop, by depth-first branch and bound, knot after knot.

Its answer is the least makespan there is, the least late one where there are due times, and of
those the one whose weighted ends come first.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

from fleet.jobshop.compiled import Compiled
from fleet.jobshop.list_scheduling import Answer
from fleet.jobshop.timing import LAST, LATE_WEIGHT, interleaved, rate

MOST_KNOTS = 7
MOST_NODES = 6000
"""Placements looked at before it is given up: about a quarter of a second."""


class Searched(NamedTuple):
    """The best answer; `proven` if there is no shorter schedule, knots in other orders included."""

    answer: Answer
    proven: bool


class _Board(NamedTuple):
    """A partial schedule. `late_s` and `total` are sums over the steps placed so far."""

    free: tuple[float, ...]
    site: tuple[int, ...]
    taken: tuple[int, ...]
    ends: dict[int, float]
    makespan_s: float
    late_s: float
    total: float


def exhaust(shop: Compiled, begin: Answer) -> Searched | None:
    """The best there is, or `None` if that would take too long. `begin` is some answer."""
    if len(shop.knot_blocks) > MOST_KNOTS:
        return None
    search = _Search(shop, begin)
    if not search.run():
        return None
    answer = rate(shop, search.order, search.machine_of)
    assert answer is not None, "a schedule that was built can be rated"
    proven = _one_order(shop) and not shop.has_due
    return Searched(Answer(search.order, search.machine_of, answer), proven)


def _one_order(shop: Compiled) -> bool:
    """Whether no schedule is lost by all machines taking knots in one order.

    A block that waits for one of two that meet can stand before the other one on its machine; and
    three that meet can be taken in different orders. Otherwise machines would wait in a circle.
    """
    return all(
        len(blocks) == 1
        or (len(blocks) == 2 and not shop.knot_befores[knot] and not shop.knot_laters[knot])
        for knot, blocks in enumerate(shop.knot_blocks)
    )


class _Search:
    def __init__(self, shop: Compiled, begin: Answer) -> None:
        self.shop = shop
        self.order, self.machine_of = list(begin.order), list(begin.machine_of)
        self.best = self._value_of(begin)
        self.nodes = 0
        machines = shop.shop.machines
        self.alike = [
            tuple(number in block.machines for block in shop.shop.blocks)
            for number in range(len(machines))
        ]
        """Machines with the same row do the same blocks."""
        self.start = _Board(
            tuple(machine.ready_s for machine in machines),
            tuple(machine.site for machine in machines),
            (0,) * len(machines),
            {},
            0.0,
            0.0,
            0.0,
        )

    def _value_of(self, answer: Answer) -> tuple[float, float]:
        steps = {step.number: step for flow in self.shop.flow for step in flow}
        ends = answer.rated.ends_s
        late = sum(max(0.0, ends[n] - step.due_s) for n, step in steps.items())
        total = sum(step.weight * ends[n] for n, step in steps.items())
        return answer.rated.makespan_s + LATE_WEIGHT * late, total

    def run(self) -> bool:
        """Whether everything was looked at."""
        return self._extend(self.start, [], {}, set(range(len(self.shop.knot_blocks))))

    def _extend(
        self, board: _Board, order: list[int], machine_of: dict[int, int], left: set[int]
    ) -> bool:
        if not left:
            value = (board.makespan_s + LATE_WEIGHT * board.late_s, board.total)
            if value < self.best:
                self.best = value
                self.order = list(order)
                self.machine_of = [machine_of[b] for b in range(len(machine_of))]
            return True
        for knot in sorted(left, key=lambda k: -self.shop.knot_rank[k]):
            if not self.shop.knot_befores[knot].isdisjoint(left):
                continue
            for machines in self._choices(board, knot, machine_of):
                if self._swapped(order, knot, machines, machine_of):
                    continue
                self.nodes += 1
                if self.nodes > MOST_NODES:
                    return False
                chosen = {**machine_of, **machines}
                after = self._placed(board, knot, chosen)
                if after is None:
                    continue
                if not self._extend(after, [*order, knot], chosen, left - {knot}):
                    return False
        return True

    def _choices(
        self, board: _Board, knot: int, machine_of: dict[int, int]
    ) -> Iterator[dict[int, int]]:
        """Machines for the knot's blocks; of machines that are alike now, one."""
        blocks = self.shop.knot_blocks[knot]
        shop = self.shop.shop
        seen: set[object] = set()
        for machines in product(*(shop.blocks[block].machines for block in blocks)):
            chosen = dict(zip(blocks, machines, strict=True))
            if any(
                {**machine_of, **chosen}.get(other) == machine
                for block, machine in chosen.items()
                for other in shop.blocks[block].apart
            ):
                continue
            looks = (
                tuple(self._looks(board, machine, machine_of) for machine in machines),
                tuple(machines.index(machine) for machine in machines),
            )
            if looks not in seen:
                seen.add(looks)
                yield chosen

    def _looks(self, board: _Board, machine: int, machine_of: dict[int, int]) -> object:
        """What a machine's future depends on; those that others keep apart from are unique."""
        kept_apart = any(
            m == machine and self.shop.shop.blocks[block].apart for block, m in machine_of.items()
        )
        return (
            self.alike[machine],
            self.shop.kinds[machine],
            board.free[machine],
            board.site[machine],
            board.taken[machine],
            machine if kept_apart else None,
        )

    def _swapped(
        self, order: Sequence[int], knot: int, machines: dict[int, int], machine_of: dict[int, int]
    ) -> bool:
        """Whether this is the schedule in which the knot before comes after this one."""
        if not order or knot > order[-1] or order[-1] in self.shop.knot_befores[knot]:
            return False
        before = {machine_of[block] for block in self.shop.knot_blocks[order[-1]]}
        return before.isdisjoint(machines.values())

    def _placed(self, board: _Board, knot: int, machine_of: dict[int, int]) -> _Board | None:
        """The schedule with one more knot, or `None` if it cannot be the beginning of the best."""
        shop = self.shop
        free, site, taken = list(board.free), list(board.site), list(board.taken)
        ends, makespan = dict(board.ends), board.makespan_s
        late, total = board.late_s, board.total
        blocks = shop.knot_blocks[knot]
        flow = shop.flow[knot]
        if len({machine_of[block] for block in blocks}) < len(blocks):
            full = [machine_of.get(block, -1) for block in range(len(shop.shop.blocks))]
            ordered = interleaved(flow, blocks, full)
            if ordered is None:
                return None
            flow = ordered
        for step in flow:
            time = max((ends[before] for before in step.befores), default=0.0)
            for block in step.opens:
                machine = machine_of[block]
                time = max(time, free[machine])
                if taken[machine] == LAST or taken[machine] > shop.places[block]:
                    return None
                taken[machine] = shop.places[block]
            machine = machine_of[step.block]
            kind = shop.kinds[machine]
            time += step.duration_s[kind]
            if step.target >= 0:
                time += shop.shop.travel_s[kind][site[machine]][step.target]
            if step.arrives >= 0:
                site[machine] = step.arrives
            ends[step.number] = time
            makespan = max(makespan, time + step.tail_s)
            total += step.weight * time
            late += max(0.0, time - step.due_s)
            for block in step.closes:
                free[machine_of[block]] = time
        if (makespan + LATE_WEIGHT * late, total) >= self.best:
            return None
        return _Board(tuple(free), tuple(site), tuple(taken), ends, makespan, late, total)
