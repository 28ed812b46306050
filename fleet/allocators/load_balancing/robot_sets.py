"""Sets of robots as bits of an `int`, and classes of actors and of robots that are alike.

Counting what is alike together is what makes ten thousand tasks few.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from operator import itemgetter


def bits(mask: int) -> Iterator[int]:
    """The numbers in a set, least first."""
    while mask:
        low = mask & -mask
        yield low.bit_length() - 1
        mask ^= low


def mask_of(numbers: Iterable[int], size: int) -> int:
    """The set of these numbers, each in 0…size-1."""
    row = bytearray(b"0") * size
    for number in numbers:
        row[-1 - number] = 49  # "1"
    return int(row, 2) if size else 0


def projection(wanted: Sequence[int], size: int) -> Callable[[int], int]:
    """A function that takes a set of numbers in 0…size-1 to `{k: wanted[k] in the set}`.

    It works on the digits as text: ten times as fast as going through them one by one.
    """
    if len(wanted) < 2:
        return lambda mask: sum((mask >> number & 1) << k for k, number in enumerate(wanted))
    pick = itemgetter(*(size - 1 - number for number in reversed(wanted)))
    return lambda mask: int("".join(pick(f"{mask:0{size}b}")), 2)


@dataclass(frozen=True)
class Classes:
    """Actors by class, robots by class, and who can be whom.

    Actors of a class can be the same robots, and robots of a class can be the same actors.
    `able[i]` is the set of robot classes that can be actors of class `i`.
    """

    actors: Sequence[Sequence[int]]
    robots: Sequence[Sequence[int]]
    able: Sequence[int]


def classes_of(able: Sequence[int], robots: int) -> Classes:
    """The coarsest classes; `able[a]` is the set of robots that can be actor `a`."""
    actors: dict[int, list[int]] = defaultdict(list)
    for actor, mask in enumerate(able):
        actors[mask].append(actor)
    alike = _partition(actors, robots)
    project = projection([members[0] for members in alike], robots)
    return Classes(tuple(actors.values()), alike, [project(mask) for mask in actors])


def _partition(masks: Iterable[int], robots: int) -> list[list[int]]:
    """Robots that are in exactly the same sets, together: partition refinement, set by set.

    Stops as soon as every robot is a class of its own.
    """
    blocks = [(1 << robots) - 1] if robots else []
    singletons: list[int] = []
    for mask in masks:
        refined = []
        for block in blocks:
            inside = block & mask
            for some in (inside, block ^ inside):
                if some & (some - 1):
                    refined.append(some)
                elif some:
                    singletons.append(some)
        blocks = refined
        if not blocks:
            break
    return sorted(list(bits(block)) for block in (*blocks, *singletons))
