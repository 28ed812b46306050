"""A schedule mended after a machine is lost or late, with few blocks changing hands.

Candidates: the orphans put where there is time; the old order gone through again, each block where
it was unless it ends so many seconds earlier elsewhere, for a range of seconds; the best of those
annealed with a price on every move, and without; and a schedule from scratch. Of all that are
within `WITHIN` of the shortest, the one with the fewest moves is taken, and moves that it can do
without are taken back.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf

from fleet.allocators.makespan.anneal import anneal
from fleet.allocators.makespan.compiled import Compiled
from fleet.allocators.makespan.lists import Answer, Habit, construct
from fleet.allocators.makespan.portfolio import blocks_in_order
from fleet.allocators.makespan.problem import BadShop, Place, Shop, Timed
from fleet.allocators.makespan.timing import rate, timed

WITHIN = 0.02
"""Share of the best makespan that fewer moves may cost."""
PRICE = 0.002
"""Share of the makespan that one move costs while annealing: ten moves for `WITHIN`."""
SLACKS = (0.2, 0.03, 0.08, 0.015, 0.05, 0.005)
"""Shares of the makespan by which a block must end earlier elsewhere to be moved."""
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
    frozen: frozenset[int] = frozenset(),
    deadline_s: float = 0.7,
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
    until_s = time.perf_counter() + deadline_s
    shop = _pinned(shop, home, frozen)
    ready = Compiled(shop)
    knots = _knots_in_order(ready, order)
    repaired = _repair(ready, home, knots)
    scratch = construct(ready)
    first = [a for a in (repaired, scratch) if a is not None]
    if not first:
        return None
    scale_s = min(a.rated.makespan_s for a in first)
    for share in SLACKS:
        if time.perf_counter() > until_s - 0.6 * deadline_s:
            break
        made = construct(ready, habit=Habit(knots, home, share * scale_s))
        if made is not None:
            first.append(made)
    scale_s = min(a.rated.makespan_s for a in first)

    def priced_s(a: Answer) -> float:
        return a.rated.makespan_s + PRICE * scale_s * len(_moved(a.machine_of, home))

    length_s = until_s - time.perf_counter()
    start = min(first, key=priced_s)
    priced = anneal(
        ready, start, until_s - 0.35 * length_s, 0.0, seed, PRICE * scale_s, home, frozen
    )
    shortest = min([*first, priced], key=lambda a: a.rated.makespan_s)
    free = anneal(ready, shortest, until_s - 0.2 * length_s, 0.0, seed + 1, frozen=frozen)
    found = [*first, priced, free]
    best_s = min(a.rated.makespan_s for a in found)
    good = [a for a in found if a.rated.makespan_s <= best_s * (1 + WITHIN)]
    chosen = min(good, key=lambda a: (len(_moved(a.machine_of, home)), a.rated.makespan_s))
    chosen = _taken_back(ready, chosen, home, best_s * (1 + WITHIN), until_s)
    answer = timed(shop, blocks_in_order(ready, chosen), chosen.machine_of)
    assert answer is not None, "an order of knots has no deadlock"
    return Rescheduled(answer, tuple(_moved(chosen.machine_of, home)), best_s)


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


def _repair(shop: Compiled, home: Sequence[int], knots: list[int]) -> Answer | None:
    """Everything stays but the orphans, the one of highest rank first."""
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
    return None if best is None or apart else Answer(knots, machine_of, best)


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
    shop: Compiled, answer: Answer, home: Sequence[int], limit_s: float, until_s: float
) -> Answer:
    """Moves undone one by one, as long as the makespan stays within the limit."""
    machine_of, rated = list(answer.machine_of), answer.rated
    for block in _moved(machine_of, home):
        row = shop.shop.blocks[block]
        if time.perf_counter() > until_s:
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
