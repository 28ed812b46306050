"""Which skills and things can matter for a goal at all, before parameters are filled in."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from fleet.core.model.derived import READ_OFF, stays_at
from fleet.core.model.formulas.evaluation import is_number
from fleet.core.model.formulas.nodes import (
    TRUE,
    Constant,
    Exists,
    Formula,
    Sum,
    Term,
    grounded,
    relations_of,
)
from fleet.core.model.parameter_types import OBJECT
from fleet.core.model.skills import SkillModel
from fleet.core.model.world import WorldModel
from fleet.planners.symbolic.engine.travel import can_be_put_off
from keyexpr_schema.facts import (
    AT,
    IN,
    ON,
    FactKey,
    Literal,
    Value,
)
from keyexpr_schema.payloads.world import Object

ANY = "?any"
"""As a wanted value: whatever the variable can be changed to."""


@dataclass(frozen=True)
class Row:
    """One effect of a skill, with parameters, or names that it holds for `each` of, in it."""

    skill: SkillModel
    variable: FactKey
    value: Value
    each: tuple[tuple[str, str], ...] = ()
    more: Term | None = None
    """What it adds to a number."""
    when: Formula = TRUE
    """What it depends on."""

    @property
    def relation(self) -> str:
        """The relation that it changes."""
        return self.variable.relation

    @property
    def is_plain(self) -> bool:
        """Whether its skill is done by one robot and asks for nothing but the state of that one."""
        skill = self.skill
        return (
            not skill.conditions
            and not skill.space_in
            and all(before.variable.subject == skill.actor_parameter for before in skill.before)
            and len(skill.robot_parameters) == 1
        )

    @property
    def adds(self) -> bool:
        """Whether it changes a number, nobody knows to what."""
        return self.more is not None

    @property
    def goes(self) -> tuple[bool, bool]:
        """Whether what it adds to a number may make it larger, and smaller."""
        match self.more:
            case Constant(value) | Sum((Constant(value),), ()) if is_number(value):
                return value > 0, value < 0
            case Sum((), (Constant(value),)) if is_number(value):
                return value < 0, value > 0
        return True, True

    def depends_on(self, literal: Literal, args: Mapping[str, str]) -> Formula:
        """What must hold for it to make a literal true, if the skill has these arguments: for the
        names that the literal speaks of, or where it leaves them open, for some.
        """
        names = dict(args)
        for term, value in (
            (self.variable.subject, literal.variable.subject),
            (self.value, literal.value),
        ):
            if term in dict(self.each) and isinstance(value, str) and value != ANY:
                names[str(term)] = value
        needed = grounded(self.when, names)
        for name, kind in self.each:
            if name not in names:
                needed = Exists(name, kind, needed)
        return needed

    def kind_of(self, term: Value) -> str | None:
        """The type of a parameter or of a name that it holds for each of; `None` for a value."""
        if not isinstance(term, str):
            return None
        return dict(self.each).get(term) or self.skill.parameters.get(term)


def rows_of(skill: SkillModel) -> Iterator[Row]:
    """All effects of a skill, on the variables that are stored."""
    for variable, value in skill.after:
        yield Row(skill, _stored(variable, value, skill), value)
    for effect in skill.conditional:
        variable = _stored(effect.variable, effect.value, skill)
        yield Row(skill, variable, effect.value, effect.each, effect.add, effect.when)


def _stored(variable: FactKey, value: Value, skill: SkillModel) -> FactKey:
    """`at` for what says on or in which thing something is."""
    on_thing = (
        variable.relation in (ON, IN) and isinstance(value, str) and value in skill.parameters
    )
    return FactKey(AT, variable.subject) if on_thing else variable


def related_skills(world: WorldModel, goal: Iterable[Literal]) -> list[SkillModel]:
    """Skills that write a relation which the goal, or such a skill, reads; drives left out."""
    wanted = frozenset[str]().union(*(_read(literal.variable.relation) for literal in goal))
    related: set[str] = set()
    while True:
        more = {
            name
            for name, skill in world.skills.items()
            if name not in related
            and not can_be_put_off(skill)
            and wanted & {row.relation for row in rows_of(skill)}
        }
        if not more:
            return [world.skills[name] for name in sorted(related)]
        related |= more
        for name in more:
            skill = world.skills[name]
            formulas = [*skill.conditions, *(effect.when for effect in skill.conditional)]
            wanted = wanted.union(
                *(_read(row.variable.relation) for row in skill.before),
                *(_read(relation) for formula in formulas for relation in relations_of(formula)),
            )


def _read(relation: str) -> frozenset[str]:
    return READ_OFF.get(relation, frozenset({relation}))


def few_of_each(
    world: WorldModel,
    start: Mapping[FactKey, Value],
    goal: Iterable[Literal],
    skills: Sequence[SkillModel],
) -> frozenset[str]:
    """Things that differ in what they are, or in what is known of them; those that the goal speaks
    of, each. Of things that are all the same, as many as one skill takes are enough to find out
    what can be done with them. Chargers differ in where they are and for how long they are taken.
    """
    most = max(sum(OBJECT in kind.bases for kind in skill.types.values()) for skill in skills)
    charging = any(skill.recharges for skill in skills)
    named = {name for (_, subject), value in goal for name in (subject, value)}
    known: dict[str, list[str]] = defaultdict(list)
    for variable, value in start.items():
        if variable.subject in world.objects:
            known[variable.subject].append(f"{variable.relation}={value}")
        if isinstance(value, str) and value in world.objects:
            known[value].append(str(variable))
    chosen: dict[object, list[str]] = defaultdict(list)
    for name, thing in world.objects.items():
        free = (stays_at(name, world), world.taken_s.get(name)) if charging else None
        alike = _profile(thing), free, *sorted(known[name])
        same = chosen[name if name in named else alike]
        if len(same) < most:
            same.append(name)
    return frozenset(name for same in chosen.values() for name in same)


def _profile(thing: Object) -> object:
    """All that a thing is, but for what it is called."""
    return tuple(
        repr(getattr(thing, name))
        for name in thing.__struct_fields__
        if name not in ("object", "label", "ordinal", "aliases", "home")
    )
