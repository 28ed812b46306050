"""Which of its stances a robot takes, and who makes room for it there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import itemgetter

from sim.navigation.clearance import segment_gap
from sim.navigation.distance_field import DistanceField
from sim.navigation.errand import Errand
from sim.navigation.lattice import TRACKING_M
from sim.navigation.spots import Dock, Spots
from sim.navigation.traveller import Traveller


def choose(
    task: Errand,
    robot: Traveller,
    others: Sequence[Traveller],
    around: DistanceField,
    taken: frozenset[int],
    spots: Spots,
) -> Dock | None:
    """The best stance that a robot can go to now, with the distances `around` it; none that needs
    one of the nodes `taken`.

    `None` where there is none, or none yet: where nobody but idle robots stands in the best one,
    they are asked to leave it. Robots that finished their work stay where they did it, which is
    where the next one wants to work.
    """
    choices: list[tuple[float, Dock]] = []
    for dock in task.docks:
        if robot.floor.is_closed_at(dock.point_m):
            continue
        if dock.owned & taken or any(
            dock.owned & other.claims and not spots.way_out(other.frontier, dock.node)
            for other in others
        ):
            continue
        if math.isfinite(cost := around[dock.node] + dock.cost_m):
            choices.append((cost, dock))
    asked: Sequence[Traveller] | None = None
    for dock in task.suiting_first([dock for _, dock in sorted(choices, key=itemgetter(0))]):
        in_the_way = _in_the_way(dock, robot.radius_m, others, spots.lattice.points)
        if not in_the_way:
            return dock
        if asked is None and all(other.parked and not other.static for other in in_the_way):
            asked = in_the_way
    for other in asked or ():
        other.leaving = True
    return None


def gap_m(
    dock: Dock, radius_m: float, other: Traveller, points: Sequence[tuple[float, float]]
) -> float:
    """Least distance between a robot on its way into a stance and one at, or on its way, m.

    Nodes do not tell: beside the lattice there may be none between two stances.
    """
    stance = other.parked or other.dock
    if stance is None:
        return math.inf
    ways = ((dock.point_m, points[dock.node]), (stance.point_m, points[stance.node]))
    return segment_gap(*ways) - radius_m - other.radius_m


def _in_the_way(
    dock: Dock,
    radius_m: float,
    others: Sequence[Traveller],
    points: Sequence[tuple[float, float]],
) -> list[Traveller]:
    """Who is in a stance, or will be, that a robot in this one would touch."""
    return [other for other in others if gap_m(dock, radius_m, other, points) < 2 * TRACKING_M]
