"""Actors and robots that are alike are counted together: what makes ten thousand tasks few."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from fleet.allocators.load_balancing.bits import bits, mask_of, selector

N = TypeVar("N", bound=Hashable)
R = TypeVar("R", bound=Hashable)


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
    rows: dict[int, list[int]] = defaultdict(list)
    for actor, mask in enumerate(able):
        rows[mask].append(actor)
    together = _alike(rows, robots)
    translated = selector([members[0] for members in together], robots)
    able_classes = [translated(mask) for mask in rows]
    return Classes(tuple(rows.values()), together, able_classes)


def classes_of_needs(
    needs: Sequence[N], kinds: Sequence[R], able: Callable[[N, R], bool]
) -> Classes:
    """Classes from what every actor needs and what kind every robot is.

    `able` is asked once for each different need and kind, so two kinds that differ in something
    nobody needs are still two classes; that costs time and no quality.
    """
    actors: dict[N, list[int]] = defaultdict(list)
    for actor, need in enumerate(needs):
        actors[need].append(actor)
    robots: dict[R, list[int]] = defaultdict(list)
    for robot, kind in enumerate(kinds):
        robots[kind].append(robot)
    masks = [
        mask_of((j for j, kind in enumerate(robots) if able(need, kind)), len(robots))
        for need in actors
    ]
    return Classes(tuple(actors.values()), tuple(robots.values()), masks)


def _alike(rows: dict[int, list[int]], robots: int) -> list[list[int]]:
    """Robots that are in exactly the same sets, together: the partition is refined set by set.

    Stops as soon as every robot stands alone.
    """
    parts = [(1 << robots) - 1] if robots else []
    alone: list[int] = []
    for row in rows:
        refined = []
        for part in parts:
            inside = part & row
            for some in (inside, part ^ inside):
                if some & (some - 1):
                    refined.append(some)
                elif some:
                    alone.append(some)
        parts = refined
        if not parts:
            break
    return sorted(list(bits(part)) for part in (*parts, *alone))
