"""A goal as a finite-domain task: variables with numbered values, and operators on them.

A state is one number for each variable: that of the fact that holds. Robots that can drive are
moved by the operators that need them somewhere. What no action changes is folded in.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, product

from fleet.core.model import derived
from fleet.core.model.formulas.effects import Guarded, instances
from fleet.core.model.formulas.evaluation import conjuncts, evaluate, expanded, number
from fleet.core.model.formulas.nodes import TRUE
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel, room_left
from fleet.jobshop.time_budget import TimeBudget, Watch
from fleet.planners.symbolic.engine.conditions import Conditions
from fleet.planners.symbolic.engine.constraints import (
    ANYHOW,
    ActionKey,
    OnTheWay,
    Trajectory,
    action_key,
)
from fleet.planners.symbolic.engine.instantiation import Facts
from fleet.planners.symbolic.engine.nodes import Nodes, Stands, State, merged
from fleet.planners.symbolic.engine.travel import Moves, Travel
from fleet.planners.symbolic.engine.watch_lists import watch_lists
from keyexpr_schema.facts import AT, HOLDING, FactKey, Literal, Value

MAX_GOAL_WAYS = 512
"""Combinations of ways looked at in which all parts of a goal can hold at once."""


@dataclass(frozen=True, slots=True)
class Operator:
    """An action: nodes that it needs, robots that have to be somewhere, facts that it makes true.

    `cost_s` is without the ways of robots to it. `conditional` effects come on top of what it
    `writes`; `may_write` are the facts that those can make true, each with the nodes that it takes.
    """

    action: Action
    needs: tuple[int, ...]
    stands: Stands
    writes: tuple[int, ...]
    cost_s: float
    conditional: tuple[Guarded, ...] = ()
    may_write: tuple[tuple[tuple[int, ...], int], ...] = ()


class FiniteDomainTask:
    """Operators and a goal over `nodes`, and what holds on the way there.

    `impossible` is a part of the goal that no operator touches and that does not hold.

    Raises:
        OutOfTime: the `budget` was over before it was made.
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
        on_the_way: Trajectory = ANYHOW,
        budget: TimeBudget | None = None,
    ) -> None:
        self.world = world
        self.goal = goal
        self.travel = travel
        conditional = [
            tuple(row for effect in action.conditional for row in instances(effect, world))
            for action in actions
        ]
        changed = {
            derived.written(literal, world).variable
            for action in actions
            for literal in action.after
        }
        changed |= {effect.variable for of in conditional for effect in of}
        counted = {effect.variable for of in conditional for effect in of if effect.to is not None}
        able = [robot for robot in robots if robot in free]
        self.nodes = Nodes(world, start, able, changed, counted, travel)
        self.conditions = Conditions(self.nodes)
        self.on_the_way = OnTheWay(on_the_way, self.nodes)
        self.forbidden: dict[ActionKey, str] = {}
        """By actions that would break what has to hold on the way: what they would break."""
        self.initial = self.nodes.initial
        self.position = self.nodes.position
        # All facts there are come before the conditions that may read them.
        written = [self._written(a, of) for a, of in zip(actions, conditional, strict=True)]
        self.operators: list[Operator] = []
        watch = Watch(budget)
        for row in zip(actions, conditional, written, strict=True):
            watch.look()
            if (made := self._operator(*row)) is not None:
                self.operators.append(made)
        self.impossible: Literal | None = None
        self.goal_needs, self.goal_stands = self._goal()
        self._count_rides()
        self._things = [
            (v, variable.subject)
            for v, variable in enumerate(self.nodes.variables)
            if variable.relation == AT and variable.subject in world.objects
        ]
        carriers = {carrier for o in self.operators for carrier in o.action.space_in}
        self._room = {carrier: self._room_beside(carrier) for carrier in carriers}
        self._watched = watch_lists(self.nodes, [operator.needs for operator in self.operators])

    def facts(self, state: State) -> Facts:
        """All facts that hold in a state."""
        nodes = self.nodes
        values = {nodes.variables[v]: nodes.value_of[fact] for v, fact in enumerate(state)}
        return {**nodes.start, **values}

    def where(self, state: State, robot: str) -> Value:
        """Where a robot that can drive is; `None` if that is still open."""
        return self.nodes.value_of[state[self.position[robot]]]

    def moves_s(self, state: State, moves: Mapping[str, str]) -> float:
        """What it costs to bring robots where they have to be."""
        way_s = self.travel.way_s
        return sum(way_s[robot, self.where(state, robot), moves[robot]] for robot in moves)

    def moved(self, state: State, moves: Moves) -> State:
        """The state once robots have gone where they have to be."""
        values = list(state)
        for robot, place in moves.items():
            here = self.position[robot]
            values[here] = self.nodes.fact(here, place)
        return tuple(values)

    def successors(self, state: State) -> Iterator[tuple[int, Moves, State]]:
        """Every operator that can be done, the ways of robots to it, and the state after it."""
        nodes = self.nodes
        variable_of = nodes.variable_of
        known: dict[int, Sequence[Stands]] = {}
        for fact in (*state, -1):
            for number_ in self._watched.get(fact, ()):
                operator = self.operators[number_]
                stands: Stands | None = operator.stands
                for need in operator.needs:
                    if variable_of[need] >= 0:
                        if state[variable_of[need]] != need:
                            stands = None
                            break
                        continue
                    if need not in known:
                        known[need] = nodes.stands_for(need, state)
                    stands = _compatible(stands or (), known[need])
                    if stands is None:
                        break
                if stands is None or not self._has_room(operator.action, state):
                    continue
                moves = {r: place for r, place in stands if self.where(state, r) != place}
                there = self.moved(state, moves) if moves else state
                if self.on_the_way and moves and not self.on_the_way.allows(there):
                    continue
                values = list(there)
                for written in operator.writes:
                    values[variable_of[written]] = written
                for effect in operator.conditional:
                    self._apply(effect, there, values)
                reached = tuple(values)
                if not self.on_the_way or self.on_the_way.allows(reached):
                    yield number_, moves, reached

    def moves_to_goal(self, state: State) -> Moves | None:
        """Robots that only have to go somewhere for the goal to hold; `None` if it takes more."""
        options = [self.nodes.stands_for(need, state) for need in self.goal_needs]
        if not all(options):
            return None
        best: Moves | None = None
        for chosen in islice(product(*options), MAX_GOAL_WAYS):
            stands = merged((self.goal_stands, *chosen))
            if stands is None:
                continue
            moves = {r: place for r, place in stands if self.where(state, r) != place}
            if self.on_the_way and not self.on_the_way.allows(self.moved(state, moves)):
                continue
            if best is not None and self.moves_s(state, moves) >= self.moves_s(state, best):
                continue
            value_of = self.nodes.values(self.moved(state, moves))
            if all(
                derived.holds(literal, value_of, self.world, aboard=True) for literal in self.goal
            ):
                best = moves
        return best

    def _apply(self, effect: Guarded, state: State, values: list[int]) -> None:
        """A conditional effect, judged by the state before."""
        value_of = self.nodes.values(state)
        if effect.when != TRUE and not evaluate(effect.when, value_of, self.world):
            return
        v = self.nodes.number[effect.variable]
        value = effect.value if effect.to is None else number(effect.to, value_of, self.world)
        values[v] = self.nodes.fact(v, value)

    def _written(
        self, action: Action, conditional: Sequence[Guarded]
    ) -> tuple[tuple[int, ...], tuple[int | None, ...]]:
        """The facts that an action makes true, and those that its conditional effects do; `None`
        for what they make of a number."""
        literals = [derived.written(literal, self.world) for literal in action.after]
        number_, fact = self.nodes.number, self.nodes.fact
        return (
            tuple(fact(number_[variable], value) for variable, value in literals),
            tuple(
                fact(number_[effect.variable], effect.value) if effect.to is None else None
                for effect in conditional
            ),
        )

    def _operator(
        self,
        action: Action,
        conditional: tuple[Guarded, ...],
        written: tuple[tuple[int, ...], tuple[int | None, ...]],
    ) -> Operator | None:
        """The action without what always holds; `None` if something never does."""
        stands: dict[str, str] = {}
        if self.on_the_way and (broken := self.on_the_way.broken_by(action)) is not None:
            self.forbidden[action_key(action)] = broken
            return None
        nodes: list[int | bool] = []
        rest: list[Literal] = []
        for literal in action.before:
            robot, place = literal.variable.subject, literal.value
            if literal.variable.relation == AT and robot in self.position:
                if not isinstance(place, str) or stands.setdefault(robot, place) != place:
                    return None
                if self.travel.action(robot, place) is None:
                    return None
            else:
                rest.append(literal)
        there = set(stands.values())
        for literal in rest:
            innermost = literal.value in there
            nodes.append(self.conditions.literal(literal, aboard=False, innermost=innermost))
        for condition in action.conditions:
            nodes += map(self.conditions.formula, conjuncts(expanded(condition, self.world)))
        needs = _all_of(nodes)
        if needs is None:
            return None
        stood = stands.get(action.actor, self.nodes.start.get(FactKey(AT, action.actor)))
        cost_s = self.world.duration_s(action, stood, action.actor)
        writes, may = written
        may_write = []
        for effect, fact in zip(conditional, may, strict=True):
            when = _all_of(map(self.conditions.formula, conjuncts(effect.when)))
            if fact is not None and when is not None:
                may_write.append((when, fact))
        return Operator(
            action, needs, tuple(stands.items()), writes, cost_s, conditional, tuple(may_write)
        )

    def _goal(self) -> tuple[tuple[int, ...], Stands]:
        needs: list[int] = []
        stands: list[tuple[str, str]] = []
        for literal in self.goal:
            variable, place = literal
            if variable.relation == AT and variable.subject in self.position:
                if self.travel.action(variable.subject, str(place)) is None:
                    self.impossible = literal
                stands.append((variable.subject, str(place)))
                continue
            node = self.conditions.literal(literal, aboard=True, innermost=False)
            if node is False:
                self.impossible = literal
            elif node is not True:
                needs.append(node)
        return tuple(needs), tuple(stands)

    def _count_rides(self) -> None:
        """What each operator makes true besides facts: rides, and formulas that it may decide."""
        nodes = self.nodes
        self.also: dict[int, list[int]] = defaultdict(list)
        for n, operator in enumerate(self.operators):
            of = {nodes.variable_of[written]: written for written in operator.writes}
            for ride in nodes.rides.values():
                hand, at = nodes.variable_of[ride.in_hand], nodes.variable_of[ride.at_robot]
                comes = of.get(at) == ride.at_robot and of.get(hand) != ride.in_hand
                opens = (
                    ride.in_hand in operator.needs and of.get(hand, ride.in_hand) != ride.in_hand
                )
                if comes or (opens and at not in of):
                    self.also[n].append(ride.node)
            changed = {nodes.variables[v] for v in of}
            changed |= {effect.variable for effect in operator.conditional}
            changed |= {FactKey(AT, robot) for robot, _ in operator.stands}
            for opaque in nodes.opaque.values():
                if opaque.node not in nodes.quorums and not changed.isdisjoint(opaque.variables):
                    self.also[n].append(opaque.node)

    def _room_beside(self, carrier: str) -> float:
        """Room in or on a carrier, without the things that move in this task."""
        known = self.nodes.known
        held = known(FactKey(HOLDING, carrier))
        inside = [t for _, t in self._things if known(FactKey(AT, t)) == carrier and t != held]
        return room_left(carrier, self.nodes.start, self.world) + len(inside)

    def _has_room(self, action: Action, state: State) -> bool:
        for carrier in action.space_in:
            held = self.nodes.values(state)(FactKey(HOLDING, carrier))
            there = (t for v, t in self._things if self.nodes.value_of[state[v]] == carrier)
            if sum(1 for thing in there if thing != held) >= self._room[carrier]:
                return False
        return True


def _all_of(nodes: Iterable[int | bool]) -> tuple[int, ...] | None:
    """Those that may hold or not, each once; `None` if one of them never does."""
    found: dict[int, None] = {}
    for node in nodes:
        if node is False:
            return None
        if node is not True:
            found[node] = None
    return tuple(found)


def _compatible(stands: Stands, options: Sequence[Stands]) -> Stands | None:
    """`stands` with the first of the options that does not contradict them."""
    for option in options:
        if not option:
            return stands
        if (both := merged((stands, option))) is not None:
            return both
    return None
