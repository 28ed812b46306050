"""Who owns which nodes of the lattice: PIBT, in the form that waits for nobody's clock.

Priority inheritance with backtracking (Okumura et al., "Priority Inheritance with Backtracking for
Iterative Multi-agent Path Finding", AIJ 2022) lets a robot that has waited longest push others out
of its way, each pushed one pushing on. Here, as in its causal variant (Okumura et al., "Time-
Independent Planning for Multiple Moving Agents", AAAI 2021), a node is entered only after it was
given up: a robot owns every node that its body can touch, from the one it leaves to the end of the
way it was promised, and no node has two owners. That is the whole safety argument; what is decided
here only moves ownership, and a robot that obeys drives only where it owns.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from sim.navigation.distance_field import DistanceField
from sim.navigation.floor import Floor
from sim.navigation.gates import Areas, Gate, gate_of
from sim.navigation.lattice import Lattice
from sim.navigation.spots import Dock

BRAKES_M = 0.3
"""Farther than any robot goes on while it brakes: 0.25 m at 0.6 m/s."""


@dataclass
class Traveller:
    """One robot as traffic sees it.

    `track` are the nodes from the last one reached to the end of what is promised; `corners[k]`
    what the step from `track[k]` to `track[k + 1]` cuts. `parked` is the stance it is at, leaves or
    enters; `goal` the node it wants to be at, `dock` the stance it wants to enter from there. A
    `static` one stays where it is, whoever asks. `floor` is where it may drive.
    """

    name: str
    radius_m: float
    floor: Floor
    track: list[int] = field(default_factory=list)
    corners: list[tuple[int, ...]] = field(default_factory=list)
    parked: Dock | None = None
    leaving: bool = False
    goal: int | None = None
    dock: Dock | None = None
    since_s: float = 0.0
    static: bool = False
    claims: frozenset[int] = frozenset()

    @property
    def frontier(self) -> int:
        """The last node promised to it."""
        return self.track[-1]

    def give_up(self, at_m: Sequence[float], points_m: Sequence[Sequence[float]]) -> None:
        """Keep no more of its way than it needs to come to rest on, from where it is."""
        kept = 2
        while (
            kept < len(self.track)
            and math.dist(at_m[:2], points_m[self.track[kept - 1]]) < BRAKES_M
        ):
            kept += 1
        del self.track[kept:], self.corners[kept - 1 :]

    def recount(self) -> None:
        """Bring `claims` up to date after a change."""
        owned = set(self.track)
        for corner in self.corners:
            owned.update(corner)
        if self.parked is not None:
            owned |= self.parked.owned
        self.claims = frozenset(owned)


class Traffic:
    """Decides, for all robots together, who may drive on to which node."""

    def __init__(
        self, lattice: Lattice, retreat: DistanceField, doors: Sequence[Gate] = ()
    ) -> None:
        self._lattice, self._retreat = lattice, retreat
        self._ways: dict[str, DistanceField] = {}
        """By robot, the distances to where it wants to be."""
        self._doors = tuple(doors)
        self._areas = Areas(lattice, self._doors)
        self._closures: tuple[Gate, ...] = ()
        self._index_gates()

    def close(self, alone: Sequence[frozenset[int]]) -> None:
        """From now on robots have other floors, and into each of the sets of nodes `alone` one
        robot is let in at a time."""
        self._ways.clear()
        self._closures = tuple(gate_of(self._lattice, nodes, alone=True) for nodes in alone)
        self._index_gates()

    def _index_gates(self) -> None:
        self._gates = (*self._closures, *self._doors)
        self._gates_at: dict[int, list[Gate]] = {}
        for gate in self._gates:
            for node in gate.nodes:
                self._gates_at.setdefault(node, []).append(gate)

    def decide(self, robots: dict[str, Traveller], lookahead: int) -> None:
        """Give robots the next nodes they may enter, `lookahead` ahead of where each is.

        Changes the `track` of those who got one, and `parked` of those who may enter or must leave
        their stance.
        """
        self._lookahead = lookahead
        self._owners: dict[int, list[Traveller]] = {}
        for robot in robots.values():
            for node in robot.claims:
                self._owners.setdefault(node, []).append(robot)
        self._reserved: dict[int, str] = {}
        self._decided: dict[str, int] = {}
        self._stack: list[str] = []
        static = [r for r in robots.values() if r.static]
        self._blocked = frozenset().union(*(r.claims for r in static)) if static else frozenset()
        for gate in self._gates:
            gate.next_round()
        self._areas.count((r.frontier, r.goal) for r in robots.values())
        for robot in static:
            self._decided[robot.name] = robot.frontier
        order = sorted(robots.values(), key=self._rank)
        for robot in order:
            if robot.name not in self._decided:
                self._decide(robot, None)

    def _rank(self, robot: Traveller) -> tuple[object, ...]:
        """Who decides first: whoever is in a bottleneck, and then who is just out of one, so that
        those who wait to be let in make way for it."""
        inside = came_out = False
        for gate in self._gates:
            if not gate.nodes.isdisjoint(robot.claims):
                inside = True
                gate.came_from.setdefault(robot.name, None)
            elif robot.name in gate.came_from:
                if gate.apron.isdisjoint(robot.claims) or robot.goal is None:
                    del gate.came_from[robot.name]
                else:
                    came_out = True
        return not inside, not came_out, robot.goal is None, robot.since_s, robot.name

    def _decide(self, robot: Traveller, parent: Traveller | None) -> bool:
        """One robot's next node; `parent` wants the one where it will be."""
        self._stack.append(robot.name)
        try:
            here = robot.frontier
            if robot.parked is not None and robot.goal is not None:
                robot.leaving = True
            if parent is None and robot.goal == here and robot.dock is not None:
                return self._enter_dock(robot)
            distance = self._distance(robot)
            if parent is None and self._slant(robot, distance):
                return True
            options = [
                (distance[node], self._held(node, robot), node != here, node)
                for node in (*robot.floor.neighbours[here], here)
            ]
            options.sort()
            for _, _, _, node in options:
                if node in self._reserved and self._reserved[node] != robot.name:
                    continue
                if parent is not None and node in parent.claims:
                    continue
                if self._has_to_wait(robot, node) or (
                    parent is not None and node != options[0][3] and self._is_entered(robot, node)
                ):
                    continue
                if node == here:
                    self._reserved[here] = robot.name
                    self._decided[robot.name] = here
                    return True
                if self._obtain(robot, node, wished=parent is None):
                    return True
            self._reserved.setdefault(here, robot.name)
            self._decided[robot.name] = here
            return False
        finally:
            self._stack.pop()

    def _distance(self, robot: Traveller) -> DistanceField:
        if robot.goal is None:
            for gate in self._closures:
                if gate.awaited and not gate.nodes.isdisjoint(robot.claims):
                    outside = frozenset(range(len(self._lattice))) - gate.nodes
                    return self._lattice.field(outside)
            return self._retreat
        goals = frozenset({robot.goal})
        blocked = self._blocked
        if not blocked.isdisjoint(robot.claims):
            blocked -= robot.claims
        around = self._ways.get(robot.name)
        if around is None or around.goals != goals or not around.holds_with(blocked):
            around = self._ways[robot.name] = robot.floor.new_field_to(goals, blocked)
        if math.isfinite(around[robot.frontier]):
            return around
        # No way round: go up to who stands there, and wait.
        return robot.floor.field_to(goals, frozenset())

    def _held(self, node: int, robot: Traveller) -> bool:
        owners = self._owners.get(node)
        return owners is not None and (len(owners) > 1 or owners[0] is not robot)

    def _is_entered(self, robot: Traveller, node: int) -> bool:
        """Whether a robot would get into a bottleneck there."""
        return any(g.nodes.isdisjoint(robot.claims) for g in self._gates_at.get(node, ()))

    def _has_to_wait(self, robot: Traveller, *nodes: int) -> bool:
        """Whether some of the nodes are of a bottleneck that does not let the robot in now."""
        for node in nodes:
            for gate in self._gates_at.get(node, ()):
                if not gate.nodes.isdisjoint(robot.claims):
                    continue
                owners = {o.name for n in gate.nodes for o in self._owners.get(n, ())}
                if not gate.lets_in(robot.frontier, owners - {robot.name}):
                    if robot.goal is not None:
                        gate.waiting.add(gate.sides.get(robot.frontier))
                    return True
                if not gate.alone and self._areas.is_full(gate, robot.frontier, robot.goal):
                    return True
        return False

    def _obtain(self, robot: Traveller, node: int, *, wished: bool) -> bool:
        """Take `node`, or see to it that it will become free."""
        others = [owner for owner in self._owners.get(node, ()) if owner is not robot]
        before = self._reserved.get(node)
        self._reserved[node] = robot.name
        for other in others:
            if not self._will_leave(other, node, robot):
                if before is None:
                    # Backtracking: who could not leave has reserved what it stands on.
                    self._reserved[node] = other.name
                return False
        self._decided[robot.name] = node
        if robot.parked is not None:
            robot.leaving = True  # first back to its node on the lattice
        elif not others and (len(robot.track) == 1 or (wished and self._may_promise(robot, node))):
            self._extend(robot, node, ())
        return True

    def _may_promise(self, robot: Traveller, node: int) -> bool:
        """Ahead of where it is, a robot is promised what it wishes for, not what it is pushed to.

        It may no longer be pushed when it gets there; promised early, it would go to and fro.
        """
        if node in robot.claims:
            return False
        if self._is_entered(robot, node):
            return len(robot.track) <= 2  # others may be through before
        return len(robot.track) <= self._lookahead

    def _will_leave(self, other: Traveller, node: int, robot: Traveller) -> bool:
        if other.static:
            return False
        if node != other.frontier:
            # It is passing: what it was promised it can always drive to the end. Or it stands
            # beside the lattice, and keeps the node away from others until it is back on it.
            other.leaving = other.parked is not None
            return True
        if other.name in self._stack:
            return False
        if other.name in self._decided:
            return self._decided[other.name] != other.frontier
        return self._decide(other, robot)

    def _slant(self, robot: Traveller, distance: DistanceField) -> bool:
        """A step across a square, if that is shorter and all of the square is free."""
        here = robot.frontier
        if robot.parked is not None or robot.goal is None or len(robot.track) > self._lookahead:
            return False
        straight = min((distance[v] for v in robot.floor.neighbours[here]), default=math.inf)
        diagonals = robot.floor.diagonals[here]
        best = min(diagonals, key=lambda w: (distance[w], w), default=None)
        if best is None or not distance[best] < straight - 1e-6:
            return False
        square = (best, *diagonals[best])
        if self._has_to_wait(robot, *square):
            return False
        if any(
            self._held(v, robot) or self._reserved.get(v, robot.name) != robot.name for v in square
        ):
            return False
        for node in square:
            self._reserved[node] = robot.name
        self._decided[robot.name] = best
        self._extend(robot, best, square[1:])
        return True

    def _enter_dock(self, robot: Traveller) -> bool:
        """All of the nodes that the way to the stance touches, or none."""
        assert robot.dock is not None
        self._reserved[robot.frontier] = robot.name
        self._decided[robot.name] = robot.frontier
        wanted = sorted(robot.dock.owned - robot.claims)
        free = not self._has_to_wait(robot, *wanted)
        for node in wanted:
            holder = self._reserved.setdefault(node, robot.name)
            free &= holder == robot.name and not self._held(node, robot)
        for node in wanted:
            for other in self._owners.get(node, ()):
                if other is not robot:
                    self._will_leave(other, node, robot)
        if free and robot.parked is None and len(robot.track) == 1:
            robot.parked, robot.dock, robot.goal = robot.dock, None, None
            robot.static = True
            robot.recount()
            self._own(robot)
        return True

    def _extend(self, robot: Traveller, node: int, corners: tuple[int, ...]) -> None:
        for entered in (node, *corners):
            for gate in self._gates_at.get(entered, ()):
                if gate.nodes.isdisjoint(robot.claims):
                    gate.entered(robot.name, robot.frontier)
                    if not gate.alone:
                        self._areas.entered(gate, robot.frontier, robot.goal)
        robot.track.append(node)
        robot.corners.append(corners)
        robot.recount()
        self._own(robot)

    def _own(self, robot: Traveller) -> None:
        for node in robot.claims:
            owners = self._owners.setdefault(node, [])
            if robot not in owners:
                owners.append(robot)
