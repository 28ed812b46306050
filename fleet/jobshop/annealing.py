"""Simulated annealing on the order of knots and the machines of blocks, along the critical path.

Kirkpatrick, Gelatt, Vecchi 1983; moves at the critical path as in van Laarhoven, Aarts, Lenstra
1992. A candidate is given up as soon as it is sure to be refused: the threshold is drawn first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf, log
from random import Random

from fleet.jobshop.budget import Budget
from fleet.jobshop.compiled import Compiled
from fleet.jobshop.list_scheduling import Answer
from fleet.jobshop.timing import rate

HOT, COLD = 0.02, 0.0002
"""Temperatures at the beginning and the end, as shares of the makespan."""
FIRST_COOLING, LATER_COOLING = 0.25, 0.25
"""Shares of the time that is left for the first cooling, and for each one after it, which begins
from the best so far."""
SHORTEST_S = 0.1
"""No cooling is shorter than this, s."""
REASSIGN, SWAP = 0.45, 0.6
"""Of all moves so many (and then up to so many) give a block another machine (swap two machines);
the rest change the order."""
EXPLORE = 0.15
"""Share of moves that start anywhere and not on the critical path."""
NEAR = 1e-9


def anneal(
    shop: Compiled,
    begin: Answer,
    budget: Budget,
    bound_s: float = 0.0,
    seed: int = 0,
    move_price_s: float = 0.0,
    home: Sequence[int] | None = None,
    frozen: frozenset[int] = frozenset(),
    stopped: Callable[[], bool] = lambda: False,
) -> Answer:
    """The best found from `begin` until the `budget` is over or the bound is met.

    With `home` machines, every block away from home costs `move_price_s`. Blocks in `frozen` keep
    their machine. It ends as soon as `stopped` says so. The answer is never worse than `begin`.
    """
    random = Random(seed)
    search = _Search(shop, begin, random, move_price_s, home, frozen)
    share = FIRST_COOLING
    while not budget.over:
        if search.run(budget.part(share, SHORTEST_S), bound_s, stopped):
            break
        search = _Search(shop, search.best, random, move_price_s, home, frozen)
        share = LATER_COOLING
    return search.best


class _Search:
    def __init__(
        self,
        shop: Compiled,
        begin: Answer,
        random: Random,
        move_price_s: float,
        home: Sequence[int] | None,
        frozen: frozenset[int],
    ) -> None:
        self.shop, self.random = shop, random
        self.price_s, self.home, self.frozen = move_price_s, home, frozen
        self.order = list(begin.order)
        self.machine_of = list(begin.machine_of)
        self.ends = begin.rated.ends_s
        self.makespan = begin.rated.makespan_s
        self.cost = begin.rated.cost + self._moves_price()
        self.best, self.best_cost = begin, self.cost
        self.where = [0] * len(self.order)
        self.critical: list[int] = []
        self._index(0, len(self.order))
        self._trace()

    def run(self, budget: Budget, bound_s: float, stopped: Callable[[], bool]) -> bool:
        """One cooling; whether there is nothing more to look for."""
        random = self.random
        scale = self.makespan or 1.0
        tries = 0
        temperature = HOT * scale
        exact = self.price_s == 0.0 and not self.shop.has_due and len(self.order) > 0
        if len(self.order) == 0:
            return True
        while True:
            if tries % 16 == 0:
                spent = budget.spent
                if spent >= 1.0:
                    return False
                if exact and self.best.rated.makespan_s <= bound_s * (1 + NEAR) + NEAR:
                    return True
                if tries % 512 == 0 and stopped():
                    return True
                temperature = scale * HOT * (COLD / HOT) ** spent
            tries += 1
            limit = self.cost - temperature * log(1.0 - random.random())
            pick = random.random()
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
        machines = self.shop.shop.blocks[block].machines
        if len(machines) < 2 or block in self.frozen:
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
        blocks = self.shop.shop.blocks
        if a == b or one in self.frozen or other in self.frozen:
            return
        if b not in blocks[one].machines or a not in blocks[other].machines:
            return
        self.machine_of[one], self.machine_of[other] = b, a
        if self._apart(one, b) or self._apart(other, a) or not self._try(limit):
            self.machine_of[one], self.machine_of[other] = a, b

    def _apart(self, block: int, machine: int) -> bool:
        return any(self.machine_of[o] == machine for o in self.shop.shop.blocks[block].apart)

    def _shift(self, limit: float) -> None:
        """Move a knot before, or behind, another one of its machine; or anywhere near."""
        block = self._block()
        knot = self.shop.knot_of[block]
        now = self.where[knot]
        machine = self.machine_of[block]
        mine = [self.where[self.shop.knot_of[b]] for b in self.critical]
        near = [p for p in mine if p != now and self._on(p, machine)]
        span = max(2, len(self.order) // 8)
        to = self.random.choice(near) if near and self.random.random() < 0.7 else (
            now + self.random.randint(-span, span)
        )  # fmt: skip
        to = min(max(to, 0), len(self.order) - 1)
        if to < now:
            to = max([to, *(self.where[k] + 1 for k in self.shop.knot_befores[knot])])
        else:
            to = min([to, *(self.where[k] - 1 for k in self.shop.knot_laters[knot])])
        if to == now:
            return
        self._move(knot, now, to)
        if not self._try(limit):
            self._move(knot, to, now)

    def _on(self, position: int, machine: int) -> bool:
        return any(
            self.machine_of[b] == machine for b in self.shop.knot_blocks[self.order[position]]
        )

    def _move(self, knot: int, now: int, to: int) -> None:
        del self.order[now]
        self.order.insert(to, knot)
        self._index(min(now, to), max(now, to) + 1)

    def _index(self, begin: int, end: int) -> None:
        for position in range(begin, end):
            self.where[self.order[position]] = position

    def _moves_price(self) -> float:
        if self.home is None or self.price_s == 0.0:
            return 0.0
        return self.price_s * sum(
            1 for now, was in zip(self.machine_of, self.home, strict=True) if now != was
        )

    def _try(self, limit: float) -> bool:
        price = self._moves_price()
        found = rate(self.shop, self.order, self.machine_of, limit - price)
        if found is None:
            return False
        self.cost = found.cost + price
        self.ends, self.makespan = found.ends_s, found.makespan_s
        self._trace()
        if self.cost < self.best_cost - NEAR:
            self.best_cost = self.cost
            self.best = Answer(list(self.order), list(self.machine_of), found)
        return True

    def _trace(self) -> None:
        """The blocks on one critical path, from the last end back along what steps waited for."""
        shop, ends = self.shop, self.ends
        self.critical = []
        if not ends:
            return
        step = max(range(len(ends)), key=ends.__getitem__)
        seen: set[int] = set()
        kinds = shop.kinds
        while step not in seen:
            seen.add(step)
            mine = shop.blocks_of[step]
            self.critical.extend(b for b in mine if b not in self.critical[-2:])
            latest = max(shop.befores[step], key=ends.__getitem__, default=-1)
            after_s = ends[latest] if latest >= 0 else -inf
            length = shop.durations[step][kinds[self.machine_of[mine[0]]]]
            start_s = ends[step] - length
            if latest >= 0 and (after_s >= start_s - NEAR or shop.steps_of[mine[0]][0] != step):
                step = latest
                continue
            before = self._previous(mine, step, after_s)
            if before < 0 and latest < 0:
                return
            step = before if before >= 0 else latest

    def _previous(self, mine: Sequence[int], step: int, after_s: float) -> int:
        """The last step of the block that the machine did just before, if it ended later."""
        shop, ends = self.shop, self.ends
        best, latest = -1, max(after_s, 0.0)
        for block in mine:
            if shop.steps_of[block][0] != step:
                continue
            machine = self.machine_of[block]
            position = self.where[shop.knot_of[block]]
            for back in range(position - 1, max(-1, position - 400), -1):
                found = [
                    b for b in shop.knot_blocks[self.order[back]] if self.machine_of[b] == machine
                ]
                if found:
                    end = ends[shop.steps_of[found[-1]][-1]]
                    if end > latest:
                        best, latest = shop.steps_of[found[-1]][-1], end
                    break
        return best
