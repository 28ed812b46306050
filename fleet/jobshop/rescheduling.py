"""A schedule mended after a machine is lost or late, with few blocks changing hands.

Candidates: the old order gone through again for a range of targets, where everybody stays who does
not stand in the way of the target; the orphans put where there is time; a schedule from scratch;
and the best of those annealed. Of all that are within `WITHIN` of the shortest, the one with the
fewest moves is taken, moves that it can do without are taken back, and what time is left goes into
a search with a price on moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf

from fleet.jobshop.annealing import anneal
from fleet.jobshop.budget import Budget
from fleet.jobshop.compiled import Compiled
from fleet.jobshop.list_scheduling import Answer, construct
from fleet.jobshop.portfolio import blocks_in_order
from fleet.jobshop.problem import BadShop, Place, Shop, Timed
from fleet.jobshop.timing import rate, timed
from fleet.jobshop.warm_start import keep

WITHIN = 0.02
"""Share of the best makespan that fewer moves may cost."""
PRICE = 0.002
"""Share of the makespan that one move costs while annealing: ten moves for `WITHIN`."""
TARGETS = (1.0, 0.99, 0.98, 0.97, 0.995, 0.985, 0.975, 0.96, 0.95, 0.94)
"""Of the longest makespan that is allowed; tried one after the other."""
TARGETS_SHARE, REPAIR_SHARE, SHORTEN_SHARE = 0.4, 0.5, 0.6
MORE_TARGETS_SHARE, TAKE_BACK_SHARE = 0.75, 0.85
"""When each step is over, as a share of the time."""
TRIED = 4
"""Machines that are tried for an orphan: those that are done first."""


@dataclass(frozen=True)
class Rescheduled:
    """The mended schedule; `moved` are blocks that are not where they were.

    `best_makespan_s` is the shortest found whatever it moves.
    """

    timed: Timed
    moved: tuple[int, ...]
    best_makespan_s: float


def without_machines(shop: Shop, lost: frozenset[int]) -> Shop:
    """The shop when these machines are gone; machines keep their numbers.

    Raises:
        BadShop: some block can be done by no other machine.
    """
    blocks = []
    for number, block in enumerate(shop.blocks):
        rest = tuple(machine for machine in block.machines if machine not in lost)
        if not rest:
            raise BadShop(f"block {number} can be done by no machine that is left")
        blocks.append(replace(block, machines=rest))
    return replace(shop, blocks=tuple(blocks))


def reschedule(
    shop: Shop,
    home: Sequence[int],
    order: Sequence[int],
    budget: Budget,
    frozen: frozenset[int] = frozenset(),
    seed: int = 0,
) -> Rescheduled | None:
    """Mend the schedule `home` (machine of each block) and `order` (of blocks) for the `shop` as
    it is now.

    Blocks whose home is not among their machines any more are orphans. Blocks in `frozen` are under
    way: they stay where they are, before everything else there. What is done is not in the shop,
    and a machine's `ready_s` says when it is free. `None` if no way was found.

    Raises:
        BadShop: a frozen block cannot be done by its machine.
    """
    shop = _pinned(shop, home, frozen)
    ready = Compiled(shop)
    knots = _knots_in_order(ready, order)
    first = [construct(ready), keep(ready, knots, home, inf)]
    found = [answer for answer in first if answer is not None]
    if not found and (repaired := _repair(ready, home, knots, budget)) is not None:
        found.append(repaired)
    if not found:
        return None
    mending = _Mending(ready, home, knots, frozen, found, seed)
    mending.keep_to_targets(budget.until(TARGETS_SHARE))
    mending.repair(budget.until(REPAIR_SHARE))
    mending.shorten(budget.until(SHORTEN_SHARE))
    mending.keep_to_targets(budget.until(MORE_TARGETS_SHARE))
    chosen = mending.move_less(budget.until(TAKE_BACK_SHARE), budget)
    answer = timed(shop, blocks_in_order(ready, chosen), chosen.machine_of)
    assert answer is not None, "an order of knots has no deadlock"
    return Rescheduled(answer, tuple(_moved(chosen.machine_of, home)), mending.best_s)


class _Mending:
    """Everything found so far, and ways to find more."""

    def __init__(
        self,
        shop: Compiled,
        home: Sequence[int],
        knots: Sequence[int],
        frozen: frozenset[int],
        found: list[Answer],
        seed: int,
    ) -> None:
        self.shop, self.home, self.knots, self.frozen = shop, home, knots, frozen
        self.found, self.seed = found, seed
        self.kept: list[Answer] = []
        """Of those found, the ones that keep to a target."""
        self.targeted_s = 0.0
        """The limit that targets were last taken from."""

    @property
    def best_s(self) -> float:
        """The shortest makespan found, whatever it moves."""
        return min(answer.rated.makespan_s for answer in self.found)

    @property
    def limit_s(self) -> float:
        """The longest makespan that fewer moves may lead to."""
        return self.best_s * (1 + WITHIN)

    def keep_to_targets(self, budget: Budget) -> None:
        """Everybody stays where the target can be met. That may miss it by a little, where there
        are ways or partners, so that shorter ones are tried, too."""
        tried = 0
        while tried < len(TARGETS):
            if self.met and budget.over:
                break
            if self.limit_s != self.targeted_s:
                # The first time, or one of those before has come out shorter than all others.
                self.targeted_s, tried = self.limit_s, 0
            elif tried == 0:
                break
            target_s = TARGETS[tried] * self.targeted_s
            tried += 1
            made = keep(self.shop, self.knots, self.home, target_s)
            if made is not None:
                self.found.append(made)
                self.kept.append(made)

    @property
    def met(self) -> bool:
        """Whether keeping to a target has led to a schedule that is short enough."""
        limit_s = self.limit_s
        return any(answer.rated.makespan_s <= limit_s for answer in self.kept)

    def repair(self, budget: Budget) -> None:
        """Only orphans move."""
        made = _repair(self.shop, self.home, self.knots, budget)
        if made is not None:
            self.found.append(made)

    def shorten(self, budget: Budget) -> None:
        """Search for a shorter schedule at any number of moves, from one that has few: what comes
        out of a new one would set a limit that only new ones meet."""
        begin = self.kept if self.met else self.found
        shortest = min(begin, key=lambda answer: answer.rated.makespan_s)
        self.found.append(anneal(self.shop, shortest, budget, 0.0, self.seed, frozen=self.frozen))

    def move_less(self, take_back: Budget, budget: Budget) -> Answer:
        """The answer with the fewest moves within the limit, and fewer if that can be."""
        chosen = self._chosen()
        chosen = _taken_back(self.shop, chosen, self.home, self.limit_s, take_back)
        self.found.append(chosen)
        price_s = PRICE * self.best_s
        priced = anneal(
            self.shop, chosen, budget, 0.0, self.seed + 1, price_s, self.home, self.frozen
        )
        self.found.append(priced)
        return self._chosen()

    def _chosen(self) -> Answer:
        limit_s = self.limit_s
        return min(
            (answer for answer in self.found if answer.rated.makespan_s <= limit_s),
            key=lambda a: (len(_moved(a.machine_of, self.home)), a.rated.makespan_s),
        )


def _pinned(shop: Shop, home: Sequence[int], frozen: frozenset[int]) -> Shop:
    blocks = list(shop.blocks)
    for number in frozen:
        if home[number] not in blocks[number].machines:
            raise BadShop(f"block {number} is under way on a machine that cannot do it")
        blocks[number] = replace(
            blocks[number],
            machines=(home[number],),
            place=Place.LAST if blocks[number].place == Place.LAST else Place.FIRST,
        )
    return replace(shop, blocks=tuple(blocks))


def _moved(machine_of: Sequence[int], home: Sequence[int]) -> list[int]:
    return [b for b, (now, was) in enumerate(zip(machine_of, home, strict=True)) if now != was]


def _repair(
    shop: Compiled, home: Sequence[int], knots: Sequence[int], budget: Budget
) -> Answer | None:
    """Everything stays but the orphans, the one of highest rank first; they go where there is least
    to do, and while there is time, where the makespan is least."""
    blocks = shop.shop.blocks
    machine_of = list(home)
    orphans = [b for b, block in enumerate(blocks) if home[b] not in block.machines]
    orphans.sort(key=lambda b: -shop.knot_rank[shop.knot_of[b]])
    busy = [machine.ready_s for machine in shop.shop.machines]
    for block, machine in enumerate(home):
        if machine in blocks[block].machines:
            busy[machine] += _length_s(shop, block, machine)
    for block in orphans:
        machine_of[block] = min(blocks[block].machines, key=busy.__getitem__)
        busy[machine_of[block]] += _length_s(shop, block, machine_of[block])
    best = rate(shop, knots, machine_of)
    for block in orphans:
        if budget.over:
            break
        now = machine_of[block]
        for machine in sorted(blocks[block].machines, key=busy.__getitem__)[:TRIED]:
            if any(machine_of[other] == machine for other in blocks[block].apart):
                continue
            machine_of[block] = machine
            found = rate(shop, knots, machine_of, best.cost if best else inf)
            if found is not None and (best is None or found.cost < best.cost):
                length_s = _length_s(shop, block, machine)
                busy[now] -= length_s
                busy[machine] += length_s
                best, now = found, machine
        machine_of[block] = now
    apart = any(machine_of[o] == machine_of[b] for b, row in enumerate(blocks) for o in row.apart)
    return None if best is None or apart else Answer(list(knots), machine_of, best)


def _length_s(shop: Compiled, block: int, machine: int) -> float:
    own = shop.own_s[block]
    return own[shop.kinds[machine]] if own else 0.0


def _knots_in_order(shop: Compiled, order: Sequence[int]) -> list[int]:
    """Knots in the order in which the last of their blocks begins, mended where something that
    comes before stands behind; blocks that must be first come first, the others' order stays."""
    at = {block: i for i, block in enumerate(order)}
    key = {
        knot: (shop.knot_place[knot] != Place.FIRST, max(at.get(b, len(at)) for b in blocks))
        for knot, blocks in enumerate(shop.knot_blocks)
    }
    done: set[int] = set()
    result: list[int] = []
    for knot in sorted(key, key=key.__getitem__):
        stack = [knot]
        while stack:
            top = stack[-1]
            if top in done:
                stack.pop()
                continue
            waits = [k for k in shop.knot_befores[top] if k not in done]
            if waits:
                stack.extend(waits)
            else:
                done.add(top)
                result.append(stack.pop())
    return result


def _taken_back(
    shop: Compiled, answer: Answer, home: Sequence[int], limit_s: float, budget: Budget
) -> Answer:
    """Moves undone one by one, as long as the makespan stays within the limit."""
    machine_of, rated = list(answer.machine_of), answer.rated
    for block in _moved(machine_of, home):
        row = shop.shop.blocks[block]
        if budget.over:
            break
        if home[block] not in row.machines or any(
            machine_of[other] == home[block] for other in row.apart
        ):
            continue
        now = machine_of[block]
        machine_of[block] = home[block]
        found = rate(shop, answer.order, machine_of)
        if found is None or found.makespan_s > limit_s:
            machine_of[block] = now
        else:
            rated = found
    return Answer(answer.order, machine_of, rated)
