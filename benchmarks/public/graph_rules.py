"""COHERENT's rules: which steps each robot may take in a graph, and what the graph is after one.

Written from what the set's own programs offer a robot and do to the graph
(`src/experiment/*/LLM.py`, `LLM_agent.py` and `get_env_info.py` there); it knows nothing of this
project's planner. One step is one action of one robot. A *quadrotor* takes off, flies to another
surface in its room or through an open door, and lands where things can land; what is in its basket
comes along. A *robot dog* goes through open doors, and up to things that are not high; it handles
what it is close to. A *robot arm* handles what is on its own surface, however indirectly. Hands
hold one thing, and open and close only while they are empty. A robot knows of what is in its room
and not in something closed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from benchmarks.public.errors import IllegalStep
from benchmarks.public.scene_graph import (
    ABOVE,
    AGENTS,
    CLOSE,
    CLOSED,
    CONTAINERS,
    DOOR,
    FLOOR,
    FLYING,
    GRABABLE,
    HIGH_HEIGHT,
    HOLD,
    INSIDE,
    LAND,
    LANDABLE,
    LEADING_TO,
    LOW_HEIGHT,
    ON,
    ON_HIGH_SURFACE,
    OPEN,
    OPEN_FOREVER,
    QUADROTOR,
    ROBOT_ARM,
    ROBOT_DOG,
    ROOMS,
    SURFACES,
    WITH,
    Edge,
    Node,
    Task,
)

LAND_ON, TAKE_OFF, MOVE, OPENS, CLOSES, GRAB, PUT_INTO, PUT_ON = (
    "land_on",
    "takeoff_from",
    "movetowards",
    "open",
    "close",
    "grab",
    "putinto",
    "puton",
)


@dataclass(frozen=True)
class Step:
    """One action of one robot; `onto` is where the thing in its hand is put."""

    robot: int
    action: str
    thing: int
    onto: int | None = None

    def __str__(self) -> str:
        onto = "" if self.onto is None else f", {self.onto}"
        return f"{self.robot}: {self.action}({self.thing}{onto})"


@dataclass(frozen=True)
class Situation:
    """The graph at one moment: its nodes as they were at first, and what changes.

    `high` are things that the dog cannot reach; `states` are those of what opens and of quadrotors.
    """

    nodes: dict[int, Node]
    edges: frozenset[Edge]
    high: frozenset[int]
    states: frozenset[tuple[int, str]]

    @classmethod
    def first(cls, task: Task) -> Situation:
        """How a task begins."""
        nodes = task.nodes
        return cls(
            nodes,
            frozenset(task.edges),
            frozenset(n.id for n in nodes.values() if ON_HIGH_SURFACE in n.properties),
            frozenset((n.id, state) for n in nodes.values() for state in n.states),
        )

    def holds(self, goal: Iterable[Edge]) -> bool:
        """Whether the relations that are wanted are there."""
        return self.edges.issuperset(goal)

    def never(self, goal: Iterable[Edge]) -> str:
        """Why by these rules no steps ever lead to what is wanted; empty if they may."""
        for edge in set(goal) - self.edges:
            node, where = self.nodes[edge.of], self.nodes[edge.to]
            into = CONTAINERS if edge.relation == INSIDE else SURFACES
            if node.category != AGENTS and GRABABLE not in node.properties:
                return f"by the set's own rules nobody takes {node}: it is not {GRABABLE}"
            if node.category != AGENTS and into not in where.properties:
                return f"by the set's own rules nothing is put there: {where} is not {into}"
        return ""

    def has(self, node: int, word: str) -> bool:
        """Whether a node has a property."""
        return word in self.nodes[node].properties

    def of(self, node: int, *relations: str) -> list[int]:
        """What a node has one of these relations to."""
        return sorted(e.to for e in self.edges if e.of == node and e.relation in relations)

    def to(self, node: int, *relations: str) -> list[int]:
        """What has one of these relations to a node."""
        return sorted(e.of for e in self.edges if e.to == node and e.relation in relations)

    def is_in_state(self, node: int, *states: str) -> bool:
        """Whether a node is in one of these states."""
        return any((node, state) in self.states for state in states)

    def room(self, robot: int) -> int:
        """The room where a robot is."""
        return next(r for r in self.of(robot, INSIDE) if self.nodes[r].category == ROOMS)

    def visible(self, robot: int) -> frozenset[int]:
        """What a robot knows of: all in its room, and its doors, but for what is in something
        closed; what it holds; the basket of a quadrotor in its room, even in the air."""
        room = self.room(robot)
        seen = self._within(room)
        closed = {
            e.of
            for e in self.edges
            if e.relation == INSIDE
            and self.nodes[e.to].category != ROOMS
            and not self.is_in_state(e.to, OPEN, OPEN_FOREVER)
        }
        seen = (seen - closed) | {room, robot, *self.to(room, LEADING_TO), *self.of(robot, HOLD)}
        for edge in self.edges:
            if edge.relation == WITH and self.room(edge.of) == room:
                seen |= {edge.of, edge.to, *self.to(edge.to, INSIDE)}
        return frozenset(seen)

    def _within(self, room: int) -> set[int]:
        found: set[int] = set()
        new = {room}
        while new:
            new = {e.of for e in self.edges if e.to in new and e.relation in (ON, INSIDE)} - found
            found |= new
        return found

    def next_rooms(self, robot: int) -> list[int]:
        """Where open doors lead from a robot's room."""
        room = self.room(robot)
        doors = [d for d in self.to(room, LEADING_TO) if self.is_in_state(d, OPEN, OPEN_FOREVER)]
        return sorted({r for door in doors for r in self.of(door, LEADING_TO)} - {room})

    def steps(self) -> Iterator[Step]:
        """All steps that some robot may take."""
        for node in self.nodes.values():
            if node.category == AGENTS:
                yield from self.steps_of(node.id)

    def steps_of(self, robot: int) -> Iterator[Step]:
        """All steps that a robot may take."""
        kind = self.nodes[robot].class_name.replace("_", " ")
        if kind == QUADROTOR:
            yield from self._flights(robot)
        elif kind == ROBOT_DOG:
            yield from self._ways(robot)
            close = set(self.of(robot, CLOSE)) & self.visible(robot)
            yield from self._handling(robot, close, doors=True)
        elif kind == ROBOT_ARM:
            surface = self.of(robot, ON)[0]
            reach = (self._within(surface) & self.visible(robot)) - {robot}
            for held in self.of(robot, HOLD):
                yield Step(robot, PUT_ON, held, surface)
            yield from self._handling(robot, reach, doors=False)

    def _flights(self, robot: int) -> Iterator[Step]:
        seen = self.visible(robot)
        if self.is_in_state(robot, LAND):
            for surface in self.of(robot, ON):
                yield Step(robot, TAKE_OFF, surface)
        if not self.is_in_state(robot, FLYING):
            return
        below = [s for s in self.of(robot, ABOVE) if self.has(s, LANDABLE) and s in seen]
        for surface in below:
            yield Step(robot, LAND_ON, surface)
        if below:
            for surface in sorted(seen - set(below)):
                if self.has(surface, LANDABLE):
                    yield Step(robot, MOVE, surface)
        for room in self.next_rooms(robot):
            yield Step(robot, MOVE, room)

    def _ways(self, robot: int) -> Iterator[Step]:
        there = {*self.of(robot, CLOSE), *self.of(robot, HOLD)}
        for thing in sorted(self.visible(robot) - there - self.high):
            node = self.nodes[thing]
            if node.category not in (ROOMS, AGENTS, FLOOR) and HIGH_HEIGHT not in node.properties:
                yield Step(robot, MOVE, thing)
        for room in self.next_rooms(robot):
            yield Step(robot, MOVE, room)

    def _handling(self, robot: int, reach: Iterable[int], *, doors: bool) -> Iterator[Step]:
        held = self.of(robot, HOLD)
        for thing in sorted(reach):
            contains = self.has(thing, CONTAINERS)
            if held:
                if contains and self.is_in_state(thing, OPEN, OPEN_FOREVER):
                    yield Step(robot, PUT_INTO, held[0], thing)
                if self.has(thing, SURFACES):
                    yield Step(robot, PUT_ON, held[0], thing)
                continue
            if contains or (doors and self.nodes[thing].class_name == DOOR):
                if self.is_in_state(thing, CLOSED):
                    yield Step(robot, OPENS, thing)
                if self.is_in_state(thing, OPEN):
                    yield Step(robot, CLOSES, thing)
            if self.has(thing, GRABABLE):
                yield Step(robot, GRAB, thing)

    def after(self, step: Step) -> Situation:
        """The graph once a step is taken.

        Raises:
            IllegalStep: the robot may not take it now.
        """
        if step not in set(self.steps_of(step.robot)):
            raise IllegalStep(f"{self.nodes[step.robot]} may not {step} now")
        kind = self.nodes[step.robot].class_name.replace("_", " ")
        if step.action in (OPENS, CLOSES):
            state = OPEN if step.action == OPENS else CLOSED
            kept = {row for row in self.states if row[0] != step.thing}
            return replace(self, states=frozenset(kept | {(step.thing, state)}))
        if step.action == GRAB:
            lost = {e for e in self.edges if e.of == step.thing and e.relation in (ON, INSIDE)}
            lost.add(Edge(step.robot, CLOSE, step.thing))
            return self._changed(lost, {Edge(step.robot, HOLD, step.thing)})
        if step.action in (PUT_INTO, PUT_ON):
            return self._put(step, kind)
        if kind == ROBOT_DOG:
            return self._gone(step)
        return self._flown(step)

    def _changed(self, lost: Iterable[Edge], new: Iterable[Edge]) -> Situation:
        return replace(self, edges=(self.edges - frozenset(lost)) | frozenset(new))

    def _put(self, step: Step, kind: str) -> Situation:
        assert step.onto is not None
        relation = INSIDE if step.action == PUT_INTO else ON
        new = {Edge(step.thing, relation, step.onto)}
        if kind == ROBOT_DOG:
            new.add(Edge(step.robot, CLOSE, step.thing))
        made = self._changed({Edge(step.robot, HOLD, step.thing)}, new)
        return made if kind == ROBOT_DOG else replace(made, high=self.high | {step.thing})

    def _gone(self, step: Step) -> Situation:
        robot, thing = step.robot, step.thing
        lost = {e for e in self.edges if e.of == robot and e.relation == CLOSE}
        if self.nodes[thing].category == ROOMS:
            lost |= {e for e in self.edges if e.of == robot and e.relation in (INSIDE, ON)}
            return self._changed(lost, {Edge(robot, INSIDE, thing), self._on_floor(robot, thing)})
        close = {thing}
        if self.has(thing, CONTAINERS) and self.is_in_state(thing, OPEN, OPEN_FOREVER):
            close |= set(self.to(thing, INSIDE))
        close |= {c for c in self.of(thing, ON, INSIDE) if self.nodes[c].category != FLOOR}
        if self.has(thing, SURFACES):
            close |= set(self.to(thing, ON))
        return self._changed(lost, {Edge(robot, CLOSE, one) for one in close})

    def _on_floor(self, robot: int, room: int, relation: str = ON) -> Edge:
        floors = [f for f in self.to(room, INSIDE) if self.nodes[f].category == FLOOR]
        return Edge(robot, relation, floors[-1])

    def _flown(self, step: Step) -> Situation:
        robot, where = step.robot, step.thing
        above = {Edge(robot, ABOVE, s) for s in self.of(robot, ABOVE)}
        (basket,) = self.of(robot, WITH)
        aboard = {basket, *self.to(basket, INSIDE)}
        states = self.states - {(robot, LAND), (robot, FLYING)}
        if step.action == MOVE:
            if self.nodes[where].category != ROOMS:
                return self._changed(above, {Edge(robot, ABOVE, where)})
            above.add(Edge(robot, INSIDE, self.room(robot)))
            new = {Edge(robot, INSIDE, where), self._on_floor(robot, where, ABOVE)}
            return self._changed(above, new)
        if step.action == TAKE_OFF:
            lost = {e for e in self.edges if e.relation == CLOSE and e.to in aboard}
            lost |= {Edge(robot, ON, where), Edge(basket, ON, where)}
            made = self._changed(lost, {Edge(robot, ABOVE, where)})
            return replace(made, high=self.high | aboard, states=states | {(robot, FLYING)})
        made = self._changed(above, {Edge(robot, ON, where), Edge(basket, ON, where)})
        high = self.high
        if self.has(where, HIGH_HEIGHT):
            high |= aboard
        elif self.has(where, LOW_HEIGHT):
            high -= aboard
        return replace(made, high=high, states=states | {(robot, LAND)})
