"""Schedules at once: list scheduling by upward rank, and dispatch rules between rank and nearness.

Upward rank and earliest finish are HEFT (Topcuoglu, Hariri, Wu 2002). The dispatch rule takes, of
what is ready, the knot with the least `start + travel - alpha · rank`: 0 is "what can start first",
a large alpha is list scheduling.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Sequence
from math import inf
from random import Random
from typing import NamedTuple

from fleet.jobshop.budget import Budget
from fleet.jobshop.compiled import Compiled
from fleet.jobshop.problem import Place
from fleet.jobshop.timing import Rated, rate

ALPHAS = (0.1, 0.5, 1.0, 2.0, 0.2, 0.0, 0.3, 0.03, 0.7, 0.05, 0.4, 5.0)
"""Tried one after the other while there is time; spread around those that won most often."""
CANDIDATES = 48
"""Ready knots that a dispatch rule looks at, those of highest rank."""
LAST = int(Place.LAST)


class Answer(NamedTuple):
    """A solution: knots in order, a machine for every block, and what it is worth."""

    order: list[int]
    machine_of: list[int]
    rated: Rated


def construct(
    shop: Compiled,
    alpha: float | None = None,
    at_random: Random | None = None,
    budget: Budget | None = None,
) -> Answer | None:
    """Place one ready knot after the other; without `alpha` the one of highest rank (HEFT).

    `at_random` takes any machine that will do, instead of the one where a block ends first.
    Deterministic. `None` if it leads to where some block finds no machine, or if the `budget` is
    over before it is done.
    """
    board = Board(shop, at_random)
    order: list[int] = []
    missing = [len(befores) for befores in shop.knot_befores]
    ready: list[tuple[int, float, int]] = []
    guesses: dict[int, Guess] = {}
    for knot, count in enumerate(missing):
        if count == 0:
            insort(ready, (shop.knot_place[knot], -shop.knot_rank[knot], knot))
    while ready:
        if len(order) % 256 == 255 and budget is not None and budget.over:
            return None
        at = 0 if alpha is None else board.choose(ready, guesses, alpha)
        knot = ready.pop(at)[2]
        guesses.pop(knot, None)
        changed = board.place(knot)
        if changed is None:
            return None
        order.append(knot)
        if alpha is not None:
            board.update(guesses, changed)
        for later in shop.knot_laters[knot]:
            missing[later] -= 1
            if missing[later] == 0:
                insort(ready, (shop.knot_place[later], -shop.knot_rank[later], later))
    rated = rate(shop, order, board.machine_of)
    return None if rated is None else Answer(order, board.machine_of, rated)


class Guess(NamedTuple):
    """Where a ready block would be done best: finish [s], start [s] with the way, machine."""

    finish_s: float
    start_s: float
    machine: int


class Board:
    """What is placed so far."""

    def __init__(self, shop: Compiled, at_random: Random | None = None) -> None:
        self.shop, self.random = shop, at_random
        machines = shop.shop.machines
        self.free = [machine.ready_s for machine in machines]
        self.site = [machine.site for machine in machines]
        self.taken = [0] * len(machines)
        self.ends = [0.0] * len(shop.befores)
        self.machine_of = [-1] * len(shop.shop.blocks)
        self.eligible = [frozenset(block.machines) for block in shop.shop.blocks]

    def ready_s(self, block: int) -> float:
        """When what the block waits for, and is placed, has ended."""
        first = self.shop.steps_of[block][0]
        return max((self.ends[before] for before in self.shop.befores[first]), default=0.0)

    def guess(self, block: int, machine: int, ready_s: float) -> Guess:
        """The block on this machine."""
        shop = self.shop
        kind = shop.kinds[machine]
        free_s = self.free[machine]
        start_s = free_s if free_s > ready_s else ready_s
        target = shop.entry[block]
        if target >= 0:
            start_s += shop.shop.travel_s[kind][self.site[machine]][target]
        own = shop.own_s[block]
        return Guess(start_s + (own[kind] if own else 0.0), start_s, machine)

    def best(self, block: int) -> Guess | None:
        """The machine on which the block ends first; of equals the one that idles least before."""
        shop = self.shop
        others = {self.machine_of[other] for other in shop.shop.blocks[block].apart}
        others |= {self.machine_of[other] for other in shop.not_ahead[block]}
        machines: Sequence[int] = shop.shop.blocks[block].machines
        if others or shop.has_places:
            place = shop.places[block]
            machines = [m for m in machines if m not in others and self._open(m, place)]
        if not machines:
            return None
        ready_s = self.ready_s(block)
        if self.random is not None:
            return self.guess(block, self.random.choice(machines), ready_s)
        machine = self._first_done(block, machines, ready_s)
        return self.guess(block, machine, ready_s)

    def _first_done(self, block: int, machines: Sequence[int], ready_s: float) -> int:
        """`guess` for all machines, of which the least is taken: the innermost loop of all."""
        shop = self.shop
        kinds, free, site = shop.kinds, self.free, self.site
        own = shop.own_s[block] or (0.0,) * (max(kinds) + 1)
        target, travel_s = shop.entry[block], shop.shop.travel_s
        best, least_s, latest_s = -1, inf, -inf
        for machine in machines:
            free_s = free[machine]
            if free_s > least_s:
                continue
            kind = kinds[machine]
            finish_s = (free_s if free_s > ready_s else ready_s) + own[kind]
            if target >= 0:
                finish_s += travel_s[kind][site[machine]][target]
            if finish_s < least_s or (finish_s == least_s and free_s > latest_s):
                best, least_s, latest_s = machine, finish_s, free_s
        return best

    def _open(self, machine: int, place: int) -> bool:
        return self.taken[machine] != LAST and self.taken[machine] <= place

    def choose(
        self, ready: Sequence[tuple[int, float, int]], guesses: dict[int, Guess], alpha: float
    ) -> int:
        """The index in `ready` of the knot that the dispatch rule takes."""
        chosen, least = 0, inf
        first_place = ready[0][0]
        for index, (place, minus_rank, knot) in enumerate(ready[:CANDIDATES]):
            if place > first_place:
                break
            found = guesses.get(knot)
            if found is None:
                found = self.best(self.shop.knot_blocks[knot][0])
                if found is None:
                    continue
                guesses[knot] = found
            score = found.start_s + alpha * minus_rank
            if score < least:
                chosen, least = index, score
        return chosen

    def update(self, guesses: dict[int, Guess], changed: set[int]) -> None:
        """A machine only gets busier, so a guess stands unless its machine, or a nearer one, is
        among the changed."""
        for knot, found in list(guesses.items()):
            if found.machine in changed:
                del guesses[knot]
                continue
            block = self.shop.knot_blocks[knot][0]
            if self.shop.entry[block] < 0:
                continue
            for machine in changed:
                if machine in self.eligible[block]:
                    other = self.guess(block, machine, self.ready_s(block))
                    if other.finish_s < found.finish_s:
                        del guesses[knot]
                        break

    def place(self, knot: int) -> set[int] | None:
        """Give every block of the knot a machine; the machines used, or `None` if one has none."""
        shop = self.shop
        changed: set[int] = set()
        for block in shop.knot_blocks[knot]:
            found = self.best(block)
            if found is None:
                return None
            self.machine_of[block] = found.machine
            changed.add(found.machine)
        for step in shop.flow[knot]:
            machine = self.machine_of[step.block]
            kind = shop.kinds[machine]
            time = max((self.ends[before] for before in step.befores), default=0.0)
            for block in step.opens:
                opened = self.machine_of[block]
                time = max(time, self.free[opened])
                self.taken[opened] = shop.places[block]
            time += step.duration_s[kind]
            if step.target >= 0:
                time += shop.shop.travel_s[kind][self.site[machine]][step.target]
            if step.arrives >= 0:
                self.site[machine] = step.arrives
            self.ends[step.number] = time
            for block in step.closes:
                self.free[self.machine_of[block]] = time
        return changed
