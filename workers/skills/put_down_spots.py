"""Where to put a thing down. Pure geometry; metres, world frame."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import dist

from keyexpr_schema.payloads.motions import PointM
from keyexpr_schema.payloads.world import Place, Surface
from workers.skills.viewpoints import PointM2, cells

RIM_M = 0.08
"""Nothing is put closer to a surface's rim: half a hand's opening and some error."""
REACH_IN_M = 0.28
"""Nor deeper in than this from the nearest rim: an arm must get there over the edge."""
APART_M = 0.12
"""Least distance between things put down: a hand must get between them."""
STEP_M = 0.05
WALL_M = 0.5
"""On the floor things keep this far from a place's border, so from walls and doors."""
FURNITURE_M = 0.35
"""… and this far from furniture that has a surface."""
ROBOT_M = 0.7
"""… and this far from any robot, so that one can stand and the other can leave."""


def surface_spots(
    surface: Surface, occupied: Sequence[PointM2], robot: PointM2
) -> tuple[PointM, ...]:
    """Free spots along the rim of a surface, the one nearest to `robot` first."""
    half_l, half_w = surface.length_m / 2, surface.width_m / 2
    spots = []
    for along in _line(half_l - RIM_M):
        for across in _line(half_w - RIM_M):
            inward = min(half_l - abs(along), half_w - abs(across))
            if inward > REACH_IN_M:
                continue
            spot = surface.point_m(along, across)
            if _free(spot[:2], occupied, APART_M):
                spots.append(spot)
    return tuple(sorted(spots, key=lambda s: dist(s[:2], robot)))


def floor_spots(
    place: Place, occupied: Sequence[PointM2], robots: Sequence[PointM2], robot: PointM2
) -> tuple[PointM, ...]:
    """Free spots on the floor of a place, the one nearest to `robot` first.

    Furniture without a surface is not known here; the way to such a spot is refused by the
    embodiment, and the next one is taken.
    """
    spots = [
        (*cell, 0.0)
        for cell in cells(place, WALL_M)
        if _free(cell, occupied, APART_M)
        and _free(cell, (*robots, robot), ROBOT_M)
        and all(surface.distance_m(*cell) >= FURNITURE_M for surface in place.surfaces)
    ]
    return tuple(sorted(spots, key=lambda s: dist(s[:2], robot)))


def candidates(
    place: Place, occupied: Sequence[PointM2], robots: Sequence[PointM2], robot: PointM2
) -> tuple[PointM, ...]:
    """All spots, in the order in which to try them: the nearest surface's first, floor last."""
    nearest = sorted(place.surfaces, key=lambda s: s.distance_m(*robot))
    found = [spot for surface in nearest for spot in surface_spots(surface, occupied, robot)]
    return (*found, *floor_spots(place, occupied, robots, robot))


def away_from(
    spots: Iterable[PointM], tried: Sequence[PointM], apart_m: float
) -> tuple[PointM, ...]:
    """The spots farther than `apart_m` from every tried one: where those failed, so would these."""
    return tuple(s for s in spots if all(dist(s, t) > apart_m for t in tried))


def _free(spot: PointM2, taken: Iterable[PointM2], apart_m: float) -> bool:
    return all(dist(spot, other) >= apart_m for other in taken)


def _line(half_m: float) -> tuple[float, ...]:
    """Points from `-half_m` to `half_m`; none if the surface is narrower than its rims."""
    if half_m < 0:
        return ()
    count = max(1, int(2 * half_m / STEP_M))
    return tuple(-half_m + 2 * half_m * i / count for i in range(count + 1))
