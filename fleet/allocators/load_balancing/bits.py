"""Sets of small numbers as bits of an `int`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
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


def selector(wanted: Sequence[int], size: int) -> Callable[[int], int]:
    """A function that takes a set of numbers in 0…size-1 to `{k: wanted[k] in the set}`.

    It works on the digits as text: ten times as fast as going through them one by one.
    """
    if len(wanted) < 2:
        return lambda mask: sum((mask >> number & 1) << k for k, number in enumerate(wanted))
    pick = itemgetter(*(size - 1 - number for number in reversed(wanted)))
    return lambda mask: int("".join(pick(f"{mask:0{size}b}")), 2)
