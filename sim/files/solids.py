"""What stands on the floor of a world: walls, less their doors, and furniture."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from sim.files.furniture_schema import PointXY
from sim.files.world_schema import WallEntry, WorldFile


@dataclass(frozen=True)
class Solid:
    """An upright box on the floor that nothing drives through.

    `center_m` and `half_m` (half-extents along its own axes) are (x, y); `yaw_rad` turns it.
    """

    kind: str
    name: str
    center_m: PointXY
    half_m: PointXY
    yaw_rad: float
    height_m: float

    def distance_m(self, x_m: float, y_m: float) -> float:
        """Distance of a point to the box on the floor plan; 0 inside."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        dx, dy = x_m - self.center_m[0], y_m - self.center_m[1]
        along = max(abs(c * dx + s * dy) - self.half_m[0], 0.0)
        across = max(abs(c * dy - s * dx) - self.half_m[1], 0.0)
        return math.hypot(along, across)


def solids(world: WorldFile) -> tuple[Solid, ...]:
    """Everything that stands in the way on the floor: outer walls, inner walls, furniture."""
    return (*walls(world), *_furniture(world))


def walls(world: WorldFile) -> tuple[Solid, ...]:
    """Outer and inner walls."""
    return (*_outer_walls(world), *_inner_walls(world))


def _outer_walls(world: WorldFile) -> list[Solid]:
    """Just outside the border, so that `size_m` is what is free inside."""
    (x, y), t = world.size_m, world.wall_thickness_m
    height = world.wall_height_m
    return [
        Solid("wall", "wall_south", (x / 2, -t / 2), (x / 2 + t, t / 2), 0.0, height),
        Solid("wall", "wall_north", (x / 2, y + t / 2), (x / 2 + t, t / 2), 0.0, height),
        Solid("wall", "wall_west", (-t / 2, y / 2), (t / 2, y / 2), 0.0, height),
        Solid("wall", "wall_east", (x + t / 2, y / 2), (t / 2, y / 2), 0.0, height),
    ]


def _inner_walls(world: WorldFile) -> list[Solid]:
    pieces: list[Solid] = []
    for number, wall in enumerate(world.walls):
        (x0, y0), (x1, y1) = wall.from_m, wall.to_m
        length = math.hypot(x1 - x0, y1 - y0)
        ux, uy = (x1 - x0) / length, (y1 - y0) / length
        gaps: list[tuple[float, float]] = []
        for door in world.doors.values():
            along = _along(world, wall, door.center_m)
            if along is not None:
                gaps.append((along - door.width_m / 2, along + door.width_m / 2))
        start = 0.0
        for low, high in [*sorted(gaps), (length, length)]:
            if low - start > 1e-6:
                middle, half = (start + low) / 2, (low - start) / 2
                pieces.append(
                    Solid(
                        "wall",
                        f"wall_{number}_{len(pieces)}",
                        (x0 + ux * middle, y0 + uy * middle),
                        (half, world.wall_thickness_m / 2),
                        math.atan2(uy, ux),
                        world.wall_height_m,
                    )
                )
            start = max(start, high)
    return pieces


def _along(world: WorldFile, wall: WallEntry, point_m: PointXY) -> float | None:
    """How far along a wall's line a point lies, m; `None` if it is on no part of the wall."""
    (x0, y0), (x1, y1) = wall.from_m, wall.to_m
    length = math.hypot(x1 - x0, y1 - y0)
    ux, uy = (x1 - x0) / length, (y1 - y0) / length
    dx, dy = point_m[0] - x0, point_m[1] - y0
    along, across = dx * ux + dy * uy, abs(dy * ux - dx * uy)
    return along if across <= world.wall_thickness_m and 0.0 <= along <= length else None


def doorways(world: WorldFile) -> dict[str, Solid]:
    """The opening of each door that is cut out of a wall: as wide as the door, as deep as the wall;
    of a door where walls cross, that in the first of them."""
    found = {}
    for name, door in world.doors.items():
        for wall in world.walls:
            if _along(world, wall, door.center_m) is not None:
                (x0, y0), (x1, y1) = wall.from_m, wall.to_m
                half = (door.width_m / 2, world.wall_thickness_m / 2)
                yaw = math.atan2(y1 - y0, x1 - x0)
                found[name] = Solid("door", name, door.center_m, half, yaw, world.wall_height_m)
                break
    return found


def _furniture(world: WorldFile) -> list[Solid]:
    found = []
    for name, fixture in world.fixtures.by_name.items():
        about = (fixture.yaw_rad, fixture.height_m)
        found.append(Solid(fixture.kind, name, fixture.center_m, fixture.half_m, *about))
        if fixture.kind != "lamp":
            continue
        for panel in fixture.panels:
            (x, y, z), half = panel.center_m, panel.half_m[:2]
            if panel.shape == "box" and z < OVERHEAD_M:
                found.append(Solid("lamp", name, fixture.point_m((x, y, z))[:2], half, *about))
    return found


OVERHEAD_M = 1.0
"""Robots pass under what is higher: of a lamp, its shade; not its button on a bracket."""


def barriers(world: WorldFile) -> tuple[Solid, ...]:
    """What a hand does not reach through on the level: of furniture that is open in front, its back
    and its sides, of a lamp nothing, and all else as in `solids`.

    The doors of cupboards are not counted.
    """
    found = [*walls(world)]
    for solid in _furniture(world):
        fixture = world.fixtures.by_name[solid.name]
        if solid.kind == "sink":
            level = min(carrier.center_m[2] for carrier in fixture.carriers)
            found.append(replace(solid, height_m=level))
        elif solid.kind in OPEN_IN_FRONT:
            for number, panel in enumerate(fixture.panels):
                (x, y, z), (half_x, half_y, half_z) = panel.center_m, panel.half_m
                if half_z <= FLAT_M:
                    continue
                center = fixture.point_m((x, y, 0.0))[:2]
                name = f"{solid.name}_{number}"
                found.append(
                    Solid(solid.kind, name, center, (half_x, half_y), solid.yaw_rad, z + half_z)
                )
        elif solid.kind != "lamp":
            found.append(solid)
    return tuple(found)


OPEN_IN_FRONT = ("shelf", "cupboard", "fridge", "sofa", "bed")
RESERVE_M = 0.01
"""How high reserved floor is taken to be: robots drive on it where nothing stands above it."""

FLAT_M = 0.03
"""Boards are no thicker than twice this: a hand gets over or under them."""


def reserves(world: WorldFile) -> tuple[Solid, ...]:
    """The floor that open doors and drawers take up: nobody waits or passes there."""
    found = []
    for name, fixture in world.fixtures.by_name.items():
        if fixture.front_m <= 0.0:
            continue
        # A door that is wide open stands out to its side, too.
        sides = [
            mover.moved_m(mover.handle_m, share * mover.open_at)[0]
            for mover in fixture.movers
            for share in (0.5, 0.8, 1.0)
        ]
        left, right = min(-fixture.half_m[0], *sides), max(fixture.half_m[0], *sides)
        half_y = (fixture.half_m[1] * 2 + fixture.front_m) / 2
        x, y, _ = fixture.point_m(((left + right) / 2, fixture.half_m[1] - half_y, 0.0))
        half = ((right - left) / 2, half_y)
        found.append(Solid("reserve", name, (x, y), half, fixture.yaw_rad, RESERVE_M))
    return tuple(found)
