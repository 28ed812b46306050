"""Grounding by relevance: only those actions that can help to make the goal true.

Backwards from the goal: an action is of use if it makes something true that the goal, or an action
that is of use, wants. What no skill can change is looked up while parameters are filled in, so that
no action is made that could never be done. Drives are not grounded: they are part of what an action
costs (`fleet.planners.symbolic.travel`).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from functools import cache

from fleet.core.model import derived
from fleet.core.model.formulas.evaluation import expanded
from fleet.core.model.formulas.nodes import And, Formula, Holds, Not, Or, Stored, Variable, atoms
from fleet.core.model.parameter_types import OBJECT, PLACE, ROBOT, parse_type
from fleet.core.model.skills import Action, SkillModel
from fleet.core.model.world import WorldModel, known_value, room_left
from fleet.planners.symbolic.readings import is_read_off
from fleet.planners.symbolic.relevance import Row, few_of_each, related_skills, rows_of
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

Facts = dict[FactKey, Value]
Binding = dict[str, str]
ANY = "?any"
"""As a wanted value: whatever the variable can be changed to."""


class Grounding:
    """The actions of some robots that matter for a goal, and what stood in the way of others.

    `robots` are those looked at, `free` those of them that can drive wherever they are needed.
    `thorough`: also detours over furniture, trays and baskets that nothing speaks of.
    """

    def __init__(
        self,
        world: WorldModel,
        start: Facts,
        goal: Sequence[Literal],
        robots: Sequence[str],
        free: Collection[str],
        thorough: bool = False,
    ) -> None:
        self.world = world
        self.start = start
        self.goal = goal
        self.robots = robots
        self.free = frozenset(free)
        self.refused: dict[Literal, list[str]] = defaultdict(list)
        """Why robots cannot do what would make a literal true."""
        self._thorough = thorough
        self._skills = related_skills(world, goal)
        self._writers: dict[str, list[Row]] = defaultdict(list)
        for skill in self._skills:
            for row in rows_of(skill):
                self._writers[row.relation].append(row)
        self._names = cache(self._names_of)
        self._all_of = cache(self._set_of)
        self._along: set[Literal] = set()
        self.writable = cache(self._writable)
        self._fixed_chain = cache(self._chain_if_fixed)
        self._restores = cache(self._only_from)
        self._wanted: set[Literal] = set()
        self._open: list[Literal] = []
        self._possible: dict[FactKey, set[Value]] = {}
        self._waiting: dict[FactKey, list[tuple[Row, Literal, Literal]]] = defaultdict(list)
        self._made: dict[tuple[str, tuple[str, ...]], Action] = {}
        self._carriers = self._that_carry()
        for literal in goal:
            self._want_reading(literal, aboard=True)
        while self._open:
            self._achieve(self._open.pop())

    @property
    def actions(self) -> list[Action]:
        """All that are of use, in a fixed order."""
        return [self._made[key] for key in sorted(self._made)]

    def makers_of(self, literal: Literal) -> list[tuple[SkillModel, Binding]]:
        """The skills that could make a literal true, each with the parameters that this fixes."""
        literal = derived.written(literal, self.world)
        found = ((row, self._unified(row, literal)) for row in self._writers[literal.variable[0]])
        return [(row.skill, binding) for row, binding in found if binding is not None]

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
                for place in self.world.places:
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
            values += [thing for thing in self._carriers if self.writable(FactKey(AT, thing))]
        for value in dict.fromkeys(values):
            if value != subject:
                self._want(Literal(key, value))
        if not (aboard or self._thorough):
            return
        around = [*self._around(subject), *(self._carriers if self._thorough else ())]
        for carrier in around:  # it comes along with what carries it
            if carrier in self.world.objects and self.writable(FactKey(AT, carrier)):
                literal = Literal(FactKey(AT, carrier), where)
                if carrier not in (subject, where) and literal not in self._along:
                    self._along.add(literal)
                    self._want_at(carrier, where, aboard)

    def _that_carry(self) -> list[str]:
        """Things that a skill can put others on or in."""
        kinds = {row.kind_of(row.value) for row in self._writers[AT]} - {None, ROBOT}
        return sorted(
            name
            for name in self.world.objects
            if any(kind is not None and self._fits(kind, name) for kind in kinds)
        )

    def _around(self, name: str) -> tuple[str, ...]:
        return tuple(derived.carriers(name, self._known, self.world, aboard=True))

    def _inside(self, where: str) -> list[str]:
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
        if not self._thorough and room_left(carrier, self.start, self.world) > 0:
            return
        for thing in self.world.objects:
            if self.start.get(FactKey(AT, thing)) == carrier:
                for value in (*self.robots, *self.world.places):
                    if value != carrier:
                        self._want(Literal(FactKey(AT, thing), value))

    # What makes it true.

    def _achieve(self, literal: Literal) -> None:
        for row in self._writers.get(literal.variable.relation, ()):
            binding = self._unified(row, literal)
            if binding is None:
                continue
            before = next((b for b in row.skill.before if b.variable == row.variable), None)
            if (
                before is not None
                and before.value in row.skill.parameters
                and self._restores(row.relation, literal.value)
            ):
                # It gives back what such actions take: only what has been taken matters.
                self._waiting[literal.variable].append((row, before, literal))
                for value in list(self._values(literal.variable)):
                    self._restore(row, before, binding, value)
                continue
            for values in self._completed(row.skill, binding, literal):
                self._add(row.skill, values)

    def _restore(self, row: Row, before: Literal, binding: Binding, value: Value) -> None:
        parameter = str(before.value)
        if not isinstance(value, str) or not self._fits(row.skill.parameters[parameter], value):
            return
        if binding.get(parameter, value) == value:
            for values in self._completed(row.skill, {**binding, parameter: value}, None):
                self._add(row.skill, values)

    def _values(self, variable: FactKey) -> set[Value]:
        """The values that a variable has now or that an action of use gives it."""
        if variable not in self._possible:
            self._possible[variable] = {self._known(variable)}
        return self._possible[variable]

    def _known(self, variable: FactKey) -> Value:
        return known_value(variable, self.start, self.world)

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
                    binding = self._unified(row, wanted)
                    if binding is not None:
                        self._restore(row, before, binding, value)

    def _unified(self, row: Row, literal: Literal) -> Binding | None:
        """The parameters that are fixed if this row of a skill's effects is the literal."""
        binding: Binding = {}
        wanted: list[tuple[Value, Value]] = [(row.variable.subject, literal.variable.subject)]
        if literal.value != ANY:
            if row.adds:
                return None
            wanted.append((row.value, literal.value))
        for term, value in wanted:
            kind = row.kind_of(term)
            if kind is None:
                if term != value:
                    return None
                continue
            if not isinstance(value, str) or not self._fits(kind, value):
                return None
            if binding.setdefault(str(term), value) != value:
                return None
        return {name: value for name, value in binding.items() if name in row.skill.parameters}

    def _completed(
        self, skill: SkillModel, binding: Binding, literal: Literal | None
    ) -> Iterator[Binding]:
        """Every way to fill in the other parameters that no unchanging fact speaks against."""
        if not self._consistent(skill, binding, literal):
            return
        missing = [name for name in skill.parameters if name not in binding]
        if not missing:
            yield dict(binding)
            return
        fixed = self._fixed_by_facts(skill, binding)
        if fixed is not None:
            parameter, value = fixed
            if isinstance(value, str) and self._fits(skill.parameters[parameter], value):
                yield from self._completed(skill, {**binding, parameter: value}, literal)
            return
        parameter = min(missing, key=lambda name: len(self._names(skill.parameters[name])))
        for value in self._names(skill.parameters[parameter]):
            yield from self._completed(skill, {**binding, parameter: value}, literal)

    def _fixed_by_facts(self, skill: SkillModel, binding: Binding) -> tuple[str, Value] | None:
        """A parameter that only a fact that never changes can give, and the value it gives."""
        for (relation, subject), value in skill.before:
            if value not in skill.parameters or value in binding or subject not in binding:
                continue
            variable = FactKey(relation, binding[subject])
            if relation == AT and variable.subject in self.world.objects:
                chain = self._fixed_chain(variable.subject)
                if chain is not None:
                    return str(value), self._place_in(chain, skill.parameters[str(value)])
            elif not self.writable(variable) and not is_read_off(Literal(variable, ""), self.world):
                return str(value), self._known(variable)
        return None

    def _place_in(self, chain: tuple[str, ...], kind: str) -> str | None:
        """What of all that carries something is meant: the innermost place, or what it is on."""
        if parse_type(kind).bases == (PLACE,):
            return next((carrier for carrier in chain if carrier in self.world.places), None)
        return next(iter(chain), None)

    def _chain_if_fixed(self, name: str) -> tuple[str, ...] | None:
        """All that carries a thing, if nothing can change that."""
        try:
            return tuple(derived.carriers(name, self._unchanging, self.world))
        except _MayChange:
            return None

    def _unchanging(self, key: FactKey) -> Value:
        if self.writable(key):
            raise _MayChange
        return self._known(key)

    def _consistent(self, skill: SkillModel, binding: Binding, literal: Literal | None) -> bool:
        robots = [binding[name] for name in skill.robot_parameters if name in binding]
        if len(set(robots)) < len(robots):
            return False
        for (relation, subject), value in skill.before:
            if subject not in binding or (value in skill.parameters and value not in binding):
                continue
            wanted = binding[value] if isinstance(value, str) and value in binding else value
            try:
                if not self._may_hold(Literal(FactKey(relation, binding[subject]), wanted)):
                    return False
            except _MayChange:
                continue
        return all(
            self._able(skill, binding, parameter, literal)
            for parameter in skill.robot_parameters
            if parameter in binding
        )

    def _may_hold(self, literal: Literal) -> bool:
        """Whether a literal holds.

        Raises:
            _MayChange: it can change whether it does.
        """
        (relation, subject), wanted = literal
        if relation == AT and subject in self.world.objects and wanted in self.world.places:
            chain = self._fixed_chain(subject)
            if chain is None:
                raise _MayChange
            return next((c for c in chain if c in self.world.places), None) == wanted
        return derived.holds(literal, self._unchanging, self.world)

    def _able(
        self, skill: SkillModel, binding: Binding, parameter: str, literal: Literal | None
    ) -> bool:
        """Whether its robot can stand for a parameter, as far as what is filled in tells."""
        complete = len(binding) == len(skill.parameters)
        measured = {need.of for need in skill.needs.get(parameter, ()) if need.of is not None}
        if not complete and not measured <= binding.keys():
            if parameter != skill.actor_parameter:
                return True
            return skill.name in self.world.robots[binding[parameter]].skills
        if not complete and parameter == skill.actor_parameter and self.world.hopeless:
            return True  # the whole call may be one that is not to be tried again
        args = {name: binding.get(name, "") for name in skill.parameters}
        why = self.world.lacks(binding[parameter], skill.ground(args), parameter)
        if why is not None and literal is not None and why not in self.refused[literal]:
            self.refused[literal].append(why)
        return why is None

    def _fits(self, kind: str, name: str) -> bool:
        if kind == ROBOT:
            return name in self.robots
        return name in self._all_of(kind)

    def _set_of(self, kind: str) -> frozenset[str]:
        return frozenset(self.world.of_type(kind))

    def _names_of(self, kind: str) -> tuple[str, ...]:
        """Names to fill in for a parameter of which nothing is known."""
        if kind == ROBOT:
            return tuple(self.robots)
        if OBJECT not in parse_type(kind).bases:
            return self.world.of_type(kind)
        few = few_of_each(self.world, self.start, self.goal, self._skills)
        return tuple(n for n in self.world.of_type(kind) if n not in self.world.objects or n in few)

    def _writable(self, variable: FactKey) -> bool:
        """Whether a skill can change it, for all that is known of types."""
        relation, subject = variable
        if relation == AT and subject in self.free:
            return True
        return any(
            kind is not None and self._fits(kind, subject)
            for row in self._writers.get(relation, ())
            if (kind := row.kind_of(row.variable.subject)) is not None
        )

    def _only_from(self, relation: str, value: Value) -> bool:
        """Whether a variable takes any of its other, listed values only from `value`: nothing else
        than having had it leads there, as a hand takes something only when it is empty.
        """
        for row in self._writers.get(relation, ()):
            if row.kind_of(row.value) is None:
                continue
            before = next((b for b in row.skill.before if b.variable == row.variable), None)
            if before is None or before.value != value:
                return False
        return True


class _MayChange(Exception):
    """What is asked for depends on a variable that a skill changes."""
