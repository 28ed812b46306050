"""Simulated annealing on the order of components and the machines of blocks, along the critical
path.

Kirkpatrick, Gelatt, Vecchi 1983; moves at the critical path as in van Laarhoven, Aarts, Lenstra
1992. A candidate is given up as soon as it is sure to be refused: the threshold is drawn first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import log
from random import Random

from fleet.jobshop.forward_pass import Solution, evaluate
from fleet.jobshop.preprocessing import Instance
from fleet.jobshop.time_budget import TimeBudget

HOT, COLD = 0.02, 0.0002
"""Temperatures at the beginning and the end, as shares of the makespan."""
COOLING = 0.25
"""Share of the time that is left for each cooling; each begins from the best so far."""
SHORTEST_S = 0.1
"""No cooling is shorter than this, s."""
REASSIGN, SWAP = 0.45, 0.6
"""Of all moves so many (and then up to so many) give a block another machine (swap two machines);
the rest change the order."""
EXPLORE = 0.15
"""Share of moves of a block anywhere, and not on the critical path."""
NEAR = 1e-9


def anneal(
    instance: Instance,
    begin: Solution,
    budget: TimeBudget,
    bound_s: float = 0.0,
    seed: int = 0,
    move_price_s: float = 0.0,
    home: Sequence[int] | None = None,
    stopped: Callable[[], bool] = lambda: False,
) -> Solution:
    """The best found from `begin` until the `budget` is over or the bound is met.

    With `home` machines, every block away from home costs `move_price_s`. It ends as soon as
    `stopped` says so. The solution is never worse than `begin`.
    """
    random = Random(seed)
    search = _Search(instance, begin, random, move_price_s, home)
    while not budget.over:
        if search.run(budget.part(COOLING, SHORTEST_S), bound_s, stopped):
            break
        search = _Search(instance, search.best, random, move_price_s, home)
    return search.best


class _Search:
    def __init__(
        self,
        instance: Instance,
        begin: Solution,
        random: Random,
        move_price_s: float,
        home: Sequence[int] | None,
    ) -> None:
        self.instance, self.random = instance, random
        self.price_s, self.home = move_price_s, home
        self.order = list(begin.order)
        self.machine_of = list(begin.machine_of)
        self.start_s, self.end_s = begin.start_s, begin.end_s
        self.makespan = begin.makespan_s
        self.cost = begin.cost + self._moves_price()
        self.best, self.best_cost = begin, self.cost
        self.settled = all(len(block.machines) == 1 for block in instance.shop.blocks)
        """Whether only the order is left to choose."""
        self.index_of = [0] * len(self.order)
        self.critical: list[int] = []
        self._index(0, len(self.order))
        if self.order:
            self._trace()

    def run(self, budget: TimeBudget, bound_s: float, stopped: Callable[[], bool]) -> bool:
        """One cooling; whether there is nothing more to look for."""
        if not self.order:
            return True
        random = self.random
        scale = self.makespan or 1.0
        tries = 0
        exact = self.price_s == 0.0 and not self.instance.has_due
        while True:
            if tries % 16 == 0:
                spent = budget.spent
                if spent >= 1.0:
                    return False
                if exact and self.best.makespan_s <= bound_s * (1 + NEAR) + NEAR:
                    return True
                if tries % 512 == 0 and stopped():
                    return True
                temperature = scale * HOT * (COLD / HOT) ** spent
            tries += 1
            limit = self.cost - temperature * log(1.0 - random.random())
            pick = 1.0 if self.settled else random.random()
            if pick < REASSIGN:
                self._reassign(limit)
            elif pick < SWAP:
                self._swap(limit)
            else:
                self._shift(limit)

    def _block(self) -> int:
        if not self.critical or self.random.random() < EXPLORE:
            return self.random.randrange(len(self.machine_of))
        return self.random.choice(self.critical)

    def _reassign(self, limit: float) -> None:
        block = self._block()
        machines = self.instance.shop.blocks[block].machines
        if len(machines) < 2:
            return
        old = self.machine_of[block]
        new = self.random.choice(machines)
        if new == old or self._apart(block, new):
            return
        self.machine_of[block] = new
        if not self._try(limit):
            self.machine_of[block] = old

    def _swap(self, limit: float) -> None:
        one = self._block()
        other = self.random.randrange(len(self.machine_of))
        a, b = self.machine_of[one], self.machine_of[other]
        blocks = self.instance.shop.blocks
        if a == b or b not in blocks[one].machines or a not in blocks[other].machines:
            return
        self.machine_of[one], self.machine_of[other] = b, a
        if self._apart(one, b) or self._apart(other, a) or not self._try(limit):
            self.machine_of[one], self.machine_of[other] = a, b

    def _apart(self, block: int, machine: int) -> bool:
        return any(self.machine_of[o] == machine for o in self.instance.shop.blocks[block].apart)

    def _shift(self, limit: float) -> None:
        """Move a component before, or behind, another one of its machine; or anywhere near."""
        block = self._block()
        component = self.instance.component_of[block]
        now = self.index_of[component]
        machine = self.machine_of[block]
        mine = [self.index_of[self.instance.component_of[b]] for b in self.critical]
        near = [p for p in mine if p != now and self._on(p, machine)]
        span = max(2, len(self.order) // 8)
        to = self.random.choice(near) if near and self.random.random() < 0.7 else (
            now + self.random.randint(-span, span)
        )  # fmt: skip
        to = min(max(to, 0), len(self.order) - 1)
        if to < now:
            befores = self.instance.component_predecessors[component]
            to = max([to, *(self.index_of[k] + 1 for k in befores)])
        else:
            laters = self.instance.component_successors[component]
            to = min([to, *(self.index_of[k] - 1 for k in laters)])
        if to == now:
            return
        self._move(component, now, to)
        if not self._try(limit):
            self._move(component, to, now)

    def _on(self, position: int, machine: int) -> bool:
        blocks = self.instance.component_blocks[self.order[position]]
        return any(self.machine_of[block] == machine for block in blocks)

    def _move(self, component: int, now: int, to: int) -> None:
        del self.order[now]
        self.order.insert(to, component)
        self._index(min(now, to), max(now, to) + 1)

    def _index(self, begin: int, end: int) -> None:
        for position in range(begin, end):
            self.index_of[self.order[position]] = position

    def _moves_price(self) -> float:
        if self.home is None or self.price_s == 0.0:
            return 0.0
        return self.price_s * sum(
            1 for now, was in zip(self.machine_of, self.home, strict=True) if now != was
        )

    def _try(self, limit: float) -> bool:
        price = self._moves_price()
        found = evaluate(self.instance, self.order, self.machine_of, limit - price)
        if found is None:
            return False
        self.cost = found.cost + price
        self.start_s, self.end_s, self.makespan = found.start_s, found.end_s, found.makespan_s
        self._trace()
        if self.cost < self.best_cost - NEAR:
            self.best_cost = self.cost
            self.best = found._replace(order=list(self.order), machine_of=list(self.machine_of))
        return True

    def _trace(self) -> None:
        """The blocks on one critical path: from the last end back along what was waited for."""
        instance, end_s = self.instance, self.end_s
        self.critical = []
        op = max(range(len(end_s)), key=end_s.__getitem__)
        while True:
            mine = instance.blocks_of[op]
            self.critical.extend(b for b in mine if b not in self.critical[-2:])
            latest = max(instance.predecessors[op], key=end_s.__getitem__, default=-1)
            if latest < 0 or end_s[latest] < self.start_s[op] - NEAR:
                latest = self._previous(op)
            if latest < 0:
                return
            op = latest

    def _previous(self, op: int) -> int:
        """The last operation of the block before on the machine that it waited for; -1: none."""
        instance = self.instance
        for block in instance.blocks_of[op]:
            if instance.operations_of[block][0] != op:
                continue
            machine = self.machine_of[block]
            position = self.index_of[instance.component_of[block]]
            for back in range(position - 1, max(-1, position - 400), -1):
                blocks = instance.component_blocks[self.order[back]]
                found = [b for b in blocks if self.machine_of[b] == machine]
                if found:
                    last = instance.operations_of[found[-1]][-1]
                    if self.end_s[last] >= self.start_s[op] - NEAR:
                        return last
                    break
        return -1
