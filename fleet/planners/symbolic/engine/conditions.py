"""Conditions as nodes of a task: what makes literals and formulas hold there.

Where things are and whether they can be reached is read step by step, from what carries them: a
fork in a bowl is in the kitchen if that is. What has too many ways to hold to list them is
`Opaque`: only ever evaluated.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property

from fleet.core.model import derived
from fleet.core.model.formulas.evaluation import conjuncts, evaluate
from fleet.core.model.formulas.nodes import Formula, Holds, Not, Or, Stored
from fleet.planners.symbolic.engine.alternatives import quorums
from fleet.planners.symbolic.engine.nodes import Axiom, Nodes, Opaque, Ride, Stands
from fleet.planners.symbolic.engine.readings import (
    Assumed,
    TooManyWays,
    ValueOf,
    is_read_off,
    variables_read,
    ways,
)
from keyexpr_schema.facts import AT, BLOCKED_BY, HOLDING, REACHABLE, FactKey, Literal, Value

_ELSEWHERE = "?"
"""Any place, where it does not matter which."""


class Conditions:
    """The nodes for conditions, made when they are asked for."""

    def __init__(self, nodes: Nodes) -> None:
        self.nodes = nodes
        self.world = nodes.world
        self._readings: dict[object, int | bool] = {}

    def literal(self, literal: Literal, *, aboard: bool, innermost: bool) -> int | bool:
        """The node of a literal; true or false where that never changes.

        `aboard`: as in a goal; `innermost`: only where a place is the first around.
        """
        if literal.variable.relation == AT and literal.variable.subject in self.nodes.position:
            # It can drive there: the place is no matter of the state.
            there: Assumed = {literal.variable: literal.value}
            if literal not in self._readings:
                self._readings[literal] = self._reading([(there, True), ({}, False)])
            return self._readings[literal]
        if not is_read_off(literal, self.world):
            v = self.nodes.number.get(literal.variable)
            if v is None:
                return derived.holds(literal, self.nodes.known, self.world, aboard=aboard)
            if literal.variable not in self.nodes.counted:
                return self.nodes.fact(v, literal.value)
            if literal not in self._readings:
                self._readings[literal] = self._only_evaluated(Stored(literal), aboard=False)
            return self._readings[literal]
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
        if relation == AT and isinstance(wanted, str):
            return self._at(subject, wanted, aboard, innermost and wanted in self.world.places)
        if relation == REACHABLE and wanted is True and self._moves_freely(subject):
            return self._reachable(literal)

        def read(value_of: ValueOf) -> bool:
            return derived.holds(literal, value_of, self.world, aboard=aboard)

        return self._reading(ways(read, self._domain_elsewhere, self.nodes.known))

    def _at(self, subject: str, wanted: str, aboard: bool, innermost: bool) -> int | bool:
        """The node for that `wanted` carries something, directly or not: its carrier does, or is
        what is wanted."""
        key = AT, subject, wanted, aboard, innermost
        if key in self._readings:
            return self._readings[key]
        if subject in self.nodes.position:
            found = self._at_by_driving(subject, wanted, innermost)
            self._readings[key] = self._reading(found)
            return self._readings[key]
        # What is in what may be a circle, so there is a node before it is known what it needs.
        self._readings[key] = node = self.nodes.new()

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
            for assumed, there in ways(read, self._domain, self.nodes.known)
        ]
        self._readings[key] = self._reading(rows, node)
        return self._readings[key]

    def _reachable(self, literal: Literal) -> int | bool:
        """The node for that what carries something is not closed, and can be reached itself."""
        key = literal, False, False
        self._readings[key] = node = self.nodes.new()
        subject = literal.variable.subject

        def read(value_of: ValueOf) -> str | bool:
            return derived.reachable_if(subject, value_of, self.world)

        def of(there: str | bool) -> int | bool:
            if not isinstance(there, str):
                return there
            around = Literal(FactKey(REACHABLE, there), True)
            return self.literal(around, aboard=False, innermost=False)

        found = ways(read, self._domain_elsewhere, self.nodes.known)
        return self._reading([(assumed, of(there)) for assumed, there in found], node)

    def _moves_freely(self, name: str) -> bool:
        """Whether something can be carried about, and no such thing is in the way of hands."""
        return FactKey(AT, name) in self.nodes.number and not self._in_the_way

    @cached_property
    def _in_the_way(self) -> bool:
        things = self.world.objects
        blocking = {other for thing in things.values() for other in thing.blocked_by}
        blocking |= {
            str(value) for key, value in self.nodes.start.items() if key.relation == BLOCKED_BY
        }
        return any(
            thing.movable and (name in blocking or thing.blocked_by)
            for name, thing in things.items()
        )

    def _at_by_driving(
        self, robot: str, wanted: str, innermost: bool
    ) -> Iterator[tuple[Assumed, bool]]:
        """The places where a robot that can drive is then."""
        yield {}, False
        for place in self.world.places:
            around = () if innermost else derived.carriers(place, self.nodes.known, self.world)
            if wanted in (place, *around) and self.nodes.travel.action(robot, place) is not None:
                yield {FactKey(AT, robot): place}, True

    def _one_of(self, formulas: Sequence[Formula]) -> int | bool:
        """The node for that one of some formulas holds."""
        rows: dict[tuple[frozenset[int], Stands], None] = {}
        for formula in formulas:
            parts = [self.formula(part) for part in conjuncts(formula)]
            if all(part is True for part in parts):
                return True
            if any(part is False for part in parts):
                continue
            needs = frozenset(part for part in parts if part is not True)
            alone = self._alternatives(*needs) if len(needs) == 1 else [(needs, ())]
            rows |= dict.fromkeys(alone)
        return self._holding_by(rows)

    def _holding_by(
        self, rows: Iterable[tuple[frozenset[int], Stands]], node: int | None = None
    ) -> int | bool:
        """The node that holds if all the nodes of a row do; false if there are no rows."""
        if not rows:
            return False
        node = self.nodes.new() if node is None else node
        self.nodes.axioms[node] = [
            Axiom(tuple(sorted(needs)), stands, node) for needs, stands in rows
        ]
        return node

    def _read_formula(self, formula: Formula) -> int | bool:
        if isinstance(formula, Or):
            return self._one_of(formula.of)

        if (counted := self._counted(formula)) is not None:
            return counted

        def domain(key: FactKey) -> Sequence[Value] | None:
            if key in self.nodes.counted:
                raise TooManyWays
            return self._domain(key)

        def read(value_of: ValueOf) -> bool:
            return evaluate(formula, value_of, self.world)

        try:
            return self._reading(list(ways(read, domain, self.nodes.known)))
        except TooManyWays:
            return self._only_evaluated(formula, aboard=False)

    def _counted(self, formula: Formula) -> int | None:
        """The node for a count: evaluated in states, and of use to estimates by what it counts.
        Not where it matters where robots are that can drive: those are brought there."""
        needed = quorums(formula)
        if needed is None or self._reads_places_of_robots(formula):
            return None
        rows: list[tuple[tuple[int, ...], int]] = []
        for quorum in needed:
            nodes = [self._one_of((row,)) for row in quorum.of]
            least = quorum.least - sum(node is True for node in nodes)
            open_ = tuple(n for n in nodes if not isinstance(n, bool))
            rows.append((open_, least))
        node = self._only_evaluated(formula, aboard=False)
        self.nodes.quorums[node] = rows
        return node

    def _reads_places_of_robots(self, formula: Formula) -> bool:
        read = variables_read(formula, self._values_of, self.world, aboard=False)
        return any(key.relation == AT and key.subject in self.nodes.position for key in read)

    def _only_evaluated(self, formula: Formula, aboard: bool) -> int:
        node = self.nodes.new()
        read_off = variables_read(formula, self._values_of, self.world, aboard)
        self.nodes.opaque[node] = Opaque(node, formula, frozenset(read_off), aboard)
        return node

    def _values_of(self, key: FactKey) -> Sequence[Value]:
        return self._domain(key) or (self.nodes.known(key),)

    def _domain(self, key: FactKey) -> Sequence[Value] | None:
        """The values that a variable can have; `None` if it keeps the one that it has."""
        v = self.nodes.number.get(key)
        if v is None:
            return None
        if v < len(self.nodes.position):
            robot = key.subject
            return [p for p in self.world.places if self.nodes.travel.action(robot, p) is not None]
        return self.nodes.values_of[v]

    def _domain_elsewhere(self, key: FactKey) -> Sequence[Value] | None:
        """As `_domain`, where it does not matter in which place a robot is."""
        v = self.nodes.number.get(key)
        return (
            (_ELSEWHERE,) if v is not None and v < len(self.nodes.position) else self._domain(key)
        )

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
                if key.relation == AT and key.subject in self.nodes.position:
                    if value != _ELSEWHERE:
                        stands.append((key.subject, str(value)))
                elif (ride := self._ride(key, value, assumed)) is not None:
                    needs.add(ride)
                elif not self._is_hand_of_ride(key, assumed):
                    needs.add(self.nodes.fact(self.nodes.number[key], value))
            for also, there in self._alternatives(holds):
                rows[also | needs, tuple(sorted((*stands, *there)))] = None
        if always and any_way:
            return True
        return self._holding_by(rows, node)

    def _alternatives(self, holds: int | bool) -> Sequence[tuple[frozenset[int], Stands]]:
        """What it takes that a node holds: it, or where robots have to be if that is all."""
        if holds is True:
            return ((frozenset(), ()),)
        axioms = self.nodes.axioms.get(holds, ())
        if axioms and not any(axiom.needs for axiom in axioms):
            return [(frozenset(), axiom.stands) for axiom in axioms]
        return ((frozenset({holds}), ()),)

    def _ride(self, key: FactKey, value: Value, assumed: Assumed) -> int | None:
        """The node for a thing that is with a robot whose hand, as assumed, holds another."""
        hand = FactKey(HOLDING, str(value))
        if key.relation != AT or hand not in assumed or assumed[hand] == key.subject:
            return None
        at_robot = self.nodes.fact(self.nodes.number[key], value)
        in_hand = self.nodes.fact(self.nodes.number[hand], key.subject)
        for node, ride in self.nodes.rides.items():
            if (ride.at_robot, ride.in_hand) == (at_robot, in_hand):
                return node
        node = self.nodes.new()
        self.nodes.rides[node] = Ride(node, at_robot, in_hand)
        return node

    def _is_hand_of_ride(self, key: FactKey, assumed: Assumed) -> bool:
        return key.relation == HOLDING and any(
            other.relation == AT and value == key.subject and other.subject != assumed[key]
            for other, value in assumed.items()
        )
