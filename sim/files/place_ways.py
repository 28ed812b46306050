"""How one gets from each place to the others, and what one passes on the way."""

from __future__ import annotations

import math

from keyexpr_schema.payloads.world import Way
from sim.files.world_schema import WorldFile
from sim.navigation.travel import TravelMap, travel_map


def place_ways(world: WorldFile) -> dict[str, tuple[Way, ...]]:
    """By place, the shortest way to every other, and, where that is not it, the shortest one
    through each door to the next place."""
    zones = {name: zone.region_m for name, zone in world.zones.items()}
    known = travel_map(world, zones)
    found = {
        name: {(way.to, way.through): way for way in _ways(world, known, name)}
        for name in known.spots
    }
    for door, entry in world.doors.items():
        others = set(world.doors) - {door}
        shut = [n for n, region in enumerate(known.regions) if region.inside & others]
        for start, end in (entry.between, entry.between[::-1]):
            for way in _ways(world, known, start, shut):
                if way.to == end and door in way.through:
                    found[start].setdefault((way.to, way.through), way)
    return {name: tuple(ways.values()) for name, ways in found.items()}


def _ways(
    world: WorldFile, known: TravelMap, start: str, shut: list[int] | None = None
) -> list[Way]:
    """The shortest ways from a place to all others, past regions that are shut."""
    lengths, before = known.ways([known.spots[start]], shut or ())
    ways = []
    for end, spot in known.spots.items():
        length = float(lengths[0, spot])
        if end == start or not math.isfinite(length):
            continue
        passed: set[str] = set()
        node = spot
        while node >= 0:
            region = known.regions[known.region_of[node]]
            passed |= region.inside | set(world.places_around(region.place))
            node = int(before[0, node])
        passed -= {end, *world.places_around(start)}
        ways.append(Way(to=end, length_m=round(length, 2), through=tuple(sorted(passed))))
    return ways
