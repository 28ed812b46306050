"""Driven distances over a lattice, worked out as far as anybody asks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from heapq import heappop, heappush

Step = tuple[int, float, tuple[int, ...]]
"""To a neighbouring node: which one, how far [m], and the nodes whose room the step needs, too."""


class DistanceField:
    """Driven distance from any node to the nearest of `goals`, m; `inf` where there is no way.

    `blocked` nodes are not entered. Dijkstra's algorithm from the goals, which goes on where it
    was when somebody asks for a node that it has not come to: robots ask for what is around them,
    and in a large building that is little.
    """

    def __init__(
        self, steps: Sequence[Sequence[Step]], goals: frozenset[int], blocked: frozenset[int]
    ) -> None:
        self._steps, self.goals, self._blocked = steps, goals, blocked
        self._least: dict[int, float] = dict.fromkeys(sorted(goals), 0.0)
        """The shortest way found so far."""
        self._final: dict[int, float] = {}
        self._heap = [(0.0, goal) for goal in sorted(goals)]

    def holds_with(self, blocked: frozenset[int]) -> bool:
        """Whether what was worked out is true with other nodes `blocked`; if so, go on with those.

        The corners that a step cuts are neighbours of where it begins: the search has come to them.
        """
        if blocked is self._blocked:
            return True
        if not self._least.keys().isdisjoint(blocked ^ self._blocked):
            return False
        self._blocked = blocked
        return True

    def __getitem__(self, node: int) -> float:
        final = self._final.get(node)
        return self._search(node) if final is None else final

    def within(self, node: int, limit_m: float) -> bool:
        """Whether a node is no farther than that; nothing farther away is looked at."""
        final = self._final.get(node)
        return (self._search(node, limit_m) if final is None else final) <= limit_m

    def _search(self, wanted: int, limit_m: float = math.inf) -> float:
        """Go on until the distance of a node is final, or it is known to be beyond the limit."""
        heap, least, final, blocked = self._heap, self._least, self._final, self._blocked
        while heap:
            cost, node = heap[0]
            if wanted in final:
                return final[wanted]
            if cost > limit_m:
                return math.inf
            heappop(heap)
            if node in final:
                continue
            final[node] = cost
            if node in blocked and node not in self.goals:
                continue
            for other, length, corners in self._steps[node]:
                if corners and not blocked.isdisjoint(corners):
                    continue
                reached = cost + length
                if reached < least.get(other, math.inf) - 1e-9:
                    least[other] = reached
                    heappush(heap, (reached, other))
        return final.setdefault(wanted, math.inf)
