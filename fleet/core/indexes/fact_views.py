"""Mappings that read the facts of a state when asked, so that making one costs nothing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property

from fleet.core.model.derived import Inventory, carriers
from keyexpr_schema.facts import AT, ON, FactKey, Value
from keyexpr_schema.payloads.world import Fact, Feature, Object, Place


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


class Carriers(Mapping[str, tuple[str, ...]]):
    """All that something is believed to be at, on or in: the nearest first."""

    def __init__(self, facts: Mapping[FactKey, Fact], inventory: Inventory) -> None:
        self._values, self._inventory = FactValues(facts), inventory

    def __getitem__(self, subject: str) -> tuple[str, ...]:
        found = tuple(carriers(subject, self._values.get, self._inventory, aboard=True))
        if not found:
            raise KeyError(subject)
        return found

    def __iter__(self) -> Iterator[str]:
        known = (k.subject for k in self._values if k.relation == AT)
        for name in dict.fromkeys((*known, *self._inventory.objects)):
            if name in self:
                yield name

    def __len__(self) -> int:
        return sum(1 for _ in self)


class Whereabouts(Mapping[str, str]):
    """The place, or whoever has it, where something is believed to be."""

    def __init__(self, around: Carriers, objects: Mapping[str, Object]) -> None:
        self._around, self._objects = around, objects

    def __getitem__(self, subject: str) -> str:
        for carrier in self._around[subject]:
            thing = self._objects.get(carrier)
            if thing is None or thing.is_a(Feature.PERSON):
                return carrier
        raise KeyError(subject)

    def __iter__(self) -> Iterator[str]:
        return (name for name in self._around if name in self)

    def __len__(self) -> int:
        return sum(1 for _ in self)


class Resting(Mapping[str, str]):
    """The thing, the surface or the floor on or in which something is believed to lie in the place
    where it is.

    What it lay on says nothing any more once it was taken to another place.
    """

    def __init__(
        self,
        facts: Mapping[FactKey, Fact],
        around: Carriers,
        places: Mapping[str, Place],
        objects: Mapping[str, Object],
    ) -> None:
        self._facts, self._around = facts, around
        self._places, self._objects = places, objects

    @cached_property
    def _rooms(self) -> Mapping[str, str]:
        return {s.surface: place.place for place in self._places.values() for s in place.surfaces}

    def __getitem__(self, subject: str) -> str:
        where = self._around[subject][0]
        if where in self._objects and not self._objects[where].is_a(Feature.PERSON):
            return where
        surface = self._facts[FactKey(ON, subject)].value
        if (
            not isinstance(surface, str)
            or where not in self._places
            or self._rooms.get(surface, where) != where
        ):
            raise KeyError(subject)
        return surface

    def __iter__(self) -> Iterator[str]:
        return (name for name in self._around if name in self)

    def __len__(self) -> int:
        return sum(1 for _ in self)
