"""What conditions read: the ways in which variables can have values so that they hold.

Where things are, whether they can be reached, and formulas are read off several variables, by rules
that only the model knows. The rules are asked for each way those variables can be: what comes out
is a list of conjunctions of facts, which searches and their heuristics can work with.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from fleet.core.model import derived
from fleet.core.model.derived import DERIVED, Inventory
from fleet.core.model.formulas.evaluation import TypedInventory
from fleet.core.model.formulas.nodes import Formula, Holds, Stored, Variable, atoms
from keyexpr_schema.facts import AT, IN, ON, FactKey, Literal, Value

T = TypeVar("T")
ValueOf = Callable[[FactKey], Value]
"""The value of a variable in a state."""
MAX_WAYS = 3_000
"""Ways listed for one condition; one that has more is only ever evaluated."""
Assumed = dict[FactKey, Value]


class TooManyWays(Exception):
    """There are more than `MAX_WAYS`."""


class _Open(Exception):
    def __init__(self, key: FactKey) -> None:
        super().__init__()
        self.key = key


def ways(
    read: Callable[[ValueOf], T],
    values_of: Callable[[FactKey], Sequence[Value] | None],
    known: ValueOf,
) -> Iterator[tuple[Assumed, T]]:
    """Every result that `read` can have, each with the values that it depends on.

    `values_of` are those that a variable can have, `None` for one that keeps its `known` value.

    Raises:
        TooManyWays: there are too many.
    """
    open_: list[Assumed] = [{}]
    found = 0
    while open_:
        assumed = open_.pop()

        def value_of(key: FactKey, assumed: Assumed = assumed) -> Value:
            if key in assumed:
                return assumed[key]
            if values_of(key) is None:
                return known(key)
            raise _Open(key)

        try:
            result = read(value_of)
        except _Open as missing:
            open_ += [{**assumed, missing.key: v} for v in values_of(missing.key) or ()]
            continue
        found += 1
        if found > MAX_WAYS:
            raise TooManyWays
        yield assumed, result


def is_read_off(literal: Literal, world: Inventory) -> bool:
    """Whether a literal is read off other variables, and not one itself."""
    (relation, subject), value = literal
    if relation == AT:
        return subject in world.objects
    if relation in (ON, IN):
        return isinstance(value, str) and (value in world.objects or value in world.robots)
    return relation in DERIVED


def place_of(name: str, value_of: ValueOf, world: Inventory) -> str | None:
    """The innermost place where something is; not what is in a robot's or a person's hands."""
    chain = derived.carriers(name, value_of, world)
    return next((carrier for carrier in chain if carrier in world.places), None)


def variables_read(
    formula: Formula, values_of: derived.ValuesOf, world: TypedInventory, aboard: bool
) -> set[FactKey]:
    """The variables that an `expanded` formula may be decided by."""
    found: set[FactKey] = set()
    for atom in atoms(formula):
        match atom:
            case Holds(literal):
                found |= derived.read_by(literal, values_of, world, aboard=aboard)
            case Stored(literal):
                found.add(literal.variable)
            case Variable(key):
                found.add(key)
    return found
