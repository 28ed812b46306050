"""Facts of a task, and what is read off them, numbered: the nodes of its states and heuristics.

A *fact* is a variable with a value. A *reading* is a condition on several variables; `Axiom`s say
which nodes make it hold, other readings among them: a fork in a bowl is in the kitchen if that is.
A *ride* is that a thing is with a robot and not in its hand.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from fleet.core.model.formulas.evaluation import evaluate
from fleet.core.model.formulas.nodes import Formula
from fleet.core.model.world import WorldModel, known_value
from fleet.planners.symbolic.engine.instantiation import Facts
from fleet.planners.symbolic.engine.readings import ValueOf
from fleet.planners.symbolic.engine.travel import Travel
from keyexpr_schema.facts import AT, FactKey, Value

State = tuple[int, ...]
Stands = tuple[tuple[str, str], ...]
"""Robots, each with the place where it must be."""


@dataclass(frozen=True, slots=True)
class Axiom:
    """Facts, rides and readings that make a reading hold where these robots stand."""

    needs: tuple[int, ...]
    stands: Stands
    reading: int


@dataclass(frozen=True, slots=True)
class Ride:
    """That a thing is with a robot and not in its hand: a node, and the facts that decide it."""

    node: int
    at_robot: int
    in_hand: int


@dataclass(frozen=True, slots=True)
class Opaque:
    """A formula that is only evaluated: its node, and the variables that it may be decided by."""

    node: int
    formula: Formula
    variables: frozenset[FactKey]
    aboard: bool


class Nodes:
    """The nodes of a task over some variables; first come robots that can drive, `position`.

    `counted` are variables with numbers that actions add to, so that nobody knows their values
    beforehand.
    """

    def __init__(
        self,
        world: WorldModel,
        start: Facts,
        free: Sequence[str],
        changed: Iterable[FactKey],
        counted: Iterable[FactKey],
        travel: Travel,
    ) -> None:
        self.world = world
        self.start = start
        self.travel = travel
        positions = [FactKey(AT, robot) for robot in free]
        self.variables = [*positions, *sorted(set(changed) - set(positions))]
        self.position = {robot: v for v, robot in enumerate(free)}
        self.number = {variable: v for v, variable in enumerate(self.variables)}
        self.variable_of: list[int] = []
        """By node: the number of its variable; -1 for what is no fact."""
        self.value_of: list[Value] = []
        self.axioms: dict[int, list[Axiom]] = {}
        self.rides: dict[int, Ride] = {}
        self.opaque: dict[int, Opaque] = {}
        self.quorums: dict[int, Sequence[tuple[tuple[int, ...], int]]] = {}
        """Of an opaque formula: nodes, each time with how many of them must hold for it to hold."""
        self.counted = frozenset(counted)
        self._facts: dict[tuple[int, Value], int] = {}
        self.values_of: list[list[Value]] = [[] for _ in self.variables]
        self.initial: State = tuple(
            self.fact(v, self._initial(variable)) for v, variable in enumerate(self.variables)
        )

    def __len__(self) -> int:
        return len(self.variable_of)

    def fact(self, variable: int, value: Value) -> int:
        """The node of a fact."""
        key = variable, value
        if key not in self._facts:
            self._facts[key] = self.new(variable, value)
            self.values_of[variable].append(value)
        return self._facts[key]

    def known(self, key: FactKey) -> Value:
        """The value of a variable at the start."""
        return known_value(key, self.start, self.world)

    def values(self, state: State) -> ValueOf:
        """The values that variables have in a state."""

        def value_of(key: FactKey) -> Value:
            v = self.number.get(key)
            return self.known(key) if v is None else self.value_of[state[v]]

        return value_of

    def _initial(self, variable: FactKey) -> Value:
        if variable.relation == AT and variable.subject in self.position:
            return self.start.get(variable)
        return self.known(variable)

    def new(self, variable: int = -1, value: Value = None) -> int:
        """One more node; of a fact with its variable and value."""
        self.variable_of.append(variable)
        self.value_of.append(value)
        return len(self.variable_of) - 1

    # What holds in a state.

    def true_nodes(self, state: State) -> list[int]:
        """The facts, rides and opaque formulas that hold in a state; readings follow from them."""
        found = list(state)
        found += [ride.node for ride in self.rides.values() if self._rides(ride, state)]
        if self.opaque:
            value_of = self.values(state)
            found += [
                node
                for node, opaque in self.opaque.items()
                if evaluate(opaque.formula, value_of, self.world, aboard=opaque.aboard)
            ]
        return found

    def _rides(self, ride: Ride, state: State) -> bool:
        at = state[self.variable_of[ride.at_robot]] == ride.at_robot
        return at and state[self.variable_of[ride.in_hand]] != ride.in_hand

    def stands_for(
        self, node: int, state: State, above: frozenset[int] = frozenset()
    ) -> Sequence[Stands]:
        """Where robots have to be for a node to hold in a state; none of them if it does not hold
        wherever they are. It does not hold by itself, nor by what is `above` it.
        """
        variable = self.variable_of[node]
        if variable >= 0:
            return ((),) if state[variable] == node else ()
        axioms = self.axioms.get(node)
        if axioms is not None:
            found: list[Stands] = []
            for axiom in axioms:
                options: list[Stands] = [axiom.stands]
                for need in axiom.needs:
                    if need in above or need == node:
                        options = []
                    elif options:
                        needed = self.stands_for(need, state, above | {node})
                        both = (merged((one, other)) for one in options for other in needed)
                        options = [stands for stands in both if stands is not None]
                found += options
            return found
        opaque = self.opaque.get(node)
        if opaque is not None:
            read = self.values(state)
            holds = evaluate(opaque.formula, read, self.world, aboard=opaque.aboard)
            return ((),) if holds else ()
        ride = self.rides.get(node)
        return ((),) if ride is not None and self._rides(ride, state) else ()


def merged(parts: Sequence[Stands]) -> Stands | None:
    """All of them at once; `None` if a robot would have to be in two places."""
    stands: dict[str, str] = {}
    for part in parts:
        for robot, place in part:
            if stands.setdefault(robot, place) != place:
                return None
    return tuple(stands.items())
