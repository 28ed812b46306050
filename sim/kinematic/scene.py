"""What a viewer draws of a world without physics: boxes, a cylinder a robot, the objects.

Doors and drawers stand as the states of what they open say: open, or closed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping

from keyexpr_schema.payloads.motions import PointM
from keyexpr_schema.payloads.robots import PoseMRad
from keyexpr_schema.payloads.simulation import Body, Frame, QuaternionWxyz, Scene, Shape, ShapeKind
from sim.files.fixtures import Fixture, Fixtures, Mover, Panel
from sim.files.solids import walls
from sim.files.world_schema import WorldFile

_UPRIGHT: QuaternionWxyz = (1.0, 0.0, 0.0, 0.0)
_WALL = (0.85, 0.85, 0.82, 1.0)
_ROBOT = (0.2, 0.5, 0.55, 1.0)
_ROBOT_SIZE_M = (0.2, 0.25, 0.0)  # radius, half-height


def draw_scene(world: WorldFile, robots: tuple[str, ...]) -> Scene:
    """The shapes of walls, furniture, robots and objects."""
    bodies: list[Body] = []
    fixed: dict[str, tuple[PointM, QuaternionWxyz]] = {}
    for solid in walls(world):
        size = (solid.half_m[0], solid.half_m[1], solid.height_m / 2)
        bodies.append(_body(solid.name, None, ShapeKind.BOX, size, _WALL))
        fixed[solid.name] = ((*solid.center_m, 0.0), _turned(solid.yaw_rad))
    for fixture in world.fixtures.by_name.values():
        bodies.append(_panels(fixture.name, fixture, fixture.panels))
        fixed[fixture.name] = ((*fixture.center_m, 0.0), _turned(fixture.yaw_rad))
        for mover in fixture.movers:
            bodies.append(_panels(_mover(fixture, mover), fixture, mover.panels))
    bodies += [_body(name, name, ShapeKind.CYLINDER, _ROBOT_SIZE_M, _ROBOT) for name in robots]
    for name, entry in world.object_entries.items():
        kind = world.kind_of(name)
        length, width, height = (side / 2 for side in kind.extent_m)
        shape, size = {
            "box": (ShapeKind.BOX, (length, width, height)),
            "open_box": (ShapeKind.BOX, (length, width, height)),
            "cylinder": (ShapeKind.CYLINDER, (length, height, 0.0)),
            "bowl": (ShapeKind.CYLINDER, (length, height, 0.0)),
            "sphere": (ShapeKind.SPHERE, (length, 0.0, 0.0)),
        }[kind.shape]
        bodies.append(_body(name, name, shape, size, entry.rgba or kind.rgba))
    return Scene(world=world.world, bodies=tuple(bodies), fixed=fixed)


def draw_frame(
    time_s: float,
    robots: Mapping[str, PoseMRad],
    objects: Mapping[str, PointM],
    fixtures: Fixtures,
    opening: Callable[[str], float],
) -> Frame:
    """Where robots and objects are, every body's origin at the middle of its base; and where doors
    and drawers are, by how far things are open (0 to 1)."""
    poses: dict[str, tuple[PointM, QuaternionWxyz]] = {
        name: ((x, y, 0.0), _turned(yaw)) for name, (x, y, yaw) in robots.items()
    }
    poses |= {name: (point, _UPRIGHT) for name, point in objects.items()}
    for thing, (fixture, mover) in fixtures.movers.items():
        share = opening(thing)
        turn = share * mover.open_at * mover.axis[2] if mover.joint == "hinge" else 0.0
        origin = fixtures.moved_m(thing, (0.0, 0.0, 0.0), share)
        poses[_mover(fixture, mover)] = (origin, _turned(fixture.yaw_rad + turn))
    return Frame(time_s=time_s, poses=poses)


def _mover(fixture: Fixture, mover: Mover) -> str:
    """What the body of a door or drawer is called."""
    return f"{fixture.name}/{mover.thing}"


def _panels(name: str, fixture: Fixture, panels: Iterable[Panel]) -> Body:
    """A body in the fixture's frame."""
    shapes = tuple(
        Shape(
            kind=ShapeKind(panel.shape),
            size_m=panel.half_m,
            point_m=panel.center_m,
            quaternion_wxyz=_UPRIGHT,
            rgba=fixture.colour(panel),
        )
        for panel in panels
    )
    return Body(body=name, owner=None, shapes=shapes)


def _body(
    name: str,
    owner: str | None,
    kind: ShapeKind,
    size_m: PointM,
    rgba: tuple[float, float, float, float],
) -> Body:
    half = {ShapeKind.BOX: size_m[2], ShapeKind.SPHERE: size_m[0]}.get(kind, size_m[1])
    shape = Shape(
        kind=kind, size_m=size_m, point_m=(0.0, 0.0, half), quaternion_wxyz=_UPRIGHT, rgba=rgba
    )
    return Body(body=name, owner=owner, shapes=(shape,))


def _turned(yaw_rad: float) -> QuaternionWxyz:
    return (math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2))
