"""What conditions read: which values can make them hold, and whether they do in a state."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from fleet.core.model import derived
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import AT, HELD, HOLDING, LOCATED, FactKey, Literal, Value

ValueOf = Callable[[FactKey], Value]
"""The value of a variable in a state."""


def holds(literal: Literal, value_of: ValueOf, world: WorldModel) -> bool:
    """Whether a goal's literal, derived or not, holds in a state."""
    return derived.holds(literal, value_of, world, aboard=True)


def is_derived(literal: Literal, world: WorldModel) -> bool:
    """Whether a goal's literal is read off other variables, and not one itself."""
    (relation, subject), _ = literal
    return relation in (LOCATED, HELD) or (relation == AT and subject in world.objects)


def variables_read(literal: Literal, carriers: Iterable[str]) -> set[FactKey]:
    """The variables that a derived literal may be read off; `carriers` can have the subject."""
    (relation, subject), _ = literal
    found = {FactKey(AT, subject)}
    if relation != LOCATED:
        found |= {FactKey(HOLDING, carrier) for carrier in carriers}
        found |= {FactKey(AT, carrier) for carrier in carriers}
    return found
