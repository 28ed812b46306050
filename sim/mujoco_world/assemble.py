"""Puts world file and robot models together into one MuJoCo model.

Names: the robot's parts are `ROBOT/part`; `object/NAME`, `furniture/NAME`, `walls/NAME` and `floor`
are bodies; `furnishing` says what furniture consists of.
An object's body has its origin at the centre of its base.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

from keyexpr_schema.payloads.robots import PoseMRad
from sim.errors import BadFile
from sim.files.solids import Solid, walls
from sim.files.world_schema import ObjectKind, WorldFile
from sim.mujoco_world.description import FixedBase, RobotModel
from sim.mujoco_world.furnishing import add_fixture, add_hollow, add_palms

STEP_S = 0.005
"""Physics step. 5 ms carries a grasp by friction with the solver settings below."""

ROUND = ("sphere", "cylinder")
SLIDING_CONDIM, ROLLING_CONDIM = 3, 6
"""Dimensions of a contact: with sliding friction, and with that of spinning and rolling as well."""

SOLREF = (0.01, 1.0)
"""Contact time constant 10 ms (stiffer than the default's 20), critically damped."""

FLOOR_RGBA = (0.86, 0.84, 0.80, 1.0)
WALL_RGBA = (0.94, 0.93, 0.90, 1.0)


def compile_world(
    world: WorldFile,
    robots: Sequence[tuple[str, RobotModel]],
    starts: Mapping[str, PoseMRad] = {},
) -> Any:
    """The `mujoco.MjModel` of everything, robots that drive at the origin, others at their
    `starts`.

    Raises:
        BadFile: MuJoCo refuses a robot's MJCF.
    """
    import mujoco

    spec = mujoco.MjSpec()
    spec.modelname = world.world
    spec.compiler.degree = False
    option = spec.option
    option.timestep = STEP_S
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    # With the pyramidal cone a held cup slips 40 mm on its way. With the elliptic one it creeps
    # 0.1 mm/s at an impratio of 10, and (with the stiff pads of the models) 0.002 mm/s at 100.
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 100.0
    # What lies about costs nothing until it is touched. What has motors never sleeps.
    option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP

    _add_floor(spec, world)
    for solid in walls(world):
        # A body each: the box around all walls holds every robot, and each would be looked at.
        _add_wall(spec.worldbody.add_body(name=f"walls/{solid.name}"), solid)
    for fixture in world.fixtures.by_name.values():
        add_fixture(spec, fixture)
    for name in world.object_entries:
        _add_object(spec.worldbody, world, name)
    for name, model in robots:
        try:
            child = mujoco.MjSpec.from_file(str(model.mjcf))
            bodies = [body.name for body in child.bodies if body.name != "world"]
            # Prefixed joints of a planar base keep world axes, as its frame is the world's.
            fixed = isinstance(model.description.base, FixedBase)
            x, y, _ = starts[name] if fixed else (0.0, 0.0, 0.0)
            frame = spec.worldbody.add_frame(pos=(x, y, 0.0))
            spec.attach(child, frame=frame, prefix=f"{name}/")
        except (ValueError, mujoco.FatalError) as error:
            raise BadFile(f"{model.mjcf}: MuJoCo refuses this model: {_line(error)}") from None
        for one, two in itertools.combinations(bodies, 2):
            # A robot's controllers keep it out of its own way.
            spec.add_exclude(bodyname1=f"{name}/{one}", bodyname2=f"{name}/{two}")
    add_palms(spec, world)
    for geom in spec.geoms:
        geom.solref[:2] = SOLREF
    try:
        return spec.compile()
    except ValueError as error:
        raise BadFile(f"MuJoCo refuses the world {world.world!r}: {_line(error)}") from None


def yaw_quaternion(yaw_rad: float) -> tuple[float, float, float, float]:
    """(w, x, y, z) of a turn about the vertical."""
    return (math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2))


def yaw_of(pose_quaternion: Any) -> float:
    """The heading of a body's x axis, radians, from its quaternion (w, x, y, z)."""
    w, x, y, z = (float(value) for value in pose_quaternion)
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def pose_in(world: WorldFile, name: str) -> tuple[tuple[float, float, float], PoseMRad]:
    """An object's start: base centre (x, y, z), and (x, y, yaw)."""
    x, y, z = world.start_point_m(name)
    return (x, y, z), (x, y, world.start_yaw_rad(name))


def _add_floor(spec: Any, world: WorldFile) -> None:
    import mujoco

    length, width = world.size_m
    spec.worldbody.add_body(name="floor", pos=(length / 2, width / 2, 0.0)).add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=(length / 2, width / 2, 1.0),
        rgba=FLOOR_RGBA,
        friction=(1.0, 0.005, 0.0001),
    )


def _add_wall(wall: Any, solid: Solid) -> None:
    import mujoco

    wall.add_geom(
        name=f"walls/{solid.name}",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=(*solid.half_m, solid.height_m / 2),
        pos=(*solid.center_m, solid.height_m / 2),
        quat=yaw_quaternion(solid.yaw_rad),
        rgba=WALL_RGBA,
    )


def _add_object(worldbody: Any, world: WorldFile, name: str) -> None:
    entry, kind = world.object_entries[name], world.kind_of(name)
    point, (_, _, yaw) = pose_in(world, name)
    body = worldbody.add_body(name=f"object/{name}", pos=point, quat=yaw_quaternion(yaw))
    body.add_freejoint(name=f"object/{name}")
    options = {"rgba": entry.rgba or kind.rgba, "friction": (0.8, 0.01, 0.001)}
    if kind.hollow:
        add_hollow(body, f"object/{name}", kind, **options)
        return
    shape, size = _shape(kind)
    body.add_geom(
        name=f"object/{name}",
        type=shape,
        size=size,
        pos=(0.0, 0.0, kind.extent_m[2] / 2),
        mass=kind.mass_kg,
        # Without resistance to rolling, what is round would roll for ever.
        condim=ROLLING_CONDIM if kind.shape in ROUND else SLIDING_CONDIM,
        **options,
    )


def _shape(kind: ObjectKind) -> tuple[Any, tuple[float, float, float]]:
    import mujoco

    length, width, height = kind.extent_m
    if kind.shape == "box":
        return mujoco.mjtGeom.mjGEOM_BOX, (length / 2, width / 2, height / 2)
    if kind.shape == "cylinder":
        return mujoco.mjtGeom.mjGEOM_CYLINDER, (length / 2, height / 2, 0.0)
    return mujoco.mjtGeom.mjGEOM_SPHERE, (length / 2, 0.0, 0.0)


def _line(error: Exception) -> str:
    return " ".join(str(error).split())
