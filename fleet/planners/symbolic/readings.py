"""What conditions read: which values can make them hold, and whether they do in a state."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from fleet.core.model.world import WorldModel, condition_holds
from keyexpr_schema.facts import AT, HELD, HOLDING, LOCATED, FactKey, Literal, Value
from keyexpr_schema.payloads.goals import Condition

ValueOf = Callable[[FactKey], Value]
"""The value of a variable in a state."""


class _View(dict[FactKey, Value]):
    """Facts that are looked up one by one in a state."""

    def __init__(self, value_of: ValueOf) -> None:
        super().__init__()
        self._value_of = value_of

    def get(self, key: FactKey, default: Value = None) -> Value:  # type: ignore[override]
        return self._value_of(key)


def holds(literal: Literal, value_of: ValueOf) -> bool:
    """Whether a literal, derived or not, holds in a state."""
    (relation, subject), value = literal
    return condition_holds(
        _View(value_of), Condition(relation=relation, subject=subject, value=value)
    )


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
