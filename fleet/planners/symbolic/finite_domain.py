"""A subgoal as a finite-domain task: variables with numbered values, and operators on them.

A state is one number for each variable: that of the fact (variable and value) that holds. Robots
that can drive are moved by the operators that need them somewhere. What a goal reads is not always
a fact: derived literals are *readings*, evaluated on the state by the rules of the model.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel, known_value, room_left
from fleet.planners.symbolic.grounding import Facts
from fleet.planners.symbolic.readings import holds, is_derived
from fleet.planners.symbolic.travel import Moves, Travel
from keyexpr_schema.facts import AT, HELD, HOLDING, LOCATED, FactKey, Literal, Value

State = tuple[int, ...]
Stands = tuple[tuple[str, str], ...]
"""Robots, each with the place where it must be."""


@dataclass(frozen=True, slots=True)
class Operator:
    """An action: facts that it needs, robots that have to be somewhere, facts that it makes true.

    `cost_s` is without the ways of robots.
    """

    action: Action
    needs: tuple[int, ...]
    stands: Stands
    writes: tuple[int, ...]
    cost_s: float


@dataclass(frozen=True, slots=True)
class Axiom:
    """Facts, or readings, that make a reading hold where these robots stand."""

    needs: tuple[int, ...]
    stands: Stands
    reading: int


@dataclass(frozen=True, slots=True)
class Ride:
    """That a thing is with a robot and not in its hand: a node, and the facts that decide it."""

    node: int
    at_robot: int
    in_hand: int | None


class FiniteDomainTask:
    """Variables, facts, operators and a goal; what no action changes is folded in.

    Numbers of facts and of readings are of one kind (`nodes`). `impossible` names a literal of the
    goal that no operator touches and that does not hold.
    """

    def __init__(
        self,
        world: WorldModel,
        start: Facts,
        goal: Sequence[Literal],
        actions: Sequence[Action],
        robots: Sequence[str],
        travel: Travel,
        free: Collection[str],
    ) -> None:
        self.world = world
        self.start = start
        self.goal = goal
        self.travel = travel
        self.robots = tuple(robots)
        self._free = [robot for robot in robots if robot in free]
        written = {literal.variable for action in actions for literal in action.after}
        self.variables = [FactKey(AT, robot) for robot in self._free]
        self.variables += sorted(written - set(self.variables))
        self.position = {robot: number for number, robot in enumerate(self._free)}
        self._number = {variable: number for number, variable in enumerate(self.variables)}
        self._facts: dict[tuple[int, Value], int] = {}
        self.variable_of: list[int] = []
        self.value_of: list[Value] = []
        self.initial: State = tuple(
            self.fact(number, self._initial(variable))
            for number, variable in enumerate(self.variables)
        )
        self.operators = [made for action in actions if (made := self._operator(action))]
        self.readings: list[Literal] = []
        self.axioms: list[Axiom] = []
        self.rides: list[Ride] = []
        self.rides_by: dict[int, list[int]] = defaultdict(list)
        """By operator: the rides that it makes true."""
        self._node: dict[Literal, int] = {}
        self.impossible: Literal | None = None
        self.goal_needs, self.goal_stands = self._goal()
        self._room = {
            carrier: self._room_beside(carrier)
            for operator in self.operators
            for carrier in operator.action.space_in
        }
        self._things = [
            (number, variable.subject)
            for number, variable in enumerate(self.variables)
            if variable.relation == AT and variable.subject in world.objects
        ]
        self._watched = self._watch_lists()

    def fact(self, variable: int, value: Value) -> int:
        """The number of a fact."""
        key = variable, value
        if key not in self._facts:
            self._facts[key] = len(self.variable_of)
            self.variable_of.append(variable)
            self.value_of.append(value)
        return self._facts[key]

    @property
    def nodes(self) -> int:
        """How many facts and readings there are."""
        return len(self.variable_of)

    def true_nodes(self, state: State) -> list[int]:
        """The facts of a state, and the rides that they come to."""
        found = list(state)
        for ride in self.rides:
            if state[self.variable_of[ride.at_robot]] == ride.at_robot and (
                ride.in_hand is None or state[self.variable_of[ride.in_hand]] != ride.in_hand
            ):
                found.append(ride.node)
        return found

    def facts(self, state: State) -> Facts:
        """All facts that hold in a state."""
        values = {self.variables[v]: self.value_of[fact] for v, fact in enumerate(state)}
        return {**self.start, **values}

    def where(self, state: State, robot: str) -> Value:
        """Where a robot that can drive is; `None` if that is still open."""
        return self.value_of[state[self.position[robot]]]

    def moves_s(self, state: State, moves: Mapping[str, str]) -> float:
        """What it costs to bring robots where they have to be."""
        cost_s = self.travel.cost_s
        position, value_of = self.position, self.value_of
        return sum(
            cost_s(robot, value_of[state[position[robot]]], place) for robot, place in moves.items()
        )

    def moved(self, state: State, moves: Moves) -> State:
        """The state once robots have gone where they have to be."""
        values = list(state)
        for robot, place in moves.items():
            here = self.position[robot]
            values[here] = self.fact(here, place)
        return tuple(values)

    def successors(self, state: State) -> Iterator[tuple[int, Moves, State]]:
        """Every operator that can be done, the ways of robots to it, and the state after it."""
        variable_of, operators = self.variable_of, self.operators
        for fact in (*state, -1):
            for number in self._watched.get(fact, ()):
                operator = operators[number]
                if any(state[variable_of[need]] != need for need in operator.needs):
                    continue
                if operator.action.space_in and not self._has_room(operator.action, state):
                    continue
                values = list(state)
                moves: Moves = {}
                for robot, place in operator.stands:
                    here = self.position[robot]
                    if self.value_of[state[here]] != place:
                        moves[robot] = place
                        values[here] = self.fact(here, place)
                for written in operator.writes:
                    values[variable_of[written]] = written
                yield number, moves, tuple(values)

    def moves_to_goal(self, state: State) -> Moves | None:
        """Robots that only have to go somewhere for the goal to hold; `None` if it takes more."""
        for need in self.goal_needs:
            variable = self.variable_of[need]
            if variable >= 0 and state[variable] != need:
                return None
        moves: Moves = {}
        for robot, place in self.goal_stands:
            if self.where(state, robot) != place:
                moves[robot] = place
        for literal in self.readings:
            found = self._moves_for(literal, state, moves)
            if found is None:
                return None
            moves = found
        if len(self.goal) > 1 and not all(
            self._holds(literal, state, moves) for literal in self.goal
        ):
            return None
        return moves

    def _moves_for(self, literal: Literal, state: State, moves: Moves) -> Moves | None:
        if self._holds(literal, state, moves):
            return moves
        if literal.variable.relation != AT or not isinstance(literal.value, str):
            return None
        for robot in self._free:
            if robot not in moves and literal.value in self.world.places:
                more = {**moves, robot: literal.value}
                if self._holds(literal, state, more):
                    return more
        return None

    def _holds(self, literal: Literal, state: State, moves: Moves) -> bool:
        def value_of(key: FactKey) -> Value:
            if moves and key.relation == AT and key.subject in moves:
                return moves[key.subject]
            number = self._number.get(key)
            if number is None:
                return known_value(key, self.start, self.world)
            return self.value_of[state[number]]

        return holds(literal, value_of, self.world)

    def _initial(self, variable: FactKey) -> Value:
        if variable.relation == AT and variable.subject in self.position:
            return self.start.get(variable)
        return known_value(variable, self.start, self.world)

    def _operator(self, action: Action) -> Operator | None:
        """The action without what always holds; `None` if something never does."""
        needs: list[int] = []
        stands: dict[str, str] = {}
        for variable, value in action.before:
            if variable.relation == AT and variable.subject in self.position:
                if (
                    not isinstance(value, str)
                    or stands.setdefault(variable.subject, value) != value
                ):
                    return None
                if self.travel.action(variable.subject, value) is None:
                    return None
            elif variable in self._number:
                needs.append(self.fact(self._number[variable], value))
            elif known_value(variable, self.start, self.world) != value:
                return None
        writes = tuple(self.fact(self._number[key], value) for key, value in action.after)
        cost_s = self.world.work_s(action.actor, action.skill)
        return Operator(action, tuple(needs), tuple(stands.items()), writes, cost_s)

    def _goal(self) -> tuple[tuple[int, ...], Stands]:
        needs: list[int] = []
        stands: list[tuple[str, str]] = []
        for literal in self.goal:
            variable, value = literal
            if variable.relation == AT and variable.subject in self.position:
                place = str(value)
                if self.travel.action(variable.subject, place) is None:
                    self.impossible = literal
                stands.append((variable.subject, place))
            elif is_derived(literal, self.world):
                self.readings.append(literal)
                needs.append(self._reading(literal))
            elif variable in self._number:
                needs.append(self.fact(self._number[variable], value))
            elif known_value(variable, self.start, self.world) != value:
                self.impossible = literal
        return tuple(needs), tuple(stands)

    def _reading(self, literal: Literal) -> int:
        """The node of a derived literal, with axioms for all that can make it hold."""
        if literal in self._node:
            return self._node[literal]
        node = self._node[literal] = len(self.variable_of)
        self.variable_of.append(-1)
        self.value_of.append(None)
        (relation, subject), wanted = literal
        where = self._number.get(FactKey(AT, subject))
        if where is None:
            if holds(literal, lambda key: known_value(key, self.start, self.world), self.world):
                self.axioms.append(Axiom((), (), node))
            elif relation == AT:
                carrier = self.start.get(FactKey(AT, subject))
                if self.start.get(FactKey(HOLDING, str(carrier))) != subject:
                    self._comes_with(node, literal, (), carrier)
            return node
        for (variable, value), fact in list(self._facts.items()):
            if variable == where:
                if relation == LOCATED:
                    if (value is not None) is wanted:
                        self.axioms.append(Axiom((fact,), (), node))
                elif relation == HELD:
                    hand = self._number.get(FactKey(HOLDING, str(value)))
                    if wanted and hand is not None:
                        both = fact, self.fact(hand, subject)
                        self.axioms.append(Axiom(both, (), node))
                    elif not wanted:
                        self.axioms.append(Axiom((fact,), (), node))
                elif value == wanted:
                    self.axioms.append(Axiom((fact,), (), node))
                elif value in self.robots:
                    self._comes_with(node, literal, (self._ride(fact),), value)
        return node

    def _ride(self, at_robot: int) -> int:
        """The node that says that a thing is with a robot, and not in its hand."""
        subject = self.variables[self.variable_of[at_robot]].subject
        hand = self._number.get(FactKey(HOLDING, str(self.value_of[at_robot])))
        in_hand = None if hand is None else self.fact(hand, subject)
        node = len(self.variable_of)
        self.variable_of.append(-1)
        self.value_of.append(None)
        self.rides.append(Ride(node, at_robot, in_hand))
        for number, operator in enumerate(self.operators):
            of = {self.variable_of[written]: written for written in operator.writes}
            comes = of.get(self.variable_of[at_robot]) == at_robot
            stays = comes or self.variable_of[at_robot] not in of
            kept = in_hand is None or of.get(self.variable_of[in_hand], in_hand) == in_hand
            opens = in_hand in operator.needs and not kept
            if (comes and in_hand not in operator.writes) or (stays and opens):
                self.rides_by[number].append(node)
        return node

    def _comes_with(
        self, node: int, literal: Literal, needs: tuple[int, ...], carrier: Value
    ) -> None:
        """The subject comes where its carrier does."""
        if carrier in self.robots and isinstance(literal.value, str):
            if carrier in self.position:
                if self.travel.action(carrier, literal.value) is not None:
                    self.axioms.append(Axiom(needs, ((carrier, literal.value),), node))
            elif self.start.get(FactKey(AT, str(carrier))) == literal.value:
                self.axioms.append(Axiom(needs, (), node))

    def _room_beside(self, carrier: str) -> float:
        """Room in a basket, without the things that move in this task."""
        moving = {
            variable
            for variable in self.variables
            if variable.relation == AT and variable.subject in self.world.objects
        }
        beside = {key: value for key, value in self.start.items() if key not in moving}
        return room_left(carrier, beside, self.world)

    def _has_room(self, action: Action, state: State) -> bool:
        for carrier in action.space_in:
            hand = self._number.get(FactKey(HOLDING, carrier))
            held = self.start.get(FactKey(HOLDING, carrier))
            held = held if hand is None else self.value_of[state[hand]]
            inside = sum(
                1
                for number, thing in self._things
                if self.value_of[state[number]] == carrier and held != thing
            )
            if inside >= self._room[carrier]:
                return False
        return True

    def _watch_lists(self) -> dict[int, list[int]]:
        """Operators by the rarest of the facts that they need; -1: those that need none."""
        uses: dict[int, int] = defaultdict(int)
        for operator in self.operators:
            for need in operator.needs:
                uses[need] += 1
        watched: dict[int, list[int]] = defaultdict(list)
        for number, operator in enumerate(self.operators):
            watched[min(operator.needs, key=lambda need: uses[need], default=-1)].append(number)
        return watched
