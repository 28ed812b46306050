"""Grounding by relevance: only those actions that can help to make the goal true.

Backwards from the goal: an action is of use if it makes something true that the goal, or an action
that is of use, wants. What no skill can change is looked up while parameters are filled in, so that
no action is made that could never be done. Drives are not grounded: they are part of what an action
costs (`fleet.planners.symbolic.engine.travel`).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from functools import cache

from fleet.core.model import derived
from fleet.core.model.formulas.evaluation import expanded
from fleet.core.model.formulas.nodes import And, Formula, Holds, Not, Or, Stored, Variable, atoms
from fleet.core.model.parameter_types import ROBOT
from fleet.core.model.skills import Action, SkillModel
from fleet.core.model.world import WorldModel, room_left
from fleet.jobshop.time_budget import TimeBudget, Watch
from fleet.planners.symbolic.engine.instantiation import ANY, Binding, Facts, Instantiation
from fleet.planners.symbolic.engine.readings import is_read_off
from fleet.planners.symbolic.engine.relevance import Row
from keyexpr_schema.facts import (
    AT,
    HELD,
    HOLDING,
    IN,
    LOCATED,
    NOTHING,
    ON,
    FactKey,
    Literal,
    Value,
)


class Grounding:
    """The actions of some robots that matter for a goal, and what stood in the way of others.

    `robots` are those looked at, `free` those of them that can drive wherever they are needed, with
    where they stand.
    Things are put down and handed over where something is that an action handles, where it shall
    be, or where robots are that cannot drive. `thorough`: in all places, and also with detours over
    furniture, trays and baskets that nothing speaks of.

    Raises:
        OutOfTime: the `budget` was over before.
    """

    def __init__(
        self,
        world: WorldModel,
        start: Facts,
        goal: Sequence[Literal],
        robots: Sequence[str],
        free: Mapping[str, Value],
        thorough: bool = False,
        budget: TimeBudget | None = None,
    ) -> None:
        self.world = world
        self.start = start
        self.goal = goal
        self.robots = robots
        self.free = free
        self._thorough = thorough
        self._watch = Watch(budget)
        self.skills = Instantiation(world, start, goal, robots, free)
        self._around = cache(self._carried_by)
        self._inside = cache(self._with_parts)
        self._carriers = self._that_carry()
        self._places: tuple[str, ...] = tuple(world.places)
        if thorough:
            self._ground()
            return
        spoken_of = {name for (_, subject), value in goal for name in (subject, value)}
        matter = self._where_are({*spoken_of, *(robot for robot in robots if robot not in free)})
        known: set[str] = set()
        while not known or not matter <= known:
            known = set(matter or world.places)
            self._places = tuple(place for place in world.places if place in known)
            self.skills.look_at(self._places)
            self._ground()
            handled = {name for action in self._made.values() for name in action.args.values()}
            matter = known | self._where_are(handled - self.free.keys())

    def _ground(self) -> None:
        self._along: set[Literal] = set()
        self._looked_into: set[str] = set()
        self._wanted: set[Literal] = set()
        self._open: list[Literal] = []
        self._possible: dict[FactKey, set[Value]] = {}
        self._waiting: dict[FactKey, list[tuple[Row, Literal, Literal]]] = defaultdict(list)
        self._made: dict[tuple[str, tuple[str, ...]], Action] = {}
        for literal in self.goal:
            self._want_reading(literal, aboard=True)
        while self._open:
            self._watch.look()
            self._achieve(self._open.pop())

    @property
    def actions(self) -> list[Action]:
        """All that are of use, in a fixed order."""
        return [self._made[key] for key in sorted(self._made)]

    def makers_of(self, literal: Literal) -> list[tuple[SkillModel, Binding]]:
        """The skills that could make a literal true, each with the parameters that this fixes."""
        literal = derived.written(literal, self.world)
        found = (
            (row, self.skills.unified(row, literal))
            for row in self.skills.writers[literal.variable[0]]
        )
        return [(row.skill, binding) for row, binding in found if binding is not None]

    def is_given_back(self, literal: Literal) -> bool:
        """Whether only some of the ways to make it true are looked at: what was taken, given back
        in the plainest way."""
        return any(
            self._taken_before(row, literal.value) is not None
            for row in self.skills.writers[literal.variable.relation]
            if self.skills.unified(row, literal) is not None
        )

    def may_come_along(self, literal: Literal) -> bool:
        """Whether what a literal is about, or says it is held, is on or in something that moves, so
        that it gets elsewhere by itself; or whether robots were refused a place for what it is."""
        names = (literal.variable.subject, literal.value)
        around = (
            carrier for name in names if isinstance(name, str) for carrier in self._around(name)
        )
        return literal in self.skills.refused_there or any(
            self.skills.writable(FactKey(AT, carrier))
            for carrier in around
            if carrier in self.world.objects
        )

    # What is wanted.

    def _want(self, literal: Literal) -> None:
        variable = literal.variable
        if variable.relation == AT and variable.subject in self.free:
            return  # it drives there
        if literal not in self._wanted:
            self._wanted.add(literal)
            self._open.append(literal)

    def _want_reading(self, literal: Literal, aboard: bool = False) -> None:
        """What can make a literal true that may be read off others."""
        (relation, subject), wanted = literal
        if not is_read_off(literal, self.world):
            self._want(literal)
        elif relation in (AT, ON, IN):
            self._want_at(subject, str(wanted), aboard)
        elif relation in (HELD, LOCATED):
            for robot in self.robots:
                self._want(Literal(FactKey(AT, subject), robot))
                if relation == HELD:
                    hand = subject if wanted is True else NOTHING
                    self._want(Literal(FactKey(HOLDING, robot), hand))
            if relation == LOCATED or wanted is not True:
                for place in self._places:
                    self._want(Literal(FactKey(AT, subject), place))
        else:
            for key in derived.read_by(literal, self._values, self.world, aboard=aboard):
                if key.relation not in (AT, HOLDING):
                    self._want(Literal(key, ANY))

    def _want_at(self, subject: str, where: str, aboard: bool) -> None:
        key = FactKey(AT, subject)
        values = [name for name in self._inside(where) if name in self.world.places]
        if where not in self.world.places:
            values += [where, *self._inside(where)]
        if aboard and where in self.world.places:
            values += self.robots
            for robot in self.robots:
                self._want(Literal(FactKey(HOLDING, robot), NOTHING))
        if self._thorough:
            values += [thing for thing in self._carriers if where in self._around(thing)]
            values += [
                thing for thing in self._carriers if self.skills.writable(FactKey(AT, thing))
            ]
        for value in dict.fromkeys(values):
            if value != subject:
                self._want(Literal(key, value))
        if self._thorough:
            around = [*self._around(subject), *self._carriers]
        elif self.skills.writable(key):
            return  # it can be taken there itself
        else:
            around = [*self._around(subject)]
        for carrier in around:  # it comes along with what carries it
            if carrier in self.world.objects and self.skills.writable(FactKey(AT, carrier)):
                literal = Literal(FactKey(AT, carrier), where)
                if carrier not in (subject, where) and literal not in self._along:
                    self._along.add(literal)
                    self._want_at(carrier, where, aboard)

    def _that_carry(self) -> list[str]:
        """Things that a skill can put others on or in."""
        kinds = {row.kind_of(row.value) for row in self.skills.writers[AT]} - {None, ROBOT}
        return sorted(
            name
            for name in self.world.objects
            if any(kind is not None and self.skills.fits(kind, name) for kind in kinds)
        )

    def _where_are(self, names: Collection[Value]) -> set[str]:
        """The innermost places around things and robots, also in a hand; places themselves."""
        found = set[str]()
        for name in names:
            seen: set[Value] = set()
            while isinstance(name, str) and name not in self.world.places and name not in seen:
                seen.add(name)
                name = derived.carrier_of(name, self._now, self.world)
            if isinstance(name, str) and name in self.world.places:
                found.add(name)
        return found

    def _now(self, key: FactKey) -> Value:
        if key.relation == AT and key.subject in self.free:
            return self.free[key.subject]
        return self.skills.known(key)

    def _carried_by(self, name: str) -> tuple[str, ...]:
        return tuple(derived.carriers(name, self.skills.known, self.world, aboard=True))

    def _with_parts(self, where: str) -> list[str]:
        """A place or thing, and its parts."""
        names = [where]
        for table in (self.world.places, self.world.objects):
            names += [
                name
                for name, entry in table.items()
                if entry.part_of is not None and derived.is_part(name, where, self.world)
            ]
        return list(dict.fromkeys(names))

    def _want_formula(self, formula: Formula, positive: bool = True) -> None:
        match formula:
            case Holds(literal):
                if positive:
                    self._want_reading(literal)
                else:
                    self._want_change(literal)
            case Stored(literal):
                self._want(literal if positive else Literal(literal.variable, ANY))
            case Not(of):
                self._want_formula(of, not positive)
            case And(rows) | Or(rows):
                for row in rows:
                    self._want_formula(row, positive)
            case _:
                for atom in atoms(formula):
                    if isinstance(atom, Variable):
                        self._want(Literal(atom.key, ANY))
                    else:
                        self._want_reading(atom.literal)
                        self._want_change(atom.literal)

    def _want_change(self, literal: Literal) -> None:
        for key in derived.read_by(literal, self._values, self.world):
            self._want(Literal(key, ANY))

    def _make_room(self, carrier: str) -> None:
        """What lies in a full basket is taken out."""
        if carrier in self._looked_into:
            return
        self._looked_into.add(carrier)
        if not self._thorough and room_left(carrier, self.start, self.world) > 0:
            return
        for thing in self.world.objects:
            if self.start.get(FactKey(AT, thing)) == carrier:
                for value in (*self.robots, *self._places):
                    if value != carrier:
                        self._want(Literal(FactKey(AT, thing), value))

    # What makes it true.

    def _achieve(self, literal: Literal) -> None:
        for row in self.skills.writers.get(literal.variable.relation, ()):
            binding = self.skills.unified(row, literal)
            if binding is None:
                continue
            before = self._taken_before(row, literal.value)
            if before is not None:
                # It gives back what such actions take: only what has been taken matters, and of
                # several ways to give it back those that need nothing else.
                if not (self._thorough or row.is_plain) and any(
                    other.is_plain and other.value == row.value
                    for other in self.skills.writers[row.relation]
                ):
                    continue
                self._waiting[literal.variable].append((row, before, literal))
                for value in list(self._values(literal.variable)):
                    self._restore(row, before, binding, value)
                continue
            for values in self.skills.completed(row.skill, binding, literal):
                self._add(row.skill, values)

    def _taken_before(self, row: Row, value: Value) -> Literal | None:
        """What a skill asks of a variable to which it gives back what others take, if it does."""
        before = next((b for b in row.skill.before if b.variable == row.variable), None)
        parameter = before is not None and before.value in row.skill.parameters
        return before if parameter and self.skills.restores(row.relation, value) else None

    def _restore(self, row: Row, before: Literal, binding: Binding, value: Value) -> None:
        parameter = str(before.value)
        if not isinstance(value, str) or not self.skills.fits(
            row.skill.parameters[parameter], value
        ):
            return
        if binding.get(parameter, value) == value:
            for values in self.skills.completed(row.skill, {**binding, parameter: value}, None):
                self._add(row.skill, values)

    def _values(self, variable: FactKey) -> set[Value]:
        """The values that a variable has now or that an action of use gives it."""
        if variable not in self._possible:
            self._possible[variable] = {self.skills.known(variable)}
        return self._possible[variable]

    def _add(self, skill: SkillModel, args: Binding) -> None:
        key = skill.name, tuple(args[name] for name in skill.parameters)
        if key in self._made:
            return
        action = self._made[key] = skill.ground(args)
        for literal in action.before:
            self._want_reading(literal)
        for formula in action.conditions:
            self._want_formula(expanded(formula, self.world))
        for effect in action.conditional:
            if not effect.each:
                self._want_formula(expanded(effect.when, self.world))
        for carrier in action.space_in:
            self._make_room(carrier)
        for literal in action.after:
            variable, value = derived.written(literal, self.world)
            known = self._values(variable)
            if value not in known:
                known.add(value)
                for row, before, wanted in self._waiting.get(variable, ()):
                    binding = self.skills.unified(row, wanted)
                    if binding is not None:
                        self._restore(row, before, binding, value)
