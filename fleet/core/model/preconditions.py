"""Tasks as ground actions, whether those can be applied now, and what they then make true."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from fleet.core.model.derived import holds
from fleet.core.model.formulas.abstraction import reads
from fleet.core.model.formulas.effects import Guarded, carried_out, instances
from fleet.core.model.formulas.evaluation import conjuncts, evaluate, expanded
from fleet.core.model.formulas.nodes import Formula, Holds, Variable, atoms
from fleet.core.model.formulas.text import formula_text
from fleet.core.model.programs import program_action
from fleet.core.model.skills import Action, Skills
from fleet.core.model.world import WorldModel, condition_holds, known_value, room_left
from keyexpr_schema.facts import FactKey, Literal, Value, render_value
from keyexpr_schema.payloads.goals import Precedence
from keyexpr_schema.payloads.plans import Plan
from keyexpr_schema.payloads.tasks import TaskRecord

ANY = "$"
"""Stands for the subjects of a formula that is about all or some names of a type."""


def action_of(record: TaskRecord, skills: Skills) -> Action | None:
    """The task as a ground action; `None` if the planner was started without that skill."""
    if record.program is not None:
        return program_action(record.program, record.args, skills)
    skill = skills.get(record.skill)
    if skill is None or set(skill.parameters) != set(record.args):
        return None
    return skill.ground(record.args)


def spoken_of(formula: Formula) -> Iterator[FactKey]:
    """The variables that a formula names, those of all or some of a type as of `ANY`. What else
    it may be read off, `variables_of` knows."""
    for atom in atoms(formula):
        yield _of_any(atom.key if isinstance(atom, Variable) else atom.literal.variable)


def written_by(action: Action) -> Iterator[FactKey]:
    """The variables that it may write, those of all of a type as of `ANY`."""
    for literal in action.after:
        yield literal.variable
    for effect in action.conditional:
        yield _of_any(effect.variable)


def _of_any(variable: FactKey) -> FactKey:
    bound = variable.subject.startswith(ANY)
    return FactKey(variable.relation, ANY) if bound else variable


def first_unmet(
    action: Action, facts: Mapping[FactKey, Value], world: WorldModel
) -> Formula | None:
    """The first precondition of the action that does not hold in `facts`; room aside."""

    def value_of(variable: FactKey) -> Value:
        return known_value(variable, facts, world)

    for literal in action.before:
        if not holds(literal, value_of, world):
            return Holds(literal)
    for formula in action.conditions:
        if not evaluate(formula, value_of, world):
            parts = conjuncts(expanded(formula, world))
            return next((part for part in parts if not evaluate(part, value_of, world)), formula)
    return None


def applicable(action: Action, facts: Mapping[FactKey, Value], world: WorldModel) -> bool:
    """Whether the action's preconditions hold in `facts`, room in baskets included."""
    return first_unmet(action, facts, world) is None and all(
        room_left(carrier, facts, world) > 0 for carrier in action.space_in
    )


def made_true(
    action: Action, facts: Mapping[FactKey, Value], world: WorldModel
) -> tuple[Literal, ...]:
    """What the action makes true if it is done in `facts`: of a variable the last word counts."""
    if not action.conditional:
        return action.after

    def value_of(variable: FactKey) -> Value:
        return known_value(variable, facts, world)

    return (*action.after, *carried_out(_guarded(action, world), value_of, world))


def first_broken(
    action: Action, plan: Plan, in_order: Iterable[Precedence], world: WorldModel
) -> str | None:
    """What the plan keeps or avoids and would be otherwise if the action were done now, or would
    hold too early of what is still `in_order`, as a phrase, or `None`."""
    facts = {**world.facts, **dict(made_true(action, world.facts, world))}
    for condition, wanted in (*((c, True) for c in plan.always), *((c, False) for c in plan.never)):
        if condition_holds(facts, condition, world) is not wanted:
            return f"{condition} would {'not ' if wanted else ''}hold then"
    for row in in_order:
        if condition_holds(facts, row.then, world) and not world.holds(row.first):
            return f"{row.then} would hold then, and {row.first} has not yet"
    return None


def effects_hold(action: Action, world: WorldModel) -> bool:
    """Whether all that the action makes true is believed already; a number that it changes may
    always have to be changed once more."""
    return all(holds(literal, world.facts.get, world) for literal in action.after) and all(
        row.to is None
        and (
            world.facts.get(row.variable) == row.value
            or not evaluate(row.when, world.facts.get, world)
        )
        for row in _guarded(action, world)
    )


def _guarded(action: Action, world: WorldModel) -> Iterator[Guarded]:
    return (row for effect in action.conditional for row in instances(effect, world))


def variables_of(action: Action, world: WorldModel) -> frozenset[FactKey]:
    """The variables that the action reads or writes, as things are now."""
    if not action.conditions and not action.conditional:
        return action.variables

    def now(variable: FactKey) -> tuple[Value]:
        return (world.facts.get(variable),)

    read = (expanded(formula, world) for formula in action.conditions)
    rows = tuple(_guarded(action, world))
    return action.variables.union(
        (row.variable for row in rows),
        *(reads(formula, now, world) for formula in (*read, *(row.when for row in rows))),
        *(reads(row.to, now, world) for row in rows if row.to is not None),
    )


def unmet_before(action: Action, world: WorldModel) -> str | None:
    """The first precondition that the facts do not grant, as a phrase, or `None`."""
    unmet = first_unmet(action, world.facts, world)
    if isinstance(unmet, Holds):
        has, wanted = world.value(*unmet.literal.variable), unmet.literal.value
        variable = unmet.literal.variable
        return f"{variable} should be {render_value(wanted)} and is {render_value(has)}"
    if unmet is not None:
        return f"{formula_text(unmet)} should hold, and does not"
    for carrier in action.space_in:
        if room_left(carrier, world.facts, world) < 1:
            where = f"in {carrier}'s basket" if carrier in world.robots else f"on or in {carrier}"
            return f"there is no room {where}"
    return None
