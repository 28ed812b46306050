"""Skill models: what the planner knows of each skill, and ground actions made from them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

from fleet.core.model.formulas.nodes import ConditionalEffect, Formula, grounded, grounded_effect
from fleet.core.model.parameter_types import OBJECT, PLACE, ROBOT, ParameterType, parse_type
from fleet.core.model.relation_types import RelationType
from fleet.language.vocabulary import SkillPhrase, SkillTool, StateWord
from keyexpr_schema.facts import AT, CHARGE, IN, ON, FactKey, Literal, Value


class Need(NamedTuple):
    """A capability that a robot must have; with `measure`, at least as much as `of` measures.

    `mass` is an object's, kg; `height` is that of the highest surface in a place, m.
    """

    capability: str
    measure: str | None = None
    of: str | None = None


MEASURES = {"mass": OBJECT, "height": PLACE}
"""What can be measured, and of which type of parameter."""


SPACE = "space"
"""The one counted condition: `space(carrier)` holds while the carrier's basket has room."""


@dataclass(frozen=True)
class Action:
    """A skill with its arguments filled in."""

    skill: SkillModel
    args: Mapping[str, str]
    before: tuple[Literal, ...]
    after: tuple[Literal, ...]
    space_in: tuple[str, ...]
    """Robots and things that must have room for one more object."""
    conditions: tuple[Formula, ...] = ()
    """What must hold besides `before`."""
    conditional: tuple[ConditionalEffect, ...] = ()
    """What it makes true besides `after`."""

    @property
    def actor(self) -> str:
        """The robot (or `?actor`) that does it."""
        return self.args[self.skill.actor_parameter]

    @cached_property
    def place(self) -> Value:
        """Where its robot has to be for it, or drives for it; `None`: that is open."""
        here, to = FactKey(AT, self.actor), self.skill.travel_to
        needed = (literal.value for literal in self.before if literal.variable == here)
        return next(needed, None if to is None else self.args[to])

    @cached_property
    def variables(self) -> frozenset[FactKey]:
        """Every state variable that it reads or writes."""
        return frozenset(literal.variable for literal in (*self.before, *self.after))

    @cached_property
    def participants(self) -> tuple[str, ...]:
        """Every robot that takes part, the actor first."""
        return tuple(self.args[name] for name in self.skill.robot_parameters)


@dataclass(frozen=True)
class SkillModel:
    """A typed action: parameters, preconditions, effects, duration, and what its robots need."""

    name: str
    about: str
    parameters: Mapping[str, str]
    """By name, the type as it is written: see `fleet.core.model.parameter_types`."""
    needs: Mapping[str, tuple[Need, ...]]
    before: tuple[Literal, ...]
    after: tuple[Literal, ...]
    """With parameters for subjects; a value may be a parameter, too."""
    space_in: tuple[str, ...]
    duration_s: float
    travel_to: str | None
    conditions: tuple[Formula, ...] = ()
    """Formulas that must hold besides `before`."""
    conditional: tuple[ConditionalEffect, ...] = ()
    """Effects that depend on what holds, or change numbers."""
    relations: Mapping[str, RelationType] = field(default_factory=dict)
    """Those of the relations it speaks of whose types are declared."""
    uses: tuple[str, ...] = ()
    """Skills that its robot must have for it, where it is a program and no skill of its own."""
    says: tuple[str, ...] = ()
    """Frames in which people ask for it: `cut {food} [up] [with {tool}]`."""
    state_words: tuple[StateWord, ...] = ()
    """Words for the values of the relations it speaks of."""

    @cached_property
    def robot_parameters(self) -> tuple[str, ...]:
        """Parameters that stand for robots, the actor's first."""
        return tuple(name for name, kind in self.parameters.items() if kind == ROBOT)

    @cached_property
    def moves_to(self) -> str | None:
        """The parameter for the place that it gets its actor to, if it makes nothing else true."""
        if len(self.after) != 1 or self.conditional:
            return None
        ((relation, subject), to) = self.after[0]
        moves = relation == AT and subject == self.actor_parameter and isinstance(to, str)
        return str(to) if moves and self.parameters.get(str(to)) == PLACE else None

    @cached_property
    def recharges(self) -> bool:
        """Whether it fills the battery of the robot that does it."""
        variable = FactKey(CHARGE, self.actor_parameter)
        return any(literal.variable == variable for literal in self.after)

    @cached_property
    def types(self) -> Mapping[str, ParameterType]:
        """The types of its parameters."""
        return {name: parse_type(kind) for name, kind in self.parameters.items()}

    @property
    def actor_parameter(self) -> str:
        """The parameter that stands for the robot that does the task."""
        return self.robot_parameters[0]

    def ground(self, args: Mapping[str, str]) -> Action:
        """The action with these arguments; they must name every parameter.

        Raises:
            KeyError: an argument is missing.
        """

        def fill(rows: Iterable[Literal]) -> tuple[Literal, ...]:
            return tuple([
                Literal(
                    FactKey(relation, args[subject]),
                    args[value] if isinstance(value, str) and value in self.parameters else value,
                )
                for (relation, subject), value in rows
            ])  # fmt: skip

        return Action(
            self,
            dict(args),
            fill(self.before),
            fill(self.after),
            tuple(args[name] for name in self.space_in),
            tuple(grounded(formula, args) for formula in self.conditions),
            tuple(grounded_effect(effect, args) for effect in self.conditional),
        )


Skills = Mapping[str, SkillModel]
"""The skills that a planner knows, by name."""


def phrases_of(skills: Skills) -> tuple[SkillPhrase, ...]:
    """What people can ask for by a skill's name ("vacuum the hallway"): the skills that make
    something true of one object or place, and of that alone.

    What they do to robots aside; a skill whose effects name a second thing, as `place` names where
    an object is put, needs a sentence of its own in the grammar.
    """
    phrases = []
    for name in sorted(skills):
        skill = skills[name]
        rows = [row for row in skill.after if skill.parameters[row.variable.subject] != ROBOT]
        if not rows and skill.says:  # a robot does it with itself
            rows = [row for row in skill.after if row.variable.subject == skill.actor_parameter]
        tools = {str(r.value): r.variable.relation for r in rows if _names_tool(skill, r)}
        rows = [row for row in rows if row.value not in tools]
        about = {row.variable.subject for row in rows}
        plain = all(row.value not in skill.parameters for row in rows)
        if len(about) == 1 and plain:
            kind = str(skill.types[about.pop()])
            wants = tuple((key.relation, value) for key, value in rows if value is not None)
            if wants:
                phrases.append(
                    SkillPhrase(
                        verb=name.replace("_", " "),
                        type=kind,
                        wants=wants,
                        says=skill.says,
                        skill=name,
                        tools=tuple(
                            SkillTool(
                                name=each,
                                type=skill.parameters[each],
                                relation=tools.get(each, ""),
                            )
                            for each in skill.parameters
                            if _is_named(skill, each)
                        ),
                    )
                )
    return tuple(phrases)


def _is_named(skill: SkillModel, parameter: str) -> bool:
    """Whether people name it after "with": `[with {tool}]`."""
    return any(f"with {{{parameter}}}" in frame for frame in skill.says)


def _names_tool(skill: SkillModel, row: Literal) -> bool:
    """Whether an effect says with what it was done: `cut_with(food) = tool`."""
    return _is_named(skill, str(row.value)) and row.variable.relation not in (AT, IN, ON)


def relations_of_skills(skills: Skills) -> tuple[str, ...]:
    """Relations of one thing to another that skills bring about, beside where a thing is.

    "Put the cup next to the lamp" wants `next_to(cup) = lamp`, where a skill has
    `next_to(object) = other`.
    """
    found = {
        row.variable.relation
        for skill in skills.values()
        for row in skill.after
        if row.value in skill.parameters
        and ROBOT not in (skill.parameters[row.variable.subject], skill.parameters[str(row.value)])
    }
    return tuple(sorted(found - {AT, IN, ON}))


def state_words_of(skills: Skills) -> tuple[StateWord, ...]:
    """The words for states that the skills' relations have: "dirty", "unlocked"."""
    return tuple(dict.fromkeys(word for skill in skills.values() for word in skill.state_words))
