"""Formulas that hold as soon as so many of some others do: alternatives, and counts.

"Something is in the machine" takes one thing of many, "three dishes are on the table" three. So it
need not be looked at with every thing that could count.
"""

from __future__ import annotations

from dataclasses import dataclass

from fleet.core.model.formulas.evaluation import is_number, negation
from fleet.core.model.formulas.nodes import (
    Compare,
    Constant,
    Formula,
    Not,
    Or,
    Sum,
    Term,
    Total,
)

_OPPOSITE = {"<": ">=", "<=": ">", ">": "<=", ">=": "<", "=": "!=", "!=": "="}
_MIRRORED = {"<": ">", "<=": ">=", ">": "<", ">=": "<=", "=": "=", "!=": "!="}


@dataclass(frozen=True)
class Quorum:
    """At least so many of some formulas."""

    of: tuple[Formula, ...]
    least: int


def quorums(formula: Formula) -> tuple[Quorum, ...] | None:
    """What must be met, all of it, for an `expanded` formula to hold, if it is alternatives or a
    count; else `None`.
    """
    match formula:
        case Or(rows):
            return (Quorum(rows, 1),)
        case Not(Compare(left, relation, right)) if _counted(left, right) is not None:
            return quorums(Compare(left, _OPPOSITE[relation], right))
        case Compare(left, relation, right):
            if (counted := _counted(left, right)) is not None:
                rows, number = counted
                return _met(rows, relation, number)
            if (counted := _counted(right, left)) is not None:
                rows, number = counted
                return _met(rows, _MIRRORED[relation], number)
    return None


def _counted(term: Term, number: Term) -> tuple[tuple[Formula, ...], float] | None:
    """The formulas that a term counts, and what the count is compared with."""
    if not (isinstance(term, Sum) and isinstance(number, Constant) and not term.minus):
        return None
    rows: list[Formula] = []
    for part in term.plus:
        if not (isinstance(part, Total) and not part.type and part.of == Constant(1)):
            return None
        rows.append(part.where)
    value = number.value
    return (tuple(rows), value) if is_number(value) else None


def _met(rows: tuple[Formula, ...], relation: str, number: float) -> tuple[Quorum, ...] | None:
    """What a comparison of a count with a number asks for."""
    count, whole = len(rows), int(number)
    if relation == "=":
        if whole != number:
            return (Quorum((), 1),)
        both = (_met(rows, ">=", number), _met(rows, "<=", number))
        return tuple(quorum for of in both for quorum in of or ())
    if relation == "!=":
        return None
    exactly = whole == number
    if relation in (">=", ">"):
        least = whole + (relation == ">" or not exactly) if number >= 0 else 0
        return (Quorum(rows, least),)
    most = whole - (relation == "<" and exactly) if number >= 0 else -1
    return (Quorum(tuple(map(negation, rows)), count - most),)


def directions(formula: Compare) -> tuple[tuple[Term, bool], ...]:
    """The terms of a comparison, each with whether more of it helps; a term of which both more and
    less may help stands there twice."""
    left, right = formula.left, formula.right
    if formula.relation in (">", ">="):
        return ((left, True), (right, False))
    if formula.relation in ("<", "<="):
        return ((left, False), (right, True))
    return ((left, True), (left, False), (right, True), (right, False))
