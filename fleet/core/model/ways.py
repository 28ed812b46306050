"""Which places a robot gets to, and how far it is, where closures are in the way."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from heapq import heappop, heappush
from math import inf

from keyexpr_schema.payloads.world import Place


def open_ways_m(
    places: Mapping[str, Place], shut: Collection[str], origin: str
) -> dict[str, float]:
    """The driven distance [m] from a place to every one that can be got to.

    `shut` are places, doors and zones that are not entered; who is in one of them may leave. Ways
    are put together of known ones which pass nothing that is shut (Dijkstra 1959), from the middle
    of one place to the middle of the next.
    """
    least, final = {origin: 0.0}, dict[str, float]()
    heap = [(0.0, origin)]
    while heap:
        so_far, here = heappop(heap)
        if here in final:
            continue
        final[here] = so_far
        for to, length_m in _open_from(places[here], shut):
            if to not in places or to in shut:
                continue
            if (reached := so_far + length_m) < least.get(to, inf):
                least[to] = reached
                heappush(heap, (reached, to))
    return final


def _open_from(place: Place, shut: Collection[str]) -> Iterator[tuple[str, float]]:
    known = {way.to for way in place.ways}
    for way in place.ways:
        if not any(name in shut for name in way.through):
            yield way.to, way.length_m
    for to, length_m in place.travel_m.items():
        if to not in known:  # told by somebody who did not say what it passes
            yield to, length_m
