"""What is missing first where a goal is out of reach even if nothing ever ceased to hold.

The goal is followed back: what could make it true, what that needs, and so on, to the first thing
that nothing can bring about: a capability, a robot, a tool, a way, a place that nobody knows.
Where that is something that no detour can bring about either, it is certain.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from fleet.core.model import derived
from fleet.core.model.formulas.effects import instances
from fleet.core.model.formulas.evaluation import conjuncts, expanded
from fleet.core.model.formulas.nodes import TRUE, Formula, Holds, Or, Stored, atoms
from fleet.core.model.formulas.text import formula_text
from fleet.core.model.parameter_types import PLACE, ROBOT, with_article
from fleet.core.model.shortfall import Shortfall, told_together
from fleet.core.model.skills import Action, SkillModel
from fleet.planners.symbolic.engine.constraints import action_key
from fleet.planners.symbolic.engine.finite_domain import FiniteDomainTask
from fleet.planners.symbolic.engine.grounding import Grounding
from fleet.planners.symbolic.engine.instantiation import Binding
from fleet.planners.symbolic.engine.relaxed_rows import reachable
from fleet.planners.symbolic.engine.relevance import ANY, rows_of
from keyexpr_schema.facts import (
    AT,
    HELD,
    HOLDING,
    IN,
    IS_OPEN,
    LOCATED,
    ON,
    REACHABLE,
    FactKey,
    Literal,
)
from keyexpr_schema.payloads.world import Feature

MAX_NAMED = 3
"""Reasons named, where there are several of a kind."""


@dataclass(frozen=True)
class Missing:
    """Why a goal is out of reach: a phrase, and the things of which that is because nobody knows
    where they are. `certain`: it is, whatever detours are looked at."""

    phrase: str
    unlocated: tuple[str, ...]
    certain: bool


def what_is_missing(grounding: Grounding, task: FiniteDomainTask) -> Missing:
    """What there is to say of a goal that is out of reach."""
    search = _Missing(grounding, task)
    goal = task.impossible or next(filter(search.is_missing, task.goal), None)
    if goal is None:
        return Missing("all that it needs can be had, but not at the same time", (), False)
    phrase = search.why(goal)
    return Missing(phrase, tuple(search.unlocated), search.certain)


class _Missing:
    def __init__(self, grounding: Grounding, task: FiniteDomainTask) -> None:
        self._grounding = grounding
        self._task = task
        self._world = grounding.world
        self._true = reachable(task)
        self._told: dict[Literal | Formula, str] = {}
        self._written: dict[Formula, Formula] = {}
        """How a skill file has what was written out."""
        self.unlocated: dict[str, None] = {}
        """Things that would have to be found first."""
        self.certain = not grounding.leaves_out

    def is_missing(self, literal: Literal) -> bool:
        """Whether a literal of the goal is out of reach."""
        if self._is_position(literal):
            return self._task.travel.action(literal.variable[1], str(literal.value)) is None
        return not self._can_be(
            self._task.conditions.literal(literal, aboard=True, innermost=False)
        )

    def why(self, literal: Literal | Formula) -> str:
        """What is missing first for something that can never hold."""
        if literal not in self._told:
            self._told[literal] = ""  # what leads there and needs it itself has nothing to say
            self._told[literal] = self._why(literal)
        return self._told[literal]

    def _why(self, literal: Literal | Formula) -> str:
        if not isinstance(literal, Literal):
            return self._why_formula(literal)
        unknown = self._unknown(literal)
        if unknown is not None:
            return unknown
        if literal.variable.relation in derived.DERIVED:
            return self._why_derived(literal)
        stored = derived.written(literal, self._world)
        missing: dict[Literal | Formula, None] = {}
        making: set[str] = set()
        forbidden: dict[str, None] = {}
        for action in self._grounding.actions:
            for when in self._makes(action, stored):
                making.add(action.skill.name)
                broken = self._task.forbidden.get(action_key(action))
                if broken is not None:
                    forbidden[broken] = None
                    continue
                first = next(self._missing_for(action, when), None)
                self.certain &= first is not None
                if first is not None:
                    missing[first] = None
        makers = self._grounding.makers_of(literal)
        if not makers:
            return self._no_maker(stored)
        skills = self._grounding.skills
        sought = stored, Literal(stored.variable, ANY)
        refused = [why for each in sought for why in skills.refused.get(each, ())]
        by = {name for each in sought for name in skills.refused_by.get(each, ())}
        found = [*forbidden, *(self.why(first) for first in missing)]
        lacking: list[str] = []
        for skill, args in makers:
            there_is_not = [*self._lacking(skill, args), *self._lost_of(skill, args)]
            lacking += there_is_not
            tried = skill.name in making or skill.name in by
            self.certain &= tried or bool(there_is_not)
        grounding = self._grounding
        self.certain &= not (grounding.is_given_back(stored) or grounding.may_come_along(stored))
        if too_much := [why for why in refused if self._is_too_much(literal, why)]:
            return _named(too_much)
        if any(found):
            return _named(found)
        said = [*refused, *self._staying(makers), *lacking]
        return self._in_a_hand(literal) or _named(said) or f"nothing leads to {literal}"

    def _is_too_much(self, literal: Literal, why: str) -> bool:
        """Whether that is why it fails: the thing is too heavy, or is where it is too high."""
        if not isinstance(why, Shortfall):
            return False
        (relation, subject), value = literal
        thing = str(value) if relation == HOLDING else subject
        around = derived.carriers(thing, self._task.nodes.known, self._world, aboard=True)
        return why.about[0] in (thing, *around)

    def _in_a_hand(self, literal: Literal) -> str:
        """In whose hand something is that nobody takes from there: a person's, or that of a robot
        that is away."""
        (relation, subject), value = literal
        subject = str(value) if relation == HOLDING else subject
        holder = str(self._task.nodes.known(FactKey(AT, subject)))
        thing = self._world.objects.get(holder)
        if thing is not None and thing.is_a(Feature.PERSON):
            return f"{subject} is in the hand of {holder}, and nobody takes it from there"
        if holder in self._world.robots and holder not in self._world.team:
            return f"{holder} has {subject}, and is not connected"
        return ""

    def _staying(self, makers: Sequence[tuple[SkillModel, Binding]]) -> Iterator[str]:
        """Robots that could do it somewhere else, and cannot drive."""
        grounding, known = self._grounding, self._task.nodes.known
        for robot in grounding.robots:
            skills = self._world.robots[robot].skills
            if robot not in grounding.free and any(skill.name in skills for skill, _ in makers):
                yield f"{robot} cannot drive, and is at {known(FactKey(AT, robot)) or 'unknown'}"

    def _lost_of(self, skill: SkillModel, args: Binding) -> Iterator[str]:
        """What a skill handles of which nobody knows where it is."""
        for (relation, parameter), _ in skill.before:
            name = args.get(parameter)
            lost = name is not None and self._lost(relation, name)
            if lost:
                yield self._nobody_knows_where(lost)

    def _why_formula(self, formula: Formula) -> str:
        """Of alternatives each needs something that is missing."""
        found: list[str] = []
        for alternative in formula.of if isinstance(formula, Or) else (formula,):
            parts = conjuncts(alternative)
            first = next((part for part in parts if not self._holds_ever(part)), None)
            if isinstance(first, Holds | Stored):
                found.append(self.why(first.literal))
            else:
                self.certain = False
                found += () if first is None else self._lost_in(first)
        if not found:
            self.certain = False
        written = self._written.get(formula, formula)
        return _named(found) or f"{formula_text(written)} never holds"

    def _lost_in(self, formula: Formula) -> Iterator[str]:
        """What it speaks of, or counts, of which nobody knows where it is."""
        for atom in atoms(formula):
            if isinstance(atom, Holds | Stored):
                (relation, subject), _ = atom.literal
                if lost := self._lost(relation, subject):
                    yield self._nobody_knows_where(lost)

    def _why_derived(self, literal: Literal) -> str:
        """What carries something has to be opened first; or a robot has to hold it."""
        (relation, subject), wanted = literal
        known = self._task.nodes.known
        if relation == REACHABLE and wanted is True:
            around = derived.carriers(subject, known, self._world, aboard=True)
            closed = [name for name in around if derived.is_closed(name, known, self._world)]
            missing = [Literal(FactKey(IS_OPEN, name), True) for name in closed]
        elif relation == HELD and wanted is True:
            robots = self._grounding.robots
            missing = [Literal(FactKey(HOLDING, robot), subject) for robot in robots]
        else:
            missing = []
        missing = [first for first in missing if not self._holds_ever(Holds(first))]
        if not missing:
            self.certain = False
            return f"nothing leads to {literal}"
        return _named([self.why(first) for first in missing]) or f"nothing leads to {literal}"

    def _holds_ever(self, part: Formula) -> bool:
        return self._can_be(self._task.conditions.formula(part))

    def _lacking(self, skill: SkillModel, args: Binding) -> Iterator[str]:
        """What there is not of the kind that a skill takes: a tool, a second robot."""
        for name, kind in skill.parameters.items():
            if name not in args and kind != ROBOT and not self._world.of_type(kind):
                yield f"{skill.name} takes {with_article(kind)}, and there is none"
        takes, robots = len(skill.robot_parameters), self._grounding.robots
        if len(robots) < takes:
            alone = ", ".join(robots) or "none"
            yield f"{skill.name} takes {takes} robots, and there is {alone}"

    def _unknown(self, literal: Literal) -> str | None:
        """What it speaks of that nobody knows of, or knows the place of."""
        (relation, subject), value = literal
        world = self._world
        if world.kind_of(subject) is None:
            return f"nobody knows of {subject}"
        if subject in world.robots and subject not in world.team:
            self.certain = False
            return f"{subject} is not there"
        if relation in (AT, ON, IN):
            if isinstance(value, str) and world.kind_of(value) is None:
                return f"nobody knows of a place {value}"
            if subject in world.robots:
                self.certain = False
                if (closed := world.kept_from(subject, str(value))) is not None:
                    return closed
                what = world.kind_of(str(value))
                no_place = f", which is {with_article(what)}" if what and what != PLACE else ""
                return f"{subject} cannot drive to {value}{no_place}"
        lost = self._lost(relation, subject)
        return self._nobody_knows_where(lost) if lost else None

    def _lost(self, relation: str, name: str) -> str | None:
        """Of what has a part in a relation for which it must be known where it is: what nobody
        knows the place of, it or what carries it."""
        world, known = self._world, self._task.nodes.known
        if relation not in (AT, ON, IN, REACHABLE, HELD, LOCATED) or name not in world.objects:
            return None
        chain = (name, *derived.carriers(name, known, world, aboard=True))
        lost = next((thing for thing in reversed(chain) if thing in world.objects), name)
        if lost is not name and world.objects[lost].is_a(Feature.PERSON):
            return None
        known_at = chain[-1] in world.places or derived.is_robot(chain[-1], world)
        return None if known_at else lost

    def _nobody_knows_where(self, name: str) -> str:
        self.unlocated[name] = None
        return f"nobody knows where {name} is"

    def _makes(self, action: Action, literal: Literal) -> Iterator[Formula]:
        """What must hold besides for an action to make a literal true, each time that it may."""
        if any(derived.written(row, self._world) == literal for row in action.after):
            yield TRUE
        for effect in action.conditional:
            for row in instances(effect, self._world):
                if row.to is None and Literal(row.variable, row.value) == literal:
                    yield row.when

    def _missing_for(self, action: Action, when: Formula) -> Iterator[Literal | Formula]:
        """What an action needs that can never hold, for what it does `when` a formula holds."""
        conditions = self._task.conditions
        there = {literal.value for literal in action.before if self._is_position(literal)}
        for literal in action.before:
            if self._is_position(literal):
                place = str(literal.value)
                if self._task.travel.action(literal.variable.subject, place) is None:
                    yield literal
            else:
                innermost = literal.value in there
                if not self._can_be(conditions.literal(literal, aboard=False, innermost=innermost)):
                    yield literal
        for condition in (*action.conditions, when):
            for written in conjuncts(condition):
                for part in conjuncts(expanded(written, self._world)):
                    if not self._can_be(conditions.formula(part)):
                        self._written.setdefault(part, written)
                        yield part

    def _is_position(self, literal: Literal) -> bool:
        return literal.variable.relation == AT and literal.variable.subject in self._task.position

    def _can_be(self, node: int | bool) -> bool:
        return node is True or (node is not False and node in self._true)

    def _no_maker(self, literal: Literal) -> str:
        """Why no skill makes it true: there is none, or those there are are for other things."""
        (relation, subject), value = literal
        reasons: dict[str, None] = {}
        for skill in self._world.skills.values():
            for row in rows_of(skill):
                if row.relation != relation:
                    continue
                for term, name in ((row.variable.subject, subject), (row.value, value)):
                    kind = row.kind_of(term)
                    if kind in (None, ROBOT, PLACE) or not isinstance(name, str):
                        continue
                    assert kind is not None
                    if self._world.kind_of(name) is not None and not self._grounding.skills.fits(
                        kind, name
                    ):
                        reasons[f"{skill.name} is for {kind}, and {name} is none"] = None
        named = list(reasons)[:MAX_NAMED]
        return "; ".join(named) if named else f"no skill makes {literal}"


def _named(reasons: Sequence[str]) -> str:
    """The first few of them, each once."""
    rows = told_together(filter(None, reasons))
    if len(rows) == 1:
        return rows[0]  # what is too much for one robot may be for others
    more = f" (and {len(rows) - MAX_NAMED} more)" if len(rows) > MAX_NAMED else ""
    return "; ".join(rows[:MAX_NAMED]) + more
