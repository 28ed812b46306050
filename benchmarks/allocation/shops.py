"""Random shops of a fleet's kind: goals as chains of blocks, arms and carts, rooms, meetings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from random import Random

from fleet.jobshop.problem import Block, Machine, Operation, Position, Shop

ROOMS = 12
ROOM_M = 4.0
SPEEDS_M_S = (0.4, 0.6)
"""Of the two kinds, arms and carts."""
SLOWER = 1.25
"""How much longer an arm of the third kind takes."""


def random_shop(
    tasks: int, machines: int, travel: bool = True, meetings: float = 0.2, seed: int = 0
) -> Shop:
    """A shop with so many operations and machines; the same for the same arguments.

    Goals are chains of two to five blocks of one operation each, every one in another room. A share
    of `meetings` of them is a hand-over instead: an arm and a cart drive to a room, the arm gives
    the cart something, which takes both, and the cart drives away with it. Half of the machines are
    arms, a third of those slower; the rest are carts. Of the operations, 20% are for carts, 40% for
    arms, and 40% for any.
    """
    random = Random(f"{tasks} {machines} {travel} {meetings} {seed}")
    kinds = [(0 if m % 3 else 2) if m % 2 == 0 else 1 for m in range(machines)]
    arms = tuple(m for m in range(machines) if kinds[m] != 1)
    carts = tuple(m for m in range(machines) if kinds[m] == 1)
    operations: list[Operation] = []
    members: list[list[int]] = []
    able: list[tuple[int, ...]] = []

    def operation(blocks: list[int], seconds: float, after: list[int], room: int | None) -> int:
        number = len(operations)
        for block in blocks:
            members[block].append(number)
        where = room if travel else None
        operations.append(
            Operation(
                tuple(blocks),
                (seconds, seconds, seconds * SLOWER),
                tuple(after),
                target=where,
                arrives=where,
            )
        )
        return number

    def block(machines_able: tuple[int, ...]) -> int:
        members.append([])
        able.append(machines_able)
        return len(members) - 1

    while len(operations) < tasks:
        before: list[int] = []
        left = tasks - len(operations)
        if left >= 4 and random.random() < meetings:
            room, to = random.randrange(ROOMS), random.randrange(ROOMS)
            arm, cart = block(arms), block(carts)
            one = operation([arm], random.randint(20, 40), [], room)
            other = operation([cart], random.randint(2, 6), [], room)
            over = operation([arm, cart], random.randint(10, 20), [one, other], None)
            operation([cart], random.randint(2, 6), [over], to)
            continue
        for _ in range(min(random.randint(2, 5), left)):
            able_here = arms if random.random() < 0.5 else tuple(range(machines))
            if random.random() < 0.2:
                able_here = carts or able_here
            mine = block(able_here)
            done = operation([mine], random.randint(5, 60), before, random.randrange(ROOMS))
            before = [done]
    finals = set(range(len(operations))) - {b for o in operations for b in o.after}
    weighted = tuple(
        Operation(o.blocks, o.duration_s, o.after, o.target, o.arrives, float(i in finals))
        for i, o in enumerate(operations)
    )
    ways = tuple(
        tuple(tuple(abs(a - b) * ROOM_M / speed for b in range(ROOMS)) for a in range(ROOMS))
        for speed in (*SPEEDS_M_S, SPEEDS_M_S[0])
    )
    return Shop(
        weighted,
        tuple(
            Block(tuple(ops), machines_able)
            for ops, machines_able in zip(members, able, strict=True)
        ),
        tuple(Machine(kinds[m], random.randrange(ROOMS)) for m in range(machines)),
        ways if travel else (),
    )


def without_machines(shop: Shop, lost: frozenset[int]) -> Shop:
    """The shop when these machines are gone; machines keep their numbers.

    Raises:
        BadShop: some block can be done by no other machine.
    """
    blocks = (
        replace(block, machines=tuple(m for m in block.machines if m not in lost))
        for block in shop.blocks
    )
    return replace(shop, blocks=tuple(blocks))


def with_under_way(shop: Shop, machine_of: Sequence[int], under_way: frozenset[int]) -> Shop:
    """The shop in which these blocks stay on their machines and come first there."""
    blocks = (
        replace(block, machines=(machine_of[number],), position=Position.FIRST)
        if number in under_way
        else block
        for number, block in enumerate(shop.blocks)
    )
    return replace(shop, blocks=tuple(blocks))
