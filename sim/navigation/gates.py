"""Bottlenecks of the floor: who is let in, and who comes out first.

Priority inheritance alone lets whoever has waited longest push others back through a door, who then
push in turn: with many robots at a door most of the time goes into that. So a bottleneck is driven
through in one direction at a time, by some robots one after the other; those who wait on the far
side have their turn after them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from sim.navigation.lattice import Lattice

CROWD_NODES = 4
"""Nodes of an area for each robot that is let in though it only drives through."""

TURN = 4
"""Robots that drive through in one direction while others wait for the other."""

APRON = 2
"""Steps before a bottleneck within which those who wait make way for who comes out."""


@dataclass(eq=False)
class Gate:
    """Some nodes that are a bottleneck. `sides` tells of the nodes next to it which of them are
    together; `alone`: one robot is let in at a time, whatever its direction.

    `direction` is the side that those inside come from, `turn` how many came from there in a row.
    """

    nodes: frozenset[int]
    apron: frozenset[int]
    sides: Mapping[int, int]
    alone: bool = False
    direction: int | None = None
    turn: int = 0
    came_from: dict[str, int | None] = field(default_factory=dict)
    """The side from which each robot came that is inside, or still before it."""
    awaited: frozenset[int | None] = frozenset()
    """Sides at which somebody waited in the latest round."""
    waiting: set[int | None] = field(default_factory=set)
    """The same, of the round under way."""

    def lets_in(self, start: int, inside: Iterable[str]) -> bool:
        """Whether a robot at a node next to it may drive in, with these robots inside."""
        within = list(inside)
        side = self.sides.get(start)
        if within and (self.alone or any(self.came_from.get(name) != side for name in within)):
            return False
        others_wait = any(other != side for other in self.awaited)
        return not (others_wait and side == self.direction and self.turn >= TURN)

    def entered(self, robot: str, start: int) -> None:
        """Note that a robot drives in from a node next to it."""
        side = self.sides.get(start)
        self.turn = self.turn + 1 if side == self.direction else 1
        self.direction = side
        self.came_from[robot] = side

    def next_round(self) -> None:
        """Everybody decides anew."""
        self.awaited, self.waiting = frozenset(self.waiting), set()


def bottlenecks(lattice: Lattice, cuts: Sequence[bool]) -> list[Gate]:
    """The bottlenecks of a floor: nodes with one way in and one out, of those without which the
    floor falls apart, as `cuts` says of each."""
    found: list[Gate] = []
    left = {n for n, cut in enumerate(cuts) if cut and len(lattice.neighbours[n]) == 2}
    while left:
        nodes = _together(lattice, {min(left)}, left)
        left -= nodes
        gate = gate_of(lattice, frozenset(nodes))
        if len(set(gate.sides.values())) > 1:
            found.append(gate)
    return found


class Areas:
    """What the floor falls into without its bottlenecks, and how many robots drive through each.

    Who waits in a room takes nobody's way; a corridor that is full of robots that cannot pass each
    other is no use to any of them. So no more are let into an area than can drive there, but for
    those who want to get somewhere in it: they leave it to nobody else.
    """

    def __init__(self, lattice: Lattice, gates: Sequence[Gate]) -> None:
        nodes = set(range(len(lattice))) - {node for gate in gates for node in gate.nodes}
        self._of: dict[int, int] = {}
        self.most: dict[int, int] = {}
        """Robots that may drive through each area at a time."""
        left = set(nodes)
        while left:
            area = min(left)
            found = _together(lattice, {area}, nodes)
            left -= found
            self._of |= dict.fromkeys(found, area)
            self.most[area] = max(2, len(found) // CROWD_NODES)
        self._through: dict[int, int] = {}

    def count(self, robots: Iterable[tuple[int, int | None]]) -> None:
        """Where each robot is, and where it goes, as nodes."""
        self._through = dict.fromkeys(self.most, 0)
        for node, goal in robots:
            area = self._of.get(node)
            if area is not None and goal is not None and self._of.get(goal) != area:
                self._through[area] += 1

    def of(self, node: int | None) -> int | None:
        """The area that a node is in, if it is in none of the bottlenecks."""
        return None if node is None else self._of.get(node)

    def full_beyond(self, gate: Gate, start: int, goal: int | None) -> int | None:
        """The area that a robot comes to through a gate from a node next to it, if as many robots
        as it has room for drive through that already."""
        beyond = self._beyond(gate, start)
        if len(beyond) != 1 or goal is None or goal in gate.nodes:
            return None
        (area,) = beyond
        full = self._of.get(goal) != area and self._through[area] >= self.most[area]
        return area if full else None

    def entered(self, gate: Gate, start: int, goal: int | None) -> None:
        """Count one more, until the next round."""
        for area in self._beyond(gate, start):
            if self.of(goal) != area:
                self._through[area] += 1

    def _beyond(self, gate: Gate, start: int) -> set[int]:
        side = gate.sides.get(start)
        return {self._of[node] for node, other in gate.sides.items() if other != side}


def gate_of(lattice: Lattice, nodes: frozenset[int], alone: bool = False) -> Gate:
    """A gate of some nodes, with what lies around it."""
    apron, edge = set(nodes), set(nodes)
    for _ in range(APRON):
        edge = {other for node in edge for other in lattice.neighbours[node]} - apron
        apron |= edge
    around = apron - nodes
    beside = {other for node in nodes for other in lattice.neighbours[node]} - nodes
    sides: dict[int, int] = {}
    for node in sorted(beside):
        if node not in sides:
            together = _together(lattice, {node}, around)
            sides |= dict.fromkeys(together & beside, node)
    return Gate(nodes, frozenset(apron), sides, alone)


def _together(lattice: Lattice, start: set[int], among: set[int]) -> set[int]:
    """The nodes of `among` that one gets to from `start` without leaving them."""
    found, ahead = set(start), list(start)
    while ahead:
        for other in lattice.neighbours[ahead.pop()]:
            if other in among and other not in found:
                found.add(other)
                ahead.append(other)
    return found
