"""Where robots may wait, and where they may stand to reach something."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sim.errors import NoPath, NoStance
from sim.files.solids import Solid, barriers, reserves, solids
from sim.files.world_schema import LARGEST_RADIUS_M, WorldFile
from sim.navigation.clearance import Clearance
from sim.navigation.distance_field import DistanceField
from sim.navigation.gates import bottlenecks
from sim.navigation.lattice import PITCH_M, TRACKING_M, Lattice

DOOR_M = 0.5
"""Waiting robots leave this much free beyond a door's own width, around its centre."""

FORECOURT_M = 1.0
"""Nearer than this (beyond the door's width), others have to drive around a waiting robot."""

TABLE_FRONT_M = 0.9
"""Nearer than this to a table, a waiting robot is in the way of those who work at it."""

FAR_M = 3.0
"""How far around a point that nobody can reach it is looked for the nearest free floor."""

ASKEW_M = 0.6
"""What facing furniture askew counts for, a radian: neighbours' handles are in the arm's way."""

OTHER_STANCE_M = 0.06
"""One from which an arm may get where it does not from another is so far from that."""

ANGLES_DEG = (10, 5)
"""So close to each other stances are looked for around a point: closer if there are none."""

INSIDE_M = 0.02
STANDS_OFF_M = 0.03
"""Stances are so much farther than a robot's radius from what stands there."""

DOCK_M = 1.3
"""Longest straight way from the lattice to a stance."""


@dataclass(frozen=True)
class Dock:
    """A stance beside the lattice, and the straight way to it from `node`.

    `owned` are the nodes a robot keeps to itself on that way and while it stands there.
    """

    node: int
    point_m: tuple[float, float]
    yaw_rad: float
    owned: frozenset[int]
    cost_m: float = 0.0


class Spots:
    """The places to stop at in one world."""

    def __init__(self, world: WorldFile, fixed: Sequence[Solid] = ()) -> None:
        """`fixed` stands there besides what the world file says."""
        self._fixtures = world.fixtures
        standing = (*solids(world), *fixed)
        self._clearance = Clearance(world, standing)
        self._reach = Clearance(world, barriers(world))
        driven = (*standing, *reserves(world))
        self.lattice = lattice = Lattice(world, Clearance(world, driven))
        self.obstacles: Callable[[], Sequence[Solid]] = tuple
        """What stands on the floor for the time being: open doors and drawers."""
        points = lattice.points_m
        self.by_door = np.zeros(len(points), dtype=bool)  # (n,)
        self.forecourt = np.zeros(len(points), dtype=bool)
        for door in world.doors.values():
            gap = np.linalg.norm(points - door.center_m, axis=1)
            self.by_door |= gap < door.width_m / 2 + DOOR_M
            self.forecourt |= gap < door.width_m / 2 + FORECOURT_M
        # A waiting robot must not cut the free floor in two (the way into an alcove, say).
        cuts = [self._cuts(node) for node in range(len(points))]
        self.bottlenecks = bottlenecks(lattice, cuts)
        self.by_door |= np.array(cuts, dtype=bool)
        self.at_table = np.zeros(len(points), dtype=bool)
        for top in world.surfaces():
            c, s = math.cos(top.yaw_rad), math.sin(top.yaw_rad)
            dx, dy = points[:, 0] - top.x_m, points[:, 1] - top.y_m
            along = np.maximum(np.abs(c * dx + s * dy) - top.length_m / 2, 0.0)
            across = np.maximum(np.abs(c * dy - s * dx) - top.width_m / 2, 0.0)
            self.at_table |= np.hypot(along, across) < TABLE_FRONT_M
        waiting: dict[str, list[int]] = {name: [] for name in world.place_entries}
        for node, places in enumerate(self._well_inside(world)):
            if not self.by_door[node]:
                for name in places:
                    waiting[name].append(node)
        self.waiting = {name: tuple(nodes) for name, nodes in waiting.items()}
        self._everywhere = frozenset(node for nodes in self.waiting.values() for node in nodes)
        self.retreat = lattice.field(self._everywhere)
        """Distance from each node to the nearest one where a robot may wait, m."""

    def _well_inside(self, world: WorldFile) -> Iterator[Collection[str]]:
        """The places that each node is in and not on the border of: robots stop a little off it."""
        names = [*world.place_entries, None]  # the last one is that of the number -1
        around = [frozenset(world.places_around(name)) for name in names]
        corners = [(a, b) for a in (-INSIDE_M, INSIDE_M) for b in (-INSIDE_M, INSIDE_M)]
        found = np.stack([world.places_of(self.lattice.points_m + each) for each in corners])
        for numbers in found.T.tolist():
            yield frozenset.intersection(*(around[number] for number in {*numbers}))

    def way_out(self, node: int, blocked: int) -> bool:
        """Whether one can get from `node` to a waiting spot while somebody is at `blocked`."""
        field = self.lattice.field(self._everywhere - {blocked}, frozenset({blocked}))
        return node == blocked or math.isfinite(field[node])

    def _cuts(self, node: int) -> bool:
        around = self.lattice.neighbours[node]
        if len(around) < 2:
            return True  # a dead end: who comes to work there would shut its only way out
        field = self.lattice.new_field(frozenset(around[:1]), frozenset({node}))
        # Further apart than once around a block of four: a bottleneck for all practical ends.
        return not all(field.within(other, 8 * PITCH_M) for other in around[1:])

    def waiting_spot(
        self, place: str, field: DistanceField, taken: frozenset[int], disliked: frozenset[int]
    ) -> int | None:
        """The best free node to wait at in `place`; `field` is the distance from the robot.

        `taken` are out of the question; `disliked` are those of robots that would have to move.
        """
        best: tuple[float, int] | None = None
        for node in self.waiting[place]:
            if node in taken or not math.isfinite(field[node]):
                continue
            crowd = sum(other in taken for other in self.lattice.neighbours[node])
            cost = field[node] + 2.0 * bool(self.at_table[node]) + 0.5 * crowd
            cost += 3.0 * (node in disliked) + 1.0 * bool(self.forecourt[node])
            if best is None or (cost, node) < best:
                best = (cost, node)
        return None if best is None else best[1]

    def dock(self, start_m: tuple[float, float], node: int, radius_m: float, yaw: float) -> Dock:
        """The stance at `start_m`, entered from `node`."""
        x, y = (float(v) for v in self.lattice.points_m[node])
        gap = radius_m + LARGEST_RADIUS_M + 2 * TRACKING_M
        owned = self.lattice.near((x, y), start_m, gap) | {node}
        return Dock(node, start_m, yaw, owned, math.dist((x, y), start_m))

    def ways_in(
        self, point_m: tuple[float, float], radius_m: float, reach_m: float = DOCK_M
    ) -> list[int]:
        """The nodes from which a robot can drive straight to `point_m`, nearest first."""
        gaps = np.linalg.norm(self.lattice.points_m - point_m, axis=1)
        near = np.flatnonzero(gaps <= reach_m)
        here = float(self._clearance.at(point_m))
        room = self._clearance.along(point_m, self.lattice.points_m[near])
        # Who starts close to a wall may leave it, but not come closer.
        clear = room >= min(radius_m, here - 0.01)
        ordered = near[clear][np.argsort(gaps[near[clear]], kind="stable")]
        return [int(node) for node in ordered]

    def ways_out(
        self, point_m: tuple[float, float], radius_m: float, opened: Sequence[Solid] | None = None
    ) -> list[int]:
        """As `ways_in`, and clear of what stands `opened`; if not given, for the time being."""
        opened = self.obstacles() if opened is None else opened
        return [
            node
            for node in self.ways_in(point_m, radius_m)
            if not opened or _clear(point_m, self.lattice.points_m[node], opened, radius_m)
        ]

    def stances(
        self,
        point_m: tuple[float, float, float],
        radius_m: float,
        reach_m: tuple[float, float],
        heading_rad: float | None = None,
        opened: Sequence[Solid] | None = None,
    ) -> list[Dock]:
        """Where a robot can stand facing a point with it within reach, ahead of any traffic.

        The reach counts from the robot's centre. There is no wall between stance and point.
        `heading_rad`: it has to face that way; in furniture that is open at its front only, it
        faces the back. `opened` is what stands there for the time being, if not as it does now.
        A stance is found once for each part of the lattice that it can be entered from.
        """
        opened = self.obstacles() if opened is None else opened
        low, high = reach_m
        if heading_rad is None:
            heading_rad = self._heading_into(point_m)
        if heading_rad is not None:
            distances = np.linspace(low, high, max(2, round((high - low) / 0.02) + 1))
            angles = np.array([heading_rad + math.pi])
            return self._stances_at(point_m, radius_m, distances, angles, opened)
        distances = np.linspace(low, high, max(2, round((high - low) / 0.05) + 1))
        found: list[Dock] = []
        for step in ANGLES_DEG:
            angles = np.radians(np.arange(0, 360, step))
            found = found or self._stances_at(point_m, radius_m, distances, angles, opened)
        return found

    def _stances_at(
        self,
        point_m: tuple[float, float, float],
        radius_m: float,
        distances: Any,
        angles: Any,
        opened: Sequence[Solid],
    ) -> list[Dock]:
        """As `stances`, at these distances from the point [m], in these directions [rad]."""
        x, y, z = point_m
        middle = (distances[0] + distances[-1]) / 2
        d, angle = (a.ravel() for a in np.meshgrid(distances, angles, indexing="ij"))
        points = np.stack([x + d * np.cos(angle), y + d * np.sin(angle)], axis=1)
        front = self._front_of(point_m)
        good = self._clearance.at(points) >= radius_m + STANDS_OFF_M
        good &= self._reach.along((x, y), points, above_m=z + 0.02) > 0.0
        found: list[Dock] = []
        for k in np.flatnonzero(good):
            stance = (float(points[k, 0]), float(points[k, 1]))
            parts: set[int] = set()
            for way in self.ways_out(stance, radius_m + STANDS_OFF_M, opened):
                if self.lattice.parts[way] in parts:
                    continue
                parts.add(self.lattice.parts[way])
                dock = self.dock(stance, way, radius_m, math.atan2(y - stance[1], x - stance[0]))
                off = 2.0 * abs(float(d[k]) - middle) + 0.2 * len(dock.owned)
                if front is not None:
                    off += ASKEW_M * abs(math.remainder(dock.yaw_rad - front, math.tau))
                found.append(Dock(dock.node, stance, dock.yaw_rad, dock.owned, dock.cost_m + off))
        return found

    def docks(
        self,
        point_m: tuple[float, float, float],
        radius_m: float,
        reach_m: tuple[float, float],
        heading_rad: float | None,
        part: int,
        in_vain: Sequence[tuple[float, float]],
        failed: str,
    ) -> tuple[Dock, ...]:
        """The stances that can be entered from a part of the lattice; none that it has been
        `in_vain`, if there are others. What is raised begins with `failed`.

        Raises:
            NoStance: there is no free floor at that distance, or what is open takes it up.
            NoPath: there is, and no way to it.
        """

        def found(opened: Sequence[Solid] | None) -> list[Dock]:
            docks = self.stances(point_m, radius_m, reach_m, heading_rad, opened)
            return [dock for dock in docks if self.lattice.parts[dock.node] == part]

        if docks := found(None):
            gaps = ((min(math.dist(dock.point_m, at) for at in in_vain), dock) for dock in docks)
            others = [dock for gap, dock in gaps if gap > OTHER_STANCE_M] if in_vain else docks
            return tuple(others or docks)
        standing = sorted(self.obstacles(), key=lambda solid: solid.distance_m(*point_m[:2]))
        if standing and found(()):
            names = dict.fromkeys(solid.name for solid in standing)
            alone = (n for n in names if found([solid for solid in standing if solid.name != n]))
            blocker = next(alone, standing[0].name)
            raise NoStance(f"{failed}: {blocker}, which is open, is in the way", blocker)
        if self.stances(point_m, radius_m, reach_m, heading_rad):
            raise NoPath(f"{failed}: there is no way there from where it stands")
        raise NoStance(f"{failed}: {self.why_not(point_m, radius_m, reach_m)}")

    def _heading_into(self, point_m: tuple[float, float, float]) -> float | None:
        """How to face a point in furniture under whose roof one gets from the front only."""
        roof = self._fixtures.roof_over(point_m)
        return None if roof is None else roof.inward_rad

    def _front_of(self, point_m: tuple[float, float, float]) -> float | None:
        """How one faces furniture that stands with its back to a wall, if a point is over such."""
        for fixture in self._fixtures.by_name.values():
            x, y, _ = fixture.local_m(point_m)
            over = abs(x) < fixture.half_m[0] and abs(y) < fixture.half_m[1] + fixture.front_m
            if over and fixture.kind not in ("table", "block"):
                return fixture.inward_rad
        return None

    def why_not(
        self, point_m: tuple[float, float, float], radius_m: float, reach_m: tuple[float, float]
    ) -> str:
        """Of a point without stances: how near to it one must stand, and how near one can."""
        needed = f"it must stand {reach_m[0]:.2f} to {reach_m[1]:.2f} m away"
        further = self.stances(point_m, radius_m, (reach_m[1], FAR_M))
        if not further:
            return f"{needed}, and there is no room to stand near it"
        nearest_m = min(math.dist(dock.point_m, point_m[:2]) for dock in further)
        return f"{needed}, and there is room only {nearest_m:.2f} m away"


def _clear(
    start_m: Sequence[float], end_m: Sequence[float], solids: Sequence[Solid], gap_m: float
) -> bool:
    """Whether a straight way keeps so far from solids, looked at every tenth of it."""
    for share in np.linspace(0.0, 1.0, 11):
        x = float(start_m[0] + share * (end_m[0] - start_m[0]))
        y = float(start_m[1] + share * (end_m[1] - start_m[1]))
        if any(solid.distance_m(x, y) < gap_m for solid in solids):
            return False
    return True
