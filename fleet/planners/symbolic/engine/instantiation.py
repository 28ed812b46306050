"""Filling in the parameters of skills: only what no unchanging fact speaks against."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from functools import cache

from fleet.core.model import derived
from fleet.core.model.eligibility import is_particular, lacks
from fleet.core.model.formulas.evaluation import is_number
from fleet.core.model.parameter_types import OBJECT, PLACE, ROBOT, parse_type
from fleet.core.model.skills import SkillModel
from fleet.core.model.world import WorldModel, known_value
from fleet.planners.symbolic.engine.relevance import ANY, Row, few_of_each, related_skills, rows_of
from keyexpr_schema.facts import AT, IN, ON, FactKey, Literal, Value

Facts = dict[FactKey, Value]
Binding = dict[str, str]


class Instantiation:
    """The skills that can matter for a goal, and the arguments that they can have.

    `robots` are those looked at, `free` those of them that can drive wherever they are needed.
    """

    def __init__(
        self,
        world: WorldModel,
        start: Facts,
        goal: Sequence[Literal],
        robots: Sequence[str],
        free: Collection[str],
    ) -> None:
        self.world = world
        self.start = start
        self.goal = goal
        self.robots = robots
        self.free = frozenset(free)
        self.refused: dict[Literal, list[str]] = defaultdict(list)
        """Why robots cannot do what would make a literal true."""
        self.refused_by: dict[Literal, set[str]] = defaultdict(set)
        """The skills that it was."""
        self.refused_there: set[Literal] = set()
        """Those for which some cannot do it in certain places."""
        self._skills = related_skills(world, goal)
        self.writers: dict[str, list[Row]] = defaultdict(list)
        """By relation, the effects that change it."""
        for skill in self._skills:
            for row in rows_of(skill):
                self.writers[row.relation].append(row)
        self._names = cache(self._names_of)
        self._all_of = cache(self._set_of)
        self.writable = cache(self._writable)
        self._fixed_chain = cache(self._chain_if_fixed)
        self.restores = cache(self._only_from)
        self._places: frozenset[str] = frozenset(world.places)

    def look_at(self, places: Collection[str]) -> None:
        """Fill in no other places than these, where it is open which."""
        self._places = frozenset(places)
        self._names.cache_clear()

    def known(self, variable: FactKey) -> Value:
        """The value of a variable at the start."""
        return known_value(variable, self.start, self.world)

    def unified(self, row: Row, literal: Literal) -> Binding | None:
        """The parameters that are fixed if this row of a skill's effects is the literal."""
        binding: Binding = {}
        wanted: list[tuple[Value, Value]] = [(row.variable.subject, literal.variable.subject)]
        if literal.value != ANY:
            if not row.adds:
                wanted.append((row.value, literal.value))
            elif not self._may_come_to(row, literal):
                return None
        for term, value in wanted:
            kind = row.kind_of(term)
            if kind is None:
                if term != value:
                    return None
                continue
            if not isinstance(value, str) or not self.fits(kind, value):
                return None
            if binding.setdefault(str(term), value) != value:
                return None
        return {name: value for name, value in binding.items() if name in row.skill.parameters}

    def _may_come_to(self, row: Row, literal: Literal) -> bool:
        """Whether adding to a number may lead to one, from what it is now or is set to."""
        aim = _as_number(literal.value)
        sets = (other.value for other in self.writers[row.relation] if not other.adds)
        known = [_as_number(value) for value in (self.known(literal.variable), *sets)]
        numbers = [value for value in known if value is not None]
        if aim is None or not numbers:
            return False
        larger, smaller = row.goes
        return (larger and min(numbers) < aim) or (smaller and max(numbers) > aim)

    def completed(
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
            if isinstance(value, str) and self.fits(skill.parameters[parameter], value):
                yield from self.completed(skill, {**binding, parameter: value}, literal)
            return
        parameter = self._next(skill, missing)
        for value in self._names(skill.parameters[parameter]):
            yield from self.completed(skill, {**binding, parameter: value}, literal)

    def _next(self, skill: SkillModel, missing: Sequence[str]) -> str:
        """The parameter to fill in next: not a place that follows from where another one is, and of
        the others that for which there are the fewest names.
        """
        follow = {
            value
            for (relation, subject), value in skill.before
            if relation == AT and subject in missing and subject not in skill.robot_parameters
        }
        names = [name for name in missing if name not in follow] or missing
        return min(names, key=lambda name: len(self._names(skill.parameters[name])))

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
            elif not self.writable(variable) and relation not in (ON, IN, *derived.DERIVED):
                return str(value), self.known(variable)
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
        return self.known(key)

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
            robot = binding[parameter]
            if parameter != skill.actor_parameter or skill.name in self.world.robots[robot].skills:
                return True
            self._refuse(literal, skill, f"{robot} does not have the skill {skill.name}")
            return False
        is_actor = parameter == skill.actor_parameter
        if not complete and is_actor and is_particular(self.world, skill):
            return True  # the whole call may be one that is not to be tried again
        args = {name: binding.get(name, "") for name in skill.parameters}
        why = lacks(self.world, binding[parameter], skill.ground(args), parameter)
        self._refuse(literal, skill, why)
        if why is not None and literal is not None:
            places = {name for name, kind in skill.types.items() if kind.bases == (PLACE,)}
            anywhere = skill.ground({**args, **dict.fromkeys(places, "")})
            if lacks(self.world, binding[parameter], anywhere, parameter) is None:
                self.refused_there.add(literal)
        return why is None

    def _refuse(self, literal: Literal | None, skill: SkillModel, why: str | None) -> None:
        if why is None or literal is None:
            return
        self.refused_by[literal].add(skill.name)
        if why not in self.refused[literal]:
            self.refused[literal].append(why)

    def fits(self, kind: str, name: str) -> bool:
        """Whether a name is of a type; of robots, whether it is one of those looked at."""
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
            names = self.world.of_type(kind)
            return tuple(n for n in names if n not in self.world.places or n in self._places)
        few = few_of_each(self.world, self.start, self.goal, self._skills)
        return tuple(n for n in self.world.of_type(kind) if n not in self.world.objects or n in few)

    def _writable(self, variable: FactKey) -> bool:
        """Whether a skill can change it, for all that is known of types."""
        relation, subject = variable
        if relation == AT and subject in self.free:
            return True
        return any(
            kind is not None and self.fits(kind, subject)
            for row in self.writers.get(relation, ())
            if (kind := row.kind_of(row.variable.subject)) is not None
        )

    def _only_from(self, relation: str, value: Value) -> bool:
        """Whether a variable takes any of its other, listed values only from `value`: nothing else
        than having had it leads there, as a hand takes something only when it is empty.
        """
        for row in self.writers.get(relation, ()):
            if row.kind_of(row.value) is None:
                continue
            before = next((b for b in row.skill.before if b.variable == row.variable), None)
            if before is None or before.value != value:
                return False
        return True


def _as_number(value: Value) -> float | None:
    return float(value) if is_number(value) else None


class _MayChange(Exception):
    """What is asked for depends on a variable that a skill changes."""
