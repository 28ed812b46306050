"""What a viewer draws: every body's shapes once, and where the bodies are."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from keyexpr_schema.payloads.motions import PointM
from keyexpr_schema.payloads.simulation import Body, Frame, QuaternionWxyz, Scene, Shape, ShapeKind

FLOOR_HALF_THICKNESS_M = 0.01
HIDDEN_GROUP = 3
"""Geoms of this group and above are for physics only, as in MuJoCo's own viewer."""


def draw_scene(model: Any, world: str, robots: Iterable[str]) -> Scene:
    """The shapes of all bodies. Bodies without any are left out; ids are those of the model."""
    owners = set(robots)
    bodies: list[Body] = []
    fixed: dict[str, tuple[PointM, QuaternionWxyz]] = {}
    walls: list[Shape] = []
    for number in range(1, model.nbody):
        shapes = tuple(
            shape
            for geom in range(
                int(model.body_geomadr[number]),
                int(model.body_geomadr[number]) + int(model.body_geomnum[number]),
            )
            if (shape := _shape(model, geom)) is not None
        )
        if not shapes:
            continue
        name = str(model.body(number).name)
        head, _, tail = name.partition("/")
        if head == "walls":
            walls.extend(shapes)  # all in one, at the origin
            continue
        owner = tail if head == "object" else head if head in owners else None
        bodies.append(Body(body=name, owner=owner, shapes=shapes))
        if int(model.body_weldid[number]) == 0:
            # everything fixed hangs on the world directly, so its local pose is its pose
            fixed[name] = (_point(model.body_pos[number]), _quaternion(model.body_quat[number]))
    if walls:
        bodies.insert(0, Body(body="walls", owner=None, shapes=tuple(walls)))
        fixed["walls"] = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    return Scene(world=world, bodies=tuple(bodies), fixed=fixed)


class FrameDrawer:
    """Reads the poses of the scene's bodies that can move."""

    def __init__(self, model: Any, data: Any, scene: Scene) -> None:
        import numpy as np

        self._data = data
        self._names = [body.body for body in scene.bodies if body.body not in scene.fixed]
        self._numbers = np.array([int(model.body(name).id) for name in self._names], dtype=int)

    def draw(self, time_s: float) -> Frame:
        """Where they are now, rounded as much as nobody sees."""
        points = self._data.xpos[self._numbers].round(5).tolist()
        turns = self._data.xquat[self._numbers].round(6).tolist()
        poses = zip(map(tuple, points), map(tuple, turns), strict=True)
        return Frame(time_s=time_s, poses=dict(zip(self._names, poses, strict=True)))


def _shape(model: Any, geom: int) -> Shape | None:
    import mujoco

    rgba = model.geom_rgba[geom]
    material = int(model.geom_matid[geom])
    if material >= 0:
        rgba = model.mat_rgba[material]
    if rgba[3] <= 0.0 or int(model.geom_group[geom]) >= HIDDEN_GROUP:
        return None
    kinds = mujoco.mjtGeom
    kind = kinds(int(model.geom_type[geom]))
    size, point = model.geom_size[geom], model.geom_pos[geom]
    drawn: tuple[ShapeKind, tuple[float, ...]]
    if kind == kinds.mjGEOM_BOX:
        drawn = (ShapeKind.BOX, tuple(size))
    elif kind == kinds.mjGEOM_CYLINDER:
        drawn = (ShapeKind.CYLINDER, (size[0], size[1], 0.0))
    elif kind == kinds.mjGEOM_CAPSULE:
        drawn = (ShapeKind.CAPSULE, (size[0], size[1], 0.0))
    elif kind == kinds.mjGEOM_SPHERE:
        drawn = (ShapeKind.SPHERE, (size[0], 0.0, 0.0))
    elif kind == kinds.mjGEOM_PLANE:
        drawn = (ShapeKind.BOX, (size[0], size[1], FLOOR_HALF_THICKNESS_M))
        point = point - (0.0, 0.0, FLOOR_HALF_THICKNESS_M)
    else:
        # ellipsoids, meshes and the like: the box around them
        drawn = (ShapeKind.BOX, tuple(model.geom_aabb[geom][3:]))
    x, y, z = (float(value) for value in drawn[1])
    r, g, b, a = (float(value) for value in rgba)
    return Shape(
        kind=drawn[0],
        size_m=(x, y, z),
        point_m=_point(point),
        quaternion_wxyz=_quaternion(model.geom_quat[geom]),
        rgba=(r, g, b, a),
    )


def _point(values: Any) -> PointM:
    x, y, z = (round(float(value), 5) for value in values)
    return (x, y, z)


def _quaternion(values: Any) -> QuaternionWxyz:
    w, x, y, z = (round(float(value), 6) for value in values)
    return (w, x, y, z)
