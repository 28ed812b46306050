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

from sim.navigation.admission import Admission
from sim.navigation.distance_field import DistanceField
from sim.navigation.gates import Areas, Gate, gate_of
from sim.navigation.lattice import Lattice
from sim.navigation.traveller import Traveller

AGED_S, AGED_EACH_S = 45.0, 1.8
"""In a crowd those go first that have least far to go, which empties the ways; who is on its way
for longer than this, or than this for each robot, goes before them, whoever has waited longest
first. The more robots, the longer all trips are: were most of them aged, none would go before."""

WAIT_M = 0.1
"""A way that is so much longer is taken rather than to stand and wait."""


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
        self._admission = Admission(self._areas)
        self._closures: tuple[Gate, ...] = ()
        self._near: dict[str, set[Gate]] = {}
        """By robot, the bottlenecks that it is in, or just out of."""
        self._index_gates()

    def close(self, alone: Sequence[frozenset[int]]) -> None:
        """From now on robots have other floors, and into each of the sets of nodes `alone` one
        robot is let in at a time."""
        self._ways.clear()
        self._admission.forget_ways()
        self._closures = tuple(gate_of(self._lattice, nodes, alone=True) for nodes in alone)
        self._index_gates()

    def _index_gates(self) -> None:
        self._gates = (*self._closures, *self._doors)
        self._gates_at: dict[int, list[Gate]] = {}
        for gate in self._gates:
            for node in gate.nodes:
                self._gates_at.setdefault(node, []).append(gate)

    def decide(self, time_s: float, robots: dict[str, Traveller], lookahead: int) -> None:
        """Give robots the next nodes they may enter, up to `lookahead` ahead of where each is.

        Changes the `track` of those who got one, and `parked` of those who may enter or must leave
        their stance.
        """
        self._time_s, self._lookahead = time_s, lookahead
        self._aged_s = max(AGED_S, AGED_EACH_S * len(robots))
        self._owners: dict[int, list[Traveller]] = {}
        for robot in robots.values():
            for node in robot.claims:
                self._owners.setdefault(node, []).append(robot)
        self._reserved: dict[int, str] = {}
        self._decided: dict[str, int] = {}
        self._cleared: dict[str, dict[int, int]] = {}
        """By robot, the nodes that it wants all of, and in how many steps one is out of them."""
        self._stack: list[str] = []
        static = [r for r in robots.values() if r.static]
        self._blocked = frozenset().union(*(r.claims for r in static)) if static else frozenset()
        for gate in self._gates:
            gate.next_round()
        self._areas.count((r.frontier, r.goal) for r in robots.values())
        for robot in static:
            self._decided[robot.name] = robot.frontier
        self._admission.decide(robots.values())
        for robot in static:
            if robot.wanted:
                self._clear(robot, sorted(robot.wanted - robot.claims))
        order = sorted(robots.values(), key=self._rank)
        for robot in order:
            if robot.name not in self._decided:
                self._decide(robot, None)

    def _rank(self, robot: Traveller) -> tuple[object, ...]:
        """Who decides first: whoever is in a bottleneck, and then who is just out of one, so that
        those who wait to be let in make way for it."""
        inside = {gate for node in robot.claims for gate in self._gates_at.get(node, ())}
        for gate in inside:
            gate.came_from.setdefault(robot.name, None)
        came_out = set()
        for gate in self._near.get(robot.name, set()) - inside:
            if gate.apron.isdisjoint(robot.claims) or robot.goal is None:
                gate.came_from.pop(robot.name, None)
            else:
                came_out.add(gate)
        self._near[robot.name] = inside | came_out
        return not inside, not came_out, not self._is_going(robot), *self._turn(robot), robot.name

    def _turn(self, robot: Traveller) -> tuple[float, float]:
        young = self._time_s - robot.since_s <= self._aged_s
        if robot.floor.lanes and young and self._is_going(robot):
            return 1.0, self._distance(robot)[robot.frontier]
        return 0.0, robot.since_s

    def _is_going(self, robot: Traveller) -> bool:
        """Whether it wants to get somewhere, and need not wait where it is."""
        return robot.goal is not None and robot.name not in self._admission.held

    def _decide(self, robot: Traveller, parent: Traveller | None) -> bool:
        """One robot's next node; `parent` wants the one where it will be."""
        self._stack.append(robot.name)
        try:
            here = robot.frontier
            if robot.parked is not None and self._is_going(robot):
                robot.leaving = True
            if parent is None and robot.goal == here and robot.dock is not None:
                return self._enter_dock(robot)
            distance = self._distance(robot)
            if parent is None and self._slant(robot, distance):
                return True
            options = self._options(robot, distance, pushed=parent is not None)
            cleared = self._cleared.get(parent.name, {}) if parent is not None else {}
            if cleared:
                # Out of what shall be free, over other nodes of it if it must be.
                options.sort(key=lambda option: cleared.get(option[3], 0))
            for _, _, _, node in options:
                if self._reserved.get(node, robot.name) != robot.name and (
                    node == here or node not in cleared
                ):
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

    def _options(
        self, robot: Traveller, distance: DistanceField, *, pushed: bool
    ) -> list[tuple[float, bool, bool, int]]:
        """The nodes that may be next, the best first, with what tells them apart.

        In a crowd nobody makes a detour, against a lane say, who is not pushed.
        """
        here = robot.frontier
        around = robot.floor.neighbours[here]
        if not (robot.floor.lanes and self._is_going(robot)):
            lengths = [(distance[node], node) for node in (*around, here)]
        else:
            costs = robot.floor.costs[here]
            wait = distance[here] + WAIT_M
            lengths = [(costs[node] + distance[node], node) for node in around]
            if not pushed:
                lengths = [(length, node) for length, node in lengths if length < wait]
            lengths.append((wait, here))
        return sorted((m, self._held(node, robot), node != here, node) for m, node in lengths)

    def _distance(self, robot: Traveller) -> DistanceField:
        if not self._is_going(robot):
            for gate in self._closures:
                if gate.awaited and not gate.nodes.isdisjoint(robot.claims):
                    outside = frozenset(range(len(self._lattice))) - gate.nodes
                    return self._lattice.field(outside)
            return self._retreat
        assert robot.goal is not None
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
                if gate.alone:
                    continue
                full = self._areas.full_beyond(gate, robot.frontier, robot.goal)
                if full is not None and not self._admission.has_place(robot.name, full):
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
        return robot.ahead_m <= robot.horizon_m and len(robot.track) <= self._lookahead

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
        if robot.parked is not None or not self._is_going(robot):
            return False
        if robot.ahead_m > robot.horizon_m or len(robot.track) > self._lookahead:
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
        may = not self._has_to_wait(robot, *wanted)
        free = self._clear(robot, wanted) and may
        if free and robot.parked is None and len(robot.track) == 1:
            robot.parked, robot.dock, robot.goal = robot.dock, None, None
            robot.static = True
            robot.recount()
            self._own(robot)
        return True

    def _clear(self, robot: Traveller, wanted: Sequence[int]) -> bool:
        """Let nobody else into nodes, and ask whoever is there to leave; whether nobody is."""
        free = True
        for node in wanted:
            holder = self._reserved.setdefault(node, robot.name)
            free &= holder == robot.name and not self._held(node, robot)
        self._cleared[robot.name] = self._steps_out(frozenset(wanted), robot.claims)
        for node in wanted:
            for other in self._owners.get(node, ()):
                if other is not robot:
                    self._will_leave(other, node, robot)
        return free

    def _steps_out(self, nodes: frozenset[int], barred: frozenset[int]) -> dict[int, int]:
        """In how many steps one is out of some nodes from each of them, not by way of `barred`."""
        around = self._lattice.neighbours
        edge = {n for n in nodes if any(v not in nodes and v not in barred for v in around[n])}
        steps: dict[int, int] = {}
        while edge:
            steps |= dict.fromkeys(edge, 1 + max(steps.values(), default=0))
            edge = {v for n in edge for v in around[n] if v in nodes and v not in steps}
        return dict.fromkeys(nodes, len(nodes) + 1) | steps

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
