"""Whether a formula holds where state variables have certain values; formulas written out."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol, TypeGuard

from fleet.core.model.derived import Inventory, holds
from fleet.core.model.formulas.nodes import (
    FALSE,
    TRUE,
    And,
    Compare,
    Constant,
    Exists,
    ForAll,
    Formula,
    Holds,
    Is,
    Not,
    Or,
    Stored,
    Sum,
    Term,
    Total,
    Variable,
    grounded,
    grounded_term,
)
from fleet.core.model.parameter_types import ParameterType, parse_type
from keyexpr_schema.facts import FactKey, Value

ValueOf = Callable[[FactKey], Value]
COMPARISONS: Mapping[str, Callable[[float, float], bool]] = {
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
    "=": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
}


class TypedInventory(Inventory, Protocol):
    """What exists, by type: `WorldModel` is one."""

    def of_type(self, type_: str) -> Collection[str]: ...
    def is_of_type(self, name: str, type_: ParameterType) -> bool: ...


def evaluate(
    node: Formula,
    value_of: ValueOf,
    world: TypedInventory,
    args: Mapping[str, str] = {},
    *,
    aboard: bool = False,
) -> bool:
    """Whether a formula holds where variables have the values that `value_of` says; `args` are for
    what is a parameter in it. `aboard`: as in a goal, see `fleet.core.model.derived`."""
    return _Reading(value_of, world, aboard).holds(grounded(node, args) if args else node)


def number(node: Term, value_of: ValueOf, world: TypedInventory) -> Value:
    """The value of a ground term; `None` is unknown."""
    return _Reading(value_of, world, False).term(node)


@dataclass(frozen=True)
class _Reading:
    value_of: ValueOf
    world: TypedInventory
    aboard: bool

    def holds(self, node: Formula) -> bool:
        match node:
            case Holds(literal):
                return holds(literal, self.value_of, self.world, aboard=self.aboard)
            case Stored(literal):
                return self.value_of(literal.variable) == literal.value
            case Is(name, kind):
                return self.world.is_of_type(name, parse_type(kind))
            case Compare(left, relation, right):
                return _compare(self.term(left), relation, self.term(right))
            case Not(of):
                return not self.holds(of)
            case And(rows):
                return all(map(self.holds, rows))
            case Or(rows):
                return any(map(self.holds, rows))
            case ForAll(name, kind, of):
                return all(map(self.holds, self._each(name, kind, of)))
            case Exists(name, kind, of):
                return any(map(self.holds, self._each(name, kind, of)))

    def _each(self, name: str, kind: str, of: Formula) -> Iterator[Formula]:
        return (grounded(of, {name: each}) for each in self.world.of_type(kind))

    def term(self, node: Term) -> Value:
        match node:
            case Constant(value):
                return value
            case Variable(key):
                found = _property(key, self.world)
                return self.value_of(key) if found is None else found
            case Sum(plus, minus):
                return _less(_sum(map(self.term, plus)), _sum(map(self.term, minus)))
            case Total(name, kind, where, of):
                if not kind:
                    return self.term(of) if self.holds(where) else 0
                rows = ({name: each} for each in self.world.of_type(kind))
                return _sum(
                    self.term(grounded_term(of, args))
                    for args in rows
                    if self.holds(grounded(where, args))
                )


def _property(key: FactKey, world: TypedInventory) -> Value:
    thing = world.objects.get(key.subject)
    return None if thing is None else thing.properties.get(key.relation)


def is_number(value: Value) -> TypeGuard[float]:
    """Whether a value is one to calculate with."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def _sum(values: Iterable[Value]) -> float | None:
    total: float = 0
    for value in values:
        if not is_number(value):
            return None
        total += value
    return total


def _less(one: float | None, other: float | None) -> float | None:
    return None if one is None or other is None else one - other


def _compare(left: Value, relation: str, right: Value) -> bool:
    if left is None or right is None:
        return False
    if relation in ("=", "!="):
        return (left == right) is (relation == "=")
    if not (isinstance(left, int | float) and isinstance(right, int | float)):
        return False
    return COMPARISONS[relation](left, right)


def expanded(node: Formula, world: TypedInventory) -> Formula:
    """The ground formula with quantifiers written out, and what never changes decided."""
    match node:
        case Holds() | Stored():
            return node
        case Is(name, kind):
            return TRUE if world.is_of_type(name, parse_type(kind)) else FALSE
        case Compare(left, relation, right):
            compared = Compare(expanded_term(left, world), relation, expanded_term(right, world))
            if isinstance(compared.left, Constant) and isinstance(compared.right, Constant):
                return (
                    TRUE if _compare(compared.left.value, relation, compared.right.value) else FALSE
                )
            return compared
        case Not(of):
            return negation(expanded(of, world))
        case And(rows):
            return conjunction(expanded(row, world) for row in rows)
        case Or(rows):
            return disjunction(expanded(row, world) for row in rows)
        case ForAll(name, kind, of):
            return conjunction(
                expanded(grounded(of, {name: each}), world) for each in world.of_type(kind)
            )
        case Exists(name, kind, of):
            return disjunction(
                expanded(grounded(of, {name: each}), world) for each in world.of_type(kind)
            )


def expanded_term(node: Term, world: TypedInventory) -> Term:
    """The same of a term."""
    match node:
        case Constant():
            return node
        case Variable(key):
            found = _property(key, world)
            return node if found is None else Constant(found)
        case Sum(plus, minus):
            return Sum(
                tuple(expanded_term(term, world) for term in plus),
                tuple(expanded_term(term, world) for term in minus),
            )
        case Total("", "", where, of):
            return Total("", "", expanded(where, world), expanded_term(of, world))
        case Total(name, kind, where, of):
            # A sum of totals over one name each: `$x` stands in none of them any more.
            rows = []
            for each in world.of_type(kind):
                args = {name: each}
                condition = expanded(grounded(where, args), world)
                if condition != FALSE:
                    rows.append(
                        Total("", "", condition, expanded_term(grounded_term(of, args), world))
                    )
            return Sum(tuple(rows))


def negation(node: Formula) -> Formula:
    """The formula that holds where `node` does not, with `not` only before atoms."""
    match node:
        case Not(of):
            return of
        case And(rows):
            return disjunction(negation(row) for row in rows)
        case Or(rows):
            return conjunction(negation(row) for row in rows)
        case _:
            return Not(node)


def conjunction(nodes: Iterable[Formula]) -> Formula:
    """All of them, flat."""
    rows: list[Formula] = []
    for node in nodes:
        if node == FALSE:
            return FALSE
        rows += node.of if isinstance(node, And) else (node,)
    return rows[0] if len(rows) == 1 else And(tuple(dict.fromkeys(rows)))


def disjunction(nodes: Iterable[Formula]) -> Formula:
    """One of them, flat."""
    rows: list[Formula] = []
    for node in nodes:
        if node == TRUE:
            return TRUE
        rows += node.of if isinstance(node, Or) else (node,)
    return rows[0] if len(rows) == 1 else Or(tuple(dict.fromkeys(rows)))


def conjuncts(node: Formula) -> tuple[Formula, ...]:
    """The parts that must all hold, of a formula that is `expanded`."""
    return node.of if isinstance(node, And) else (node,)
