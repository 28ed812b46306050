"""Effects that depend on what holds: written out, and carried out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import product
from typing import NamedTuple

from fleet.core.model.derived import written
from fleet.core.model.formulas.evaluation import (
    TypedInventory,
    ValueOf,
    evaluate,
    expanded,
    expanded_term,
    number,
)
from fleet.core.model.formulas.nodes import (
    FALSE,
    ConditionalEffect,
    Formula,
    Sum,
    Term,
    Variable,
    grounded_effect,
)
from keyexpr_schema.facts import FactKey, Literal, Value


class Guarded(NamedTuple):
    """What an action makes of one variable `when` a formula holds: `value`, or what `to` says."""

    variable: FactKey
    to: Term | None
    value: Value
    when: Formula


def instances(effect: ConditionalEffect, world: TypedInventory) -> Iterator[Guarded]:
    """A ground effect for each of the names it is for, with its condition written out."""
    names = [name for name, _ in effect.each]
    for values in product(*(world.of_type(kind) for _, kind in effect.each)):
        row = grounded_effect(effect, dict(zip(names, values, strict=True)))
        when = expanded(row.when, world)
        if when == FALSE:
            continue
        variable, value = written(Literal(row.variable, row.value), world)
        to = None
        if row.add is not None:
            to = Sum((Variable(variable), expanded_term(row.add, world)))
        yield Guarded(variable, to, value, when)


def carried_out(
    rows: Iterable[Guarded], value_of: ValueOf, world: TypedInventory
) -> Iterator[Literal]:
    """What the effects make true of a world in which variables have the values `value_of` says."""
    for row in rows:
        if evaluate(row.when, value_of, world):
            value = row.value if row.to is None else number(row.to, value_of, world)
            yield Literal(row.variable, value)
