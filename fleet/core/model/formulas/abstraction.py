"""What can be said of a formula when each variable may have one of several values.

Formulas are `expanded` here. `values_of` gives the values that a variable may have, or `None` where
it may have any; what is said holds for every combination of them, whether that can occur or not.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from itertools import product
from math import inf, prod

from fleet.core.model.derived import read_by
from fleet.core.model.formulas.evaluation import TypedInventory, conjuncts, evaluate
from fleet.core.model.formulas.nodes import (
    FALSE,
    And,
    Compare,
    Constant,
    Formula,
    Holds,
    Not,
    Or,
    Stored,
    Sum,
    Term,
    Total,
    Variable,
    atoms,
)
from keyexpr_schema.facts import FactKey, Value

ValuesOf = Callable[[FactKey], Collection[Value] | None]
MOST_COMBINATIONS = 64
"""Combinations of values that are looked at one by one."""
EITHER = (True, True)


def reads(
    node: Formula | Term, values_of: ValuesOf, world: TypedInventory, *, aboard: bool = False
) -> set[FactKey]:
    """The stored variables that the formula may depend on."""
    found: set[FactKey] = set()
    for atom in atoms(node):
        match atom:
            case Holds(literal):
                found |= read_by(literal, lambda v: values_of(v) or (), world, aboard=aboard)
            case Stored(literal):
                found.add(literal.variable)
            case Variable(key):
                found.add(key)
    return found


def outcomes(
    node: Formula, values_of: ValuesOf, world: TypedInventory, *, aboard: bool = False
) -> tuple[bool, bool]:
    """Whether the formula may hold, and whether it may not; perhaps more than is so, never less."""
    return _Abstraction(values_of, world, aboard).outcomes(node)


def domains(
    formulas: Iterable[Formula], values_of: ValuesOf, world: TypedInventory
) -> tuple[dict[FactKey, frozenset[Value]], tuple[Formula, ...]]:
    """All that the formulas say together, as `variable in {values}` where one conjunct depends on
    one variable that may have several values, and the conjuncts that are not of that form.

    What holds anyhow is left out; what cannot hold is `FALSE` among the others.
    """
    simple: dict[FactKey, frozenset[Value]] = {}
    opaque: list[Formula] = []
    for conjunct in (part for formula in formulas for part in conjuncts(formula)):
        known = {key: values_of(key) for key in reads(conjunct, values_of, world)}
        varying = [key for key, values in known.items() if values is None or len(values) != 1]
        choices = known[varying[0]] if len(varying) == 1 else None
        if len(varying) > 1 or (varying and choices is None):
            opaque.append(conjunct)
            continue
        fixed: dict[FactKey, Value] = {
            key: next(iter(values))
            for key, values in known.items()
            if values and key not in varying
        }
        if not varying:
            if not evaluate(conjunct, fixed.get, world):
                opaque.append(FALSE)
            continue
        good = frozenset(
            value
            for value in choices or ()
            if evaluate(conjunct, {**fixed, varying[0]: value}.get, world)
        )
        simple[varying[0]] = simple.get(varying[0], good) & good
    return simple, tuple(opaque)


@dataclass(frozen=True)
class _Abstraction:
    values_of: ValuesOf
    world: TypedInventory
    aboard: bool

    def outcomes(self, node: Formula) -> tuple[bool, bool]:
        match node:
            case Not(of):
                may, may_not = self.outcomes(of)
                return may_not, may
            case And(rows):
                each = [self.outcomes(row) for row in rows]
                return all(may for may, _ in each), any(may_not for _, may_not in each)
            case Or(rows):
                each = [self.outcomes(row) for row in rows]
                return any(may for may, _ in each), all(may_not for _, may_not in each)
            case Compare() if (by_range := self._by_range(node)) != EITHER:
                return by_range
            case _:
                return self._one_by_one(node)

    def _one_by_one(self, node: Formula) -> tuple[bool, bool]:
        known: dict[FactKey, Collection[Value]] = {}
        for key in reads(node, self.values_of, self.world, aboard=self.aboard):
            values = self.values_of(key)
            if values is None:
                return EITHER
            known[key] = values
        if prod(map(len, known.values())) > MOST_COMBINATIONS:
            return EITHER
        results = {
            evaluate(
                node,
                dict(zip(known, values, strict=True)).get,
                self.world,
                aboard=self.aboard,
            )
            for values in product(*known.values())
        }
        return True in results, False in results

    def _by_range(self, node: Compare) -> tuple[bool, bool]:
        (low, high, unknown), (least, most, unknown_too) = map(self._range, (node.left, node.right))
        match node.relation:
            case "<":
                may, may_not = low < most, high >= least
            case "<=":
                may, may_not = low <= most, high > least
            case ">":
                may, may_not = high > least, low <= most
            case ">=":
                may, may_not = high >= least, low < most
            case _:
                return EITHER
        return may, may_not or unknown or unknown_too

    def _range(self, term: Term) -> tuple[float, float, bool]:
        """The least and the largest number it may be, and whether it may be none."""
        match term:
            case Constant(value):
                return _range_of((value,))
            case Variable(key):
                values = self.values_of(key)
                return (-inf, inf, True) if values is None else _range_of(values)
            case Total(_, _, where, of):
                may, may_not = self.outcomes(where)
                low, high, unknown = self._range(of)
                if not may:
                    return 0, 0, False
                return (min(low, 0), max(high, 0), unknown) if may_not else (low, high, unknown)
            case Sum(plus, minus):
                added, taken = [self._range(t) for t in plus], [self._range(t) for t in minus]
                low = sum(r[0] for r in added) - sum(r[1] for r in taken)
                high = sum(r[1] for r in added) - sum(r[0] for r in taken)
                return low, high, any(r[2] for r in (*added, *taken))


def _range_of(values: Iterable[Value]) -> tuple[float, float, bool]:
    found = list(values)
    numbers = [v for v in found if isinstance(v, int | float) and not isinstance(v, bool)]
    if not numbers:
        # No comparison with what is no number holds: an empty range, which is below nothing.
        return inf, -inf, True
    return min(numbers), max(numbers), len(numbers) < len(found)
