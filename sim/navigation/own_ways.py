"""What a robot drives by itself beside the lattice, its hand at a door, is kept free of others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

from keyexpr_schema.payloads.robots import PoseMRad
from sim.files.world_schema import LARGEST_RADIUS_M
from sim.navigation.lattice import TRACKING_M, Lattice
from sim.navigation.spots import Dock, Spots
from sim.navigation.stances import gap_m
from sim.navigation.traveller import Traveller


def reserve(
    robots: Mapping[str, Traveller],
    robot: str,
    lattice: Lattice,
    points_m: Sequence[tuple[float, float]],
) -> bool:
    """See `Navigator.reserve`."""
    traveller = robots[robot]
    parked = traveller.parked
    if parked is None:
        return False
    gap = traveller.radius_m + LARGEST_RADIUS_M + 2 * TRACKING_M
    owned = parked.owned.union(*(lattice.near(a, b, gap) for a, b in pairwise(points_m)))
    if owned & _claimed_by_others(robots, robot):
        traveller.wanted = owned
        return False
    traveller.wanted = frozenset()
    traveller.parked = replace(parked, owned=owned)
    traveller.recount()
    return True


def settle(robots: Mapping[str, Traveller], robot: str, spots: Spots, pose: PoseMRad) -> None:
    """See `Navigator.settle`."""
    traveller = robots[robot]
    parked = traveller.parked
    if parked is None:
        return
    x, y, yaw = pose
    taken = _claimed_by_others(robots, robot)
    ways = spots.ways_out((x, y), traveller.radius_m)
    for node in sorted(ways, key=lambda node: node != parked.node):
        dock = spots.dock((x, y), node, traveller.radius_m, yaw)
        if not dock.owned & taken:
            traveller.parked, traveller.track, traveller.corners = dock, [node], []
            break
    else:
        traveller.parked = replace(parked, point_m=(x, y), yaw_rad=yaw)
    traveller.recount()


def way_out(
    docks: Sequence[Dock], radius_m: float, robots: Mapping[str, Traveller], lattice: Lattice
) -> Dock:
    """The way to the lattice for a robot that starts beside it: with room to itself, if any.

    Robots may start closer together than traffic would ever let them come. Then their ways out
    must at least keep clear of each other.
    """
    others, points = list(robots.values()), lattice.points
    taken = frozenset().union(*(other.claims for other in others))
    alone = [dock for dock in docks if not dock.owned & taken]
    if alone:
        return alone[0]
    return max(
        docks, key=lambda dock: min(gap_m(dock, radius_m, other, points) for other in others)
    )


def _claimed_by_others(robots: Mapping[str, Traveller], robot: str) -> frozenset[int]:
    return frozenset().union(*(other.claims for name, other in robots.items() if name != robot))
