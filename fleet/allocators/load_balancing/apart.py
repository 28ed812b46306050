"""Actors that must be different robots: whether enough robots can be them."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Sequence

from fleet.allocators.load_balancing.bits import bits


def neighbours(apart: Collection[tuple[int, int]], actors: int) -> list[set[int]]:
    """For every actor those that must be another robot."""
    near: list[set[int]] = [set() for _ in range(actors)]
    for one, other in apart:
        near[one].add(other)
        near[other].add(one)
    return near


def why_not_apart(able: Sequence[int], apart: Collection[tuple[int, int]]) -> tuple[int, ...]:
    """Actors that are all apart from each other, and more than the robots that can be any of them.

    Empty if no such group was found; that is no proof that the pairs can be kept apart. Groups are
    grown greedily from every pair; in a group, a violated condition of Hall's marriage theorem is
    looked for by augmenting paths.
    """
    near = neighbours(apart, len(able))
    seen: set[tuple[int, ...]] = set()
    for one, other in sorted(apart):
        group = [one, other]
        common = near[one] & near[other]
        while common:
            actor = min(common, key=lambda a: (able[a].bit_count(), a))
            group.append(actor)
            common &= near[actor]
        key = tuple(sorted(group))
        if key not in seen:
            seen.add(key)
            if short := _too_many(key, able):
                return short
    return ()


def _too_many(group: Sequence[int], able: Sequence[int]) -> tuple[int, ...]:
    """Members of the group that can be fewer robots together than they are; empty if none."""
    taken: dict[int, int] = {}
    for start in group:
        came_from: dict[int, int] = {}
        """By robot: the actor that wants it."""
        queue = deque([start])
        reached = {start}
        end = -1
        while queue and end < 0:
            actor = queue.popleft()
            for robot in bits(able[actor]):
                if robot in came_from:
                    continue
                came_from[robot] = actor
                if robot not in taken:
                    end = robot
                    break
                reached.add(taken[robot])
                queue.append(taken[robot])
        if end < 0:
            return tuple(sorted(reached))
        mine = {actor: robot for robot, actor in taken.items()}
        while True:
            actor = came_from[end]
            taken[end] = actor
            if actor == start:
                break
            end = mine[actor]
    return ()
