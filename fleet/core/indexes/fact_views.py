"""Mappings that read the facts of a state when asked, so that making one costs nothing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property

from keyexpr_schema.facts import AT, ON, FactKey, Value
from keyexpr_schema.payloads.world import Fact, Place


class FactValues(Mapping[FactKey, Value]):
    """The value of each variable."""

    def __init__(self, facts: Mapping[FactKey, Fact]) -> None:
        self._facts = facts

    def __getitem__(self, key: FactKey) -> Value:
        return self._facts[key].value

    def __iter__(self) -> Iterator[FactKey]:
        return iter(self._facts)

    def __len__(self) -> int:
        return len(self._facts)


class Whereabouts(Mapping[str, str]):
    """The place, or the robot, where something is believed to be."""

    def __init__(self, facts: Mapping[FactKey, Fact]) -> None:
        self._facts = facts

    def __getitem__(self, subject: str) -> str:
        return _name(self._facts, AT, subject)

    def __iter__(self) -> Iterator[str]:
        return (
            k.subject
            for k, f in self._facts.items()
            if k.relation == AT and isinstance(f.value, str)
        )

    def __len__(self) -> int:
        return sum(1 for _ in self)


class Resting(Mapping[str, str]):
    """The surface, or the floor, on which something is believed to lie in the place where it is.

    What it lay on says nothing any more once it was taken to another place.
    """

    def __init__(self, facts: Mapping[FactKey, Fact], places: Mapping[str, Place]) -> None:
        self._facts, self._places = facts, places

    @cached_property
    def _rooms(self) -> Mapping[str, str]:
        return {s.surface: place.place for place in self._places.values() for s in place.surfaces}

    def __getitem__(self, subject: str) -> str:
        surface = _name(self._facts, ON, subject)
        where = _name(self._facts, AT, subject)
        if where not in self._places or self._rooms.get(surface, where) != where:
            raise KeyError(subject)
        return surface

    def __iter__(self) -> Iterator[str]:
        return (k.subject for k in self._facts if k.relation == ON and k.subject in self)

    def __len__(self) -> int:
        return sum(1 for _ in self)


def _name(facts: Mapping[FactKey, Fact], relation: str, subject: str) -> str:
    value = facts[FactKey(relation, subject)].value
    if not isinstance(value, str):
        raise KeyError(subject)
    return value
