"""Whether a condition is believed to hold, or not to, or whether nobody knows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from msgspec.structs import replace

from fleet.core.indexes.fact_views import FactValues
from fleet.core.model.derived import carriers, is_located
from fleet.core.state import State
from keyexpr_schema.facts import AT, HELD, IN, LOCATED, ON, FactKey
from keyexpr_schema.payloads.goals import Condition

PLACED = frozenset({AT, ON, IN, HELD})
"""Relations that are read off where a thing is."""


def believed(state: State, condition: Condition) -> bool | None:
    """Whether it holds, as far as is known; `None` where nobody knows of one of its subjects."""
    if condition.negated:
        holds = believed(state, replace(condition, negated=False))
        return None if holds is None else not holds
    if state.world().holds(condition):
        return True
    if condition.relation == LOCATED:
        return False
    keys = list(read_off(condition))
    told = all(is_known(state, key) for key in keys)
    return None if not told or any(_may_be(state, key, condition) for key in keys) else False


def all_believed(state: State, conditions: Iterable[Condition]) -> bool | None:
    """Whether all of them hold, as far as is known."""
    found = {believed(state, row) for row in conditions}
    return False if False in found else None if None in found else True


def _may_be(state: State, key: FactKey, condition: Condition) -> bool:
    """Whether a thing is somewhere around what it shall be on or in: in the room of that table."""
    if key.relation != AT or not isinstance(condition.value, str):
        return False
    values = FactValues(state.facts).get
    return values(key) in list(carriers(condition.value, values, state, aboard=True))


def read_off(condition: Condition) -> Iterator[FactKey]:
    """The variables that a condition is read off."""
    relation = AT if condition.relation in PLACED else condition.relation
    return (FactKey(relation, subject) for subject in condition.subjects)


def is_known(state: State, key: FactKey) -> bool:
    """Whether anything is believed of a variable."""
    values = FactValues(state.facts).get
    if key.relation == AT:
        return is_located(key.subject, values, state)
    return values(key) is not None
