"""Grounding by relevance: only those actions that can help to make the goal true.

Backwards from the goal: an action is of use if it makes something true that the goal, or an action
that is of use, wants. What no skill can change is looked up while parameters are filled in, so that
no action is made that could never be done. Drives are not grounded: they are part of what an action
costs (`fleet.planners.symbolic.travel`).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import cache

from fleet.core.model.parameter_types import OBJECT, ROBOT, parse_type
from fleet.core.model.skills import Action, SkillModel
from fleet.core.model.world import WorldModel, known_value, room_left
from fleet.planners.symbolic.readings import is_derived, variables_read
from fleet.planners.symbolic.travel import only_drives
from keyexpr_schema.facts import AT, HELD, HOLDING, LOCATED, NOTHING, FactKey, Literal, Value
from keyexpr_schema.payloads.world import Object

Facts = dict[FactKey, Value]
Binding = dict[str, str]
READ_OFF = {LOCATED: {AT}, HELD: {AT, HOLDING}}
"""Relations that a derived one is read off."""


class Grounding:
    """The actions of some robots that matter for a goal, and what stood in the way of others.

    `robots` are those looked at, `free` those of them that can drive wherever they are needed.
    """

    def __init__(
        self,
        world: WorldModel,
        start: Facts,
        goal: Sequence[Literal],
        robots: Sequence[str],
        free: Collection[str],
        every_basket: bool = False,
    ) -> None:
        self.world = world
        self.start = start
        self.goal = goal
        self.robots = robots
        self.free = frozenset(free)
        self.refused: dict[Literal, list[str]] = defaultdict(list)
        """Why robots cannot do what would make a literal true."""
        self._every_basket = every_basket
        self._skills = related_skills(world, goal)
        self._writers: dict[str, list[tuple[SkillModel, Literal]]] = defaultdict(list)
        for skill in self._skills:
            for row in skill.after:
                self._writers[row.variable.relation].append((skill, row))
        self._names = cache(self._names_of)
        self.writable = cache(self._writable)
        self._restores = cache(self._only_from)
        self._cannot: dict[tuple[str, tuple[str, ...]], str] = {}
        self._wanted: set[Literal] = set()
        self._open: list[Literal] = []
        self._possible: dict[FactKey, set[Value]] = defaultdict(set)
        self._waiting: dict[FactKey, list[tuple[SkillModel, Literal, Literal, Literal]]] = (
            defaultdict(list)
        )
        self._made: dict[tuple[str, tuple[str, ...]], Action] = {}
        for literal in goal:
            self._want_reading(literal)
        while self._open:
            self._achieve(self._open.pop())

    @property
    def actions(self) -> list[Action]:
        """All that are of use, in a fixed order."""
        return [self._made[key] for key in sorted(self._made)]

    def makers_of(self, literal: Literal) -> list[tuple[SkillModel, Binding]]:
        """The skills that could make a literal true, each with the parameters that this fixes."""
        found = []
        for skill, row in self._writers.get(literal.variable.relation, ()):
            binding = self._unified(skill, row, literal)
            if binding is not None:
                found.append((skill, binding))
        return found

    def _want_reading(self, literal: Literal) -> None:
        if not is_derived(literal, self.world):
            self._want(literal)
            return
        for variable in variables_read(literal, self.robots):
            if variable.relation == AT and variable.subject in self.free:
                continue
            if variable.relation == HOLDING:
                in_hand = literal.variable.relation == HELD and literal.value is True
                values: Iterable[Value] = (literal.variable.subject if in_hand else NOTHING,)
            elif literal.variable.relation == AT:
                values = (literal.value, *self.robots)
            else:
                values = (*self.robots, *self.world.places)
            for value in values:
                self._want(Literal(variable, value))

    def _want(self, literal: Literal) -> None:
        variable = literal.variable
        if variable.relation == AT and variable.subject in self.free:
            return  # it drives there
        if literal not in self._wanted:
            self._wanted.add(literal)
            self._open.append(literal)

    def _achieve(self, literal: Literal) -> None:
        for skill, row in self._writers.get(literal.variable.relation, ()):
            binding = self._unified(skill, row, literal)
            if binding is None:
                continue
            before = next((b for b in skill.before if b.variable == row.variable), None)
            if (
                before is not None
                and before.value in skill.parameters
                and self._restores(row.variable.relation, literal.value)
            ):
                # It gives back what such actions take: only what has been taken matters.
                self._waiting[literal.variable].append((skill, row, before, literal))
                for value in list(self._values(literal.variable)):
                    self._restore(skill, before, binding, value)
                continue
            for values in self._completed(skill, binding, literal):
                self._add(skill, values)

    def _restore(self, skill: SkillModel, before: Literal, binding: Binding, value: Value) -> None:
        parameter = str(before.value)
        if not isinstance(value, str) or not self._fits(skill.parameters[parameter], value):
            return
        if binding.get(parameter, value) == value:
            for values in self._completed(skill, {**binding, parameter: value}, None):
                self._add(skill, values)

    def _values(self, variable: FactKey) -> set[Value]:
        """The values that a variable has now or that an action of use gives it."""
        if variable not in self._possible:
            self._possible[variable] = {known_value(variable, self.start, self.world)}
        return self._possible[variable]

    def _add(self, skill: SkillModel, args: Binding) -> None:
        key = skill.name, tuple(args[name] for name in skill.parameters)
        if key in self._made:
            return
        action = self._made[key] = skill.ground(args)
        for literal in action.before:
            self._want(literal)
        for carrier in action.space_in:
            self._make_room(carrier)
        for variable, value in action.after:
            known = self._values(variable)
            if value not in known:
                known.add(value)
                for other, row, before, literal in self._waiting.get(variable, ()):
                    binding = self._unified(other, row, literal)
                    if binding is not None:
                        self._restore(other, before, binding, value)

    def _make_room(self, carrier: str) -> None:
        """What lies in a full basket is taken out."""
        if not self._every_basket and room_left(carrier, self.start, self.world) > 0:
            return
        for thing in self.world.objects:
            if self.start.get(FactKey(AT, thing)) == carrier:
                for value in (*self.robots, *self.world.places):
                    if value != carrier:
                        self._want(Literal(FactKey(AT, thing), value))

    def _unified(self, skill: SkillModel, row: Literal, literal: Literal) -> Binding | None:
        """The parameters that are fixed if this row of a skill's effects is the literal."""
        subject = literal.variable.subject
        if not self._fits(skill.parameters[row.variable.subject], subject):
            return None
        binding = {row.variable.subject: subject}
        if isinstance(row.value, str) and row.value in skill.parameters:
            value = literal.value
            if not isinstance(value, str) or not self._fits(skill.parameters[row.value], value):
                return None
            if binding.setdefault(row.value, value) != value:
                return None
        elif row.value != literal.value:
            return None
        return binding

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
            if value in skill.parameters and value not in binding and subject in binding:
                variable = FactKey(relation, binding[subject])
                if not self.writable(variable):
                    return str(value), known_value(variable, self.start, self.world)
        return None

    def _consistent(self, skill: SkillModel, binding: Binding, literal: Literal | None) -> bool:
        robots = [binding[name] for name in skill.robot_parameters if name in binding]
        if len(set(robots)) < len(robots):
            return False
        for (relation, subject), value in skill.before:
            if subject not in binding or (value in skill.parameters and value not in binding):
                continue
            variable = FactKey(relation, binding[subject])
            wanted = binding[value] if isinstance(value, str) and value in binding else value
            if (
                not self.writable(variable)
                and known_value(variable, self.start, self.world) != wanted
            ):
                return False
        return all(
            self._able(skill, binding, parameter, literal)
            for parameter in skill.robot_parameters
            if parameter in binding
        )

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
        return name in self.world.of_type(kind)

    def _names_of(self, kind: str) -> tuple[str, ...]:
        if kind == ROBOT:
            return tuple(self.robots)
        bases = parse_type(kind).bases
        if OBJECT not in bases:
            return self.world.of_type(kind)
        most = max(list(skill.parameters.values()).count(kind) for skill in self._skills)
        few = _few_of_each(self.world, self.start, self.goal, most)
        return tuple(n for n in self.world.of_type(kind) if n not in self.world.objects or n in few)

    def _writable(self, variable: FactKey) -> bool:
        """Whether a skill can change it, for all that is known of types."""
        relation, subject = variable
        if relation == AT and subject in self.free:
            return True
        return any(
            self._fits(skill.parameters[row.variable.subject], subject)
            for skill, row in self._writers.get(relation, ())
        )

    def _only_from(self, relation: str, value: Value) -> bool:
        """Whether a variable takes any of its other, listed values only from `value`: nothing else
        than having had it leads there, as a hand takes something only when it is empty.
        """
        for skill, row in self._writers.get(relation, ()):
            if row.value not in skill.parameters:
                continue
            before = next((b for b in skill.before if b.variable == row.variable), None)
            if before is None or before.value != value:
                return False
        return True


def related_skills(world: WorldModel, goal: Iterable[Literal]) -> list[SkillModel]:
    """Skills that write a relation which the goal, or such a skill, reads; drives left out."""
    wanted = set[str]()
    for literal in goal:
        wanted |= READ_OFF.get(literal.variable.relation, {literal.variable.relation})
        if literal.variable.relation == AT:
            wanted.add(AT)
    related: set[str] = set()
    while True:
        more = {
            name
            for name, skill in world.skills.items()
            if name not in related
            and not only_drives(skill)
            and wanted & {row.variable.relation for row in skill.after}
        }
        if not more:
            return [world.skills[name] for name in sorted(related)]
        related |= more
        wanted |= {row.variable.relation for name in more for row in world.skills[name].before}


def _few_of_each(
    world: WorldModel, start: Mapping[FactKey, Value], goal: Iterable[Literal], most: int
) -> tuple[str, ...]:
    """Things that differ in what they are, or in what is known of them; those that the goal speaks
    of, each. Of things that are all the same, as many as one action takes are enough to find out
    what can be done with them.
    """
    named = {name for (_, subject), value in goal for name in (subject, value)}
    known: dict[str, list[str]] = defaultdict(list)
    for variable, value in start.items():
        if variable.subject in world.objects:
            known[variable.subject].append(f"{variable.relation}={value}")
        if isinstance(value, str) and value in world.objects:
            known[value].append(str(variable))
    chosen: dict[object, list[str]] = defaultdict(list)
    for name, thing in world.objects.items():
        same = chosen[name if name in named else (_profile(thing), *sorted(known[name]))]
        if len(same) < most:
            same.append(name)
    return tuple(name for same in chosen.values() for name in same)


def _profile(thing: Object) -> object:
    """All that a thing is, but for what it is called."""
    return tuple(
        repr(getattr(thing, name))
        for name in thing.__struct_fields__
        if name not in ("object", "label", "ordinal", "aliases", "home")
    )
