"""Formulas: what a skill needs, or an effect depends on, beyond plain `variable = value`.

Names in formulas are parameters until `grounded`, names of things afterwards; a variable of a
quantifier is written `$x`, which is no name of anything. Nothing equals the unknown, and no
comparison with it holds, so that `not` of either does.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol

import msgspec

from fleet.core.model.derived import Inventory, holds
from keyexpr_schema.facts import FactKey, Literal, Value, render_value

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


class _Node(msgspec.Struct, frozen=True, tag=True):
    """A part of a formula; a value."""


class Constant(_Node, frozen=True):
    """A number or a word."""

    value: Value


class Variable(_Node, frozen=True):
    """The value of a state variable, or of a property of that name that the thing has."""

    key: FactKey


class Sum(_Node, frozen=True):
    """`plus` added up, less `minus`; unknown if any of them is, or is no number."""

    plus: tuple[Term, ...]
    minus: tuple[Term, ...] = ()


class Total(_Node, frozen=True):
    """Of all names of a type for which `where` holds: `of` added up (1 each: how many they are)."""

    name: str
    type: str
    where: Formula
    of: Term


class Holds(_Node, frozen=True):
    """A literal, which may be a derived one."""

    literal: Literal


class Stored(_Node, frozen=True):
    """A literal of just that variable, whatever follows from others."""

    literal: Literal


class Is(_Node, frozen=True):
    """Whether a name is of a type; nothing changes that."""

    name: str
    type: str


class Compare(_Node, frozen=True):
    """A comparison of numbers; `=` and `!=` compare words, too."""

    left: Term
    relation: str
    right: Term


class Not(_Node, frozen=True):
    """Negation."""

    of: Formula


class And(_Node, frozen=True):
    """All of them; of none, true."""

    of: tuple[Formula, ...]


class Or(_Node, frozen=True):
    """At least one of them; of none, false."""

    of: tuple[Formula, ...]


class ForAll(_Node, frozen=True):
    """Whether something holds for every name of a type."""

    name: str
    type: str
    of: Formula


class Exists(_Node, frozen=True):
    """Whether something holds for some name of a type."""

    name: str
    type: str
    of: Formula


Term = Constant | Variable | Sum | Total
Formula = Holds | Stored | Is | Compare | Not | And | Or | ForAll | Exists
TRUE, FALSE = And(()), Or(())


class ConditionalEffect(msgspec.Struct, frozen=True):
    """What a skill makes true `when` a formula holds, for each of the names in `each` (name and
    type): that `variable` has a value, or has changed by `add`. Judged by what holds before."""

    variable: FactKey
    value: Value = None
    add: Term | None = None
    when: Formula = TRUE
    each: tuple[tuple[str, str], ...] = ()


def grounded(node: Formula, args: Mapping[str, str]) -> Formula:
    """The formula with arguments for parameters."""
    return _formula(node, args)


def grounded_effect(effect: ConditionalEffect, args: Mapping[str, str]) -> ConditionalEffect:
    """The effect with arguments for parameters."""
    literal = _literal(Literal(effect.variable, effect.value), args)
    return ConditionalEffect(
        variable=literal.variable,
        value=literal.value,
        add=None if effect.add is None else _term(effect.add, args),
        when=_formula(effect.when, args),
        each=effect.each,
    )


def _literal(literal: Literal, args: Mapping[str, str]) -> Literal:
    (relation, subject), value = literal
    value = args.get(value, value) if isinstance(value, str) else value
    return Literal(FactKey(relation, args.get(subject, subject)), value)


def _formula(node: Formula, args: Mapping[str, str]) -> Formula:
    match node:
        case Holds(literal):
            return Holds(_literal(literal, args))
        case Stored(literal):
            return Stored(_literal(literal, args))
        case Is(name, kind):
            return Is(args.get(name, name), kind)
        case Compare(left, relation, right):
            return Compare(_term(left, args), relation, _term(right, args))
        case Not(of):
            return Not(_formula(of, args))
        case And(rows):
            return And(tuple(_formula(row, args) for row in rows))
        case Or(rows):
            return Or(tuple(_formula(row, args) for row in rows))
        case ForAll(name, kind, of):
            return ForAll(name, kind, _formula(of, args))
        case Exists(name, kind, of):
            return Exists(name, kind, _formula(of, args))


def _term(node: Term, args: Mapping[str, str]) -> Term:
    match node:
        case Constant(value):
            return Constant(args.get(value, value)) if isinstance(value, str) else node
        case Variable((relation, subject)):
            return Variable(FactKey(relation, args.get(subject, subject)))
        case Sum(plus, minus):
            return Sum(tuple(_term(t, args) for t in plus), tuple(_term(t, args) for t in minus))
        case Total(name, kind, where, of):
            return Total(name, kind, _formula(where, args), _term(of, args))


def expanded(node: Formula, world: TypedInventory) -> Formula:
    """The ground formula with quantifiers written out, and what never changes decided."""
    match node:
        case Holds() | Stored():
            return node
        case Is(name, kind):
            return TRUE if name in world.of_type(kind) else FALSE
        case Compare(left, relation, right):
            compared = Compare(_expanded_term(left, world), relation, _expanded_term(right, world))
            if isinstance(compared.left, Constant) and isinstance(compared.right, Constant):
                return TRUE if _compare(compared.left.value, relation, compared.right.value) else FALSE
            return compared
        case Not(of):
            return negation(expanded(of, world))
        case And(rows):
            return conjunction(expanded(row, world) for row in rows)
        case Or(rows):
            return disjunction(expanded(row, world) for row in rows)
        case ForAll(name, kind, of):
            return conjunction(
                expanded(_formula(of, {name: each}), world) for each in world.of_type(kind)
            )
        case Exists(name, kind, of):
            return disjunction(
                expanded(_formula(of, {name: each}), world) for each in world.of_type(kind)
            )


def _expanded_term(node: Term, world: TypedInventory) -> Term:
    match node:
        case Constant():
            return node
        case Variable(key):
            found = _property(key, world)
            return node if found is None else Constant(found)
        case Sum(plus, minus):
            return Sum(
                tuple(_expanded_term(term, world) for term in plus),
                tuple(_expanded_term(term, world) for term in minus),
            )
        case Total(name, kind, where, of):
            # A sum of totals over one name each: `$x` stands in none of them any more.
            rows = []
            for each in world.of_type(kind):
                args = {name: each}
                condition = expanded(_formula(where, args), world)
                if condition != FALSE:
                    rows.append(Total("", "", condition, _expanded_term(_term(of, args), world)))
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
    return _Reading(value_of, world, aboard).holds(_formula(node, args) if args else node)


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
                return name in self.world.of_type(kind)
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
        return (_formula(of, {name: each}) for each in self.world.of_type(kind))

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
                    self.term(_term(of, args)) for args in rows if self.holds(_formula(where, args))
                )


def _property(key: FactKey, world: TypedInventory) -> Value:
    thing = world.objects.get(key.subject)
    return None if thing is None else thing.properties.get(key.relation)


def is_number(value: Value) -> bool:
    """Whether a value is one to calculate with."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def _sum(values: Iterable[Value]) -> float | None:
    total: float = 0
    for value in values:
        if not isinstance(value, int | float) or isinstance(value, bool):
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


def atoms(node: Formula | Term) -> Iterator[Holds | Stored | Variable]:
    """All that is read in an `expanded` formula: literals, and variables compared."""
    match node:
        case Holds() | Stored() | Variable():
            yield node
        case Compare(left, _, right):
            yield from atoms(left)
            yield from atoms(right)
        case Not(of) | ForAll(_, _, of) | Exists(_, _, of):
            yield from atoms(of)
        case And(rows) | Or(rows):
            for row in rows:
                yield from atoms(row)
        case Sum(plus, minus):
            for term in (*plus, *minus):
                yield from atoms(term)
        case Total(_, _, where, term):
            yield from atoms(where)
            yield from atoms(term)


def relations_of(node: Formula | Term) -> frozenset[str]:
    """The relations that a formula speaks of."""
    return frozenset(
        atom.key.relation if isinstance(atom, Variable) else atom.literal.variable.relation
        for atom in atoms(node)
    )
