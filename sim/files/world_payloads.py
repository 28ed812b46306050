"""A world as it is registered on keys. Where objects are is not registered."""

from __future__ import annotations

from keyexpr_schema.payloads.world import Object, Place
from sim.files.world_schema import WorldFile
from sim.navigation.travel import travel_m


def place_payloads(world: WorldFile) -> tuple[Place, ...]:
    """The places, with their surfaces and the driven distances between them."""
    travel = travel_m(world)
    return tuple(
        Place(
            place=name,
            label=entry.label,
            aliases=entry.aliases,
            region_m=entry.region_m,
            surfaces=world.surfaces(name),
            travel_m=travel[name],
        )
        for name, entry in world.place_entries.items()
    )


def object_payloads(world: WorldFile) -> tuple[Object, ...]:
    """The objects: what they are, and not where."""
    counts: dict[str, int] = {}
    found = []
    for name, entry in world.object_entries.items():
        kind = world.kind_of(name)
        counts[entry.kind] = counts.get(entry.kind, 0) + 1
        found.append(
            Object(
                object=name,
                kind=entry.kind,
                label=entry.label or name.replace("_", " "),
                ordinal=counts[entry.kind],
                aliases=entry.aliases,
                mass_kg=kind.mass_kg,
                home=entry.home,
                categories=kind.categories,
                uses=kind.uses,
            )
        )
    return tuple(found)
