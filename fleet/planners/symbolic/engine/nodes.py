"""Facts of a task, and what is read off them, numbered: the nodes of its states and heuristics.

A *fact* is a variable with a value. A *reading* is a condition on several variables; `Axiom`s say
which nodes make it hold, other readings among them: a fork in a bowl is in the kitchen if that is.
A *ride* is that a thing is with a robot and not in its hand. What has too
many ways to hold to list them is `Opaque`: only ever evaluated.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from fleet.core.model import derived
from fleet.core.model.formulas.evaluation import conjuncts, evaluate
from fleet.core.model.formulas.nodes import Formula, Holds, Not, Or
from fleet.core.model.world import WorldModel, known_value
from fleet.planners.symbolic.engine.instantiation import Facts
from fleet.planners.symbolic.engine.readings import (
    Assumed,
    TooManyWays,
    ValueOf,
    is_read_off,
    variables_read,
    ways,
)
from fleet.planners.symbolic.engine.travel import Travel
from keyexpr_schema.facts import AT, HOLDING, FactKey, Literal, Value

State = tuple[int, ...]
Stands = tuple[tuple[str, str], ...]
"""Robots, each with the place where it must be."""
FEW_VALUES = 4
"""That a variable has not a value is listed as those that it has then, if those are few."""
_ELSEWHERE = "?"
"""Any place, where it does not matter which."""


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
        self._counted = frozenset(counted)
        self._facts: dict[tuple[int, Value], int] = {}
        self._values: list[list[Value]] = [[] for _ in self.variables]
        self._readings: dict[object, int | bool] = {}
        self.initial: State = tuple(
            self.fact(v, self._initial(variable)) for v, variable in enumerate(self.variables)
        )

    def __len__(self) -> int:
        return len(self.variable_of)

    def fact(self, variable: int, value: Value) -> int:
        """The node of a fact."""
        key = variable, value
        if key not in self._facts:
            self._facts[key] = self._new(variable, value)
            self._values[variable].append(value)
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

    def literal(self, literal: Literal, *, aboard: bool, innermost: bool) -> int | bool:
        """The node of a literal; true or false where that never changes.

        `aboard`: as in a goal; `innermost`: only where a place is the first around.
        """
        if literal.variable.relation == AT and literal.variable.subject in self.position:
            # It can drive there: the place is no matter of the state.
            there: Assumed = {literal.variable: literal.value}
            if literal not in self._readings:
                self._readings[literal] = self._reading([(there, True), ({}, False)])
            return self._readings[literal]
        if not is_read_off(literal, self.world):
            v = self.number.get(literal.variable)
            if v is not None:
                return self.fact(v, literal.value)
            return derived.holds(literal, self.known, self.world, aboard=aboard)
        key = literal, aboard, innermost
        if key not in self._readings:
            try:
                self._readings[key] = self._read(literal, aboard, innermost)
            except TooManyWays:
                self._readings[key] = self._only_evaluated(Holds(literal), aboard)
        return self._readings[key]

    def formula(self, formula: Formula) -> int | bool:
        """The node of an `expanded` formula that is no conjunction."""
        match formula:
            case Holds(literal):
                return self.literal(literal, aboard=False, innermost=False)
            case Not(Holds(literal)) if (
                known := self.literal(literal, aboard=False, innermost=False)
            ) in (True, False) and isinstance(known, bool):
                return not known
        if formula not in self._readings:
            self._readings[formula] = self._read_formula(formula)
        return self._readings[formula]

    def _read(self, literal: Literal, aboard: bool, innermost: bool) -> int | bool:
        (relation, subject), wanted = literal
        if relation != AT or not isinstance(wanted, str):

            def read(value_of: ValueOf) -> bool:
                return derived.holds(literal, value_of, self.world, aboard=aboard)

            return self._reading(ways(read, self._domain_elsewhere, self.known))
        return self._at(subject, wanted, aboard, innermost and wanted in self.world.places)

    def _at(self, subject: str, wanted: str, aboard: bool, innermost: bool) -> int | bool:
        """The node for that `wanted` carries something, directly or not: its carrier does, or is
        what is wanted."""
        key = AT, subject, wanted, aboard, innermost
        if key in self._readings:
            return self._readings[key]
        if subject in self.position:
            found = self._at_by_driving(subject, wanted, innermost)
            self._readings[key] = self._reading(found)
            return self._readings[key]
        # What is in what may be a circle, so there is a node before it is known what it needs.
        self._readings[key] = node = self._new(-1, None)

        def read(value_of: ValueOf) -> str | bool:
            carrier = derived.carrier_of(subject, value_of, self.world)
            if carrier is None or carrier == wanted:
                return carrier is not None
            if innermost and carrier in self.world.places:
                return False
            carries = derived.carries_on(carrier, subject, value_of, self.world, aboard=aboard)
            return carrier if carries else False

        rows = [
            (
                assumed,
                self._at(there, wanted, aboard, innermost) if isinstance(there, str) else there,
            )
            for assumed, there in ways(read, self._domain, self.known)
        ]
        self._readings[key] = self._reading(rows, node)
        return self._readings[key]

    def _at_by_driving(
        self, robot: str, wanted: str, innermost: bool
    ) -> Iterator[tuple[Assumed, bool]]:
        """The places where a robot that can drive is then."""
        yield {}, False
        for place in self.world.places:
            around = () if innermost else derived.carriers(place, self.known, self.world)
            if wanted in (place, *around) and self.travel.action(robot, place) is not None:
                yield {FactKey(AT, robot): place}, True

    def _read_formula(self, formula: Formula) -> int | bool:
        match formula:
            case Or(rows):
                return self._any_of(rows)
            case Not(Holds(literal)) if not is_read_off(literal, self.world):
                if len(self._domain(literal.variable) or ()) > FEW_VALUES:
                    return self._only_evaluated(formula, aboard=False)

        def domain(key: FactKey) -> Sequence[Value] | None:
            if key in self._counted:
                raise TooManyWays
            return self._domain(key)

        def read(value_of: ValueOf) -> bool:
            return evaluate(formula, value_of, self.world)

        try:
            return self._reading(list(ways(read, domain, self.known)))
        except TooManyWays:
            return self._only_evaluated(formula, aboard=False)

    def _any_of(self, alternatives: Sequence[Formula]) -> int | bool:
        """The node of a disjunction: each alternative by itself makes it hold."""
        rows: dict[tuple[int, ...], None] = {}
        for alternative in alternatives:
            needs = {self.formula(part) for part in conjuncts(alternative)}
            if all(need is True for need in needs):
                return True
            if not any(need is False for need in needs):
                rows[tuple(sorted(need for need in needs if need is not True))] = None
        if not rows:
            return False
        node = self._new(-1, None)
        self.axioms[node] = [Axiom(needs, (), node) for needs in rows]
        return node

    def _only_evaluated(self, formula: Formula, aboard: bool) -> int:
        def values_of(key: FactKey) -> Sequence[Value]:
            return self._domain(key) or (self.known(key),)

        node = self._new(-1, None)
        read_off = variables_read(formula, values_of, self.world, aboard)
        self.opaque[node] = Opaque(node, formula, frozenset(read_off), aboard)
        return node

    def _domain(self, key: FactKey) -> Sequence[Value] | None:
        """The values that a variable can have; `None` if it keeps the one that it has."""
        v = self.number.get(key)
        if v is None:
            return None
        if v < len(self.position):
            robot = key.subject
            return [p for p in self.world.places if self.travel.action(robot, p) is not None]
        return self._values[v]

    def _domain_elsewhere(self, key: FactKey) -> Sequence[Value] | None:
        """As `_domain`, where it does not matter in which place a robot is."""
        v = self.number.get(key)
        return (_ELSEWHERE,) if v is not None and v < len(self.position) else self._domain(key)

    def _reading(
        self, found: Iterable[tuple[Assumed, int | bool]], node: int | None = None
    ) -> int | bool:
        """A node that holds in some of these ways: where they lead to true, or to a node that does.

        Its number is `node`, if it has one already.
        """
        rows: dict[tuple[frozenset[int], Stands], None] = {}
        always, any_way = True, False
        for assumed, holds in found:
            any_way = True
            if holds is not True:
                always = False
                if holds is False:
                    continue
                if not assumed:
                    return holds
            needs, stands = set[int](), list[tuple[str, str]]()
            for key, value in assumed.items():
                if key.relation == AT and key.subject in self.position:
                    if value != _ELSEWHERE:
                        stands.append((key.subject, str(value)))
                elif (ride := self._ride(key, value, assumed)) is not None:
                    needs.add(ride)
                elif not self._is_hand_of_ride(key, assumed):
                    needs.add(self.fact(self.number[key], value))
            for also, there in self._alternatives(holds):
                rows[also | needs, tuple(sorted((*stands, *there)))] = None
        if always or not rows:
            return always and any_way
        node = self._new(-1, None) if node is None else node
        self.axioms[node] = [Axiom(tuple(sorted(needs)), stands, node) for needs, stands in rows]
        return node

    def _alternatives(self, holds: int | bool) -> Sequence[tuple[frozenset[int], Stands]]:
        """What it takes that a node holds: it, or where robots have to be if that is all."""
        if holds is True:
            return ((frozenset(), ()),)
        axioms = self.axioms.get(holds, ())
        if axioms and not any(axiom.needs for axiom in axioms):
            return [(frozenset(), axiom.stands) for axiom in axioms]
        return ((frozenset({holds}), ()),)

    def _ride(self, key: FactKey, value: Value, assumed: Assumed) -> int | None:
        """The node for a thing that is with a robot whose hand, as assumed, holds another."""
        hand = FactKey(HOLDING, str(value))
        if key.relation != AT or hand not in assumed or assumed[hand] == key.subject:
            return None
        at_robot = self.fact(self.number[key], value)
        in_hand = self.fact(self.number[hand], key.subject)
        for node, ride in self.rides.items():
            if (ride.at_robot, ride.in_hand) == (at_robot, in_hand):
                return node
        node = self._new(-1, None)
        self.rides[node] = Ride(node, at_robot, in_hand)
        return node

    def _is_hand_of_ride(self, key: FactKey, assumed: Assumed) -> bool:
        return key.relation == HOLDING and any(
            other.relation == AT and value == key.subject and other.subject != assumed[key]
            for other, value in assumed.items()
        )

    def _initial(self, variable: FactKey) -> Value:
        if variable.relation == AT and variable.subject in self.position:
            return self.start.get(variable)
        return self.known(variable)

    def _new(self, variable: int, value: Value) -> int:
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


def watch_lists(nodes: Nodes, rows: Sequence[Sequence[int]]) -> dict[int, list[int]]:
    """Rows by the facts of which one must hold for all the nodes of the row to hold; -1: by none.

    Chosen so that few rows are found by the same fact.
    """
    uses: dict[int, int] = defaultdict(int)
    for row in rows:
        for need in row:
            uses[need] += 1
    found_by: dict[int, list[int]] = defaultdict(list)
    known: dict[int, list[int]] = {}
    facts_of = {need: _deciding_facts(nodes, need, known) for need in uses}
    for number, row in enumerate(rows):
        decisive = [need for need in row if facts_of[need]]
        best = min(decisive, key=lambda need: uses[need], default=None)
        for fact in (-1,) if best is None else facts_of[best]:
            found_by[fact].append(number)
    return found_by


def _deciding_facts(nodes: Nodes, node: int, known: dict[int, list[int]]) -> list[int]:
    """Facts of one variable, one of which holds wherever the node does; none if there are none.

    What is `known` of others is used, and more noted; of a circle of nodes nothing is.
    """
    if nodes.variable_of[node] >= 0:
        return [node]
    if node in nodes.rides:
        return [nodes.rides[node].at_robot]
    if node in known:
        return known[node]
    known[node] = []
    axioms = nodes.axioms.get(node, ())
    rows = [[f for n in axiom.needs for f in _deciding_facts(nodes, n, known)] for axiom in axioms]
    variables = [{nodes.variable_of[fact] for fact in row} for row in rows]
    if variables and (shared := set[int].intersection(*variables)):
        variable = min(shared)
        known[node] = sorted({f for row in rows for f in row if nodes.variable_of[f] == variable})
    return known[node]
