"""Formulas: what a skill needs, or an effect depends on, beyond plain `variable = value`.

Names in formulas are parameters until `grounded`, names of things afterwards; a variable of a
quantifier is written `$x`, which is no name of anything. Nothing equals the unknown, and no
comparison with it holds, so that `not` of either does.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import msgspec

from keyexpr_schema.facts import FactKey, Literal, Value


class _Node(msgspec.Struct, frozen=True, tag_field="is", tag=True):
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


def grounded_effect(effect: ConditionalEffect, args: Mapping[str, str]) -> ConditionalEffect:
    """The effect with arguments for parameters."""
    literal = _literal(Literal(effect.variable, effect.value), args)
    return ConditionalEffect(
        variable=literal.variable,
        value=literal.value,
        add=None if effect.add is None else grounded_term(effect.add, args),
        when=grounded(effect.when, args),
        each=effect.each,
    )


def _literal(literal: Literal, args: Mapping[str, str]) -> Literal:
    (relation, subject), value = literal
    value = args.get(value, value) if isinstance(value, str) else value
    return Literal(FactKey(relation, args.get(subject, subject)), value)


def grounded(node: Formula, args: Mapping[str, str]) -> Formula:
    """The formula with arguments for parameters."""
    match node:
        case Holds(literal):
            return Holds(_literal(literal, args))
        case Stored(literal):
            return Stored(_literal(literal, args))
        case Is(name, kind):
            return Is(args.get(name, name), kind)
        case Compare(left, relation, right):
            return Compare(grounded_term(left, args), relation, grounded_term(right, args))
        case Not(of):
            return Not(grounded(of, args))
        case And(rows):
            return And(tuple(grounded(row, args) for row in rows))
        case Or(rows):
            return Or(tuple(grounded(row, args) for row in rows))
        case ForAll(name, kind, of):
            return ForAll(name, kind, grounded(of, args))
        case Exists(name, kind, of):
            return Exists(name, kind, grounded(of, args))


def grounded_term(node: Term, args: Mapping[str, str]) -> Term:
    """The term with arguments for parameters."""
    match node:
        case Constant(value):
            return Constant(args.get(value, value)) if isinstance(value, str) else node
        case Variable((relation, subject)):
            return Variable(FactKey(relation, args.get(subject, subject)))
        case Sum(plus, minus):
            return Sum(
                tuple(grounded_term(t, args) for t in plus),
                tuple(grounded_term(t, args) for t in minus),
            )
        case Total(name, kind, where, of):
            return Total(name, kind, grounded(where, args), grounded_term(of, args))


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
