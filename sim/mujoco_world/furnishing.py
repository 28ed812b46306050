"""Builds furniture, people and open-topped objects as MuJoCo bodies.

Names: `furniture/NAME` is a fixture's body; `furniture/NAME/THING` is the door or drawer of it that
opens THING, with the joint of the same name and the site `furniture/NAME/THING/handle`. The geom
`furniture/NAME/button` is what a finger touches. `palm/PERSON/OBJECT` welds an object to a palm;
none of them is active at the start.
"""

from __future__ import annotations

import math
from typing import Any

from sim.files.fixtures import Fixture, Mover, Panel
from sim.files.world_schema import FLOOR_M, WALL_M, ObjectKind, WorldFile

FRICTION = (0.8, 0.005, 0.0001)
HANDLE_FRICTION = (1.2, 0.01, 0.001)
MOVER_DENSITY = 350.0
"""kg/m3: chipboard and air."""
SLIDE_DAMPING, SLIDE_FRICTION_N = 12.0, 2.0
HINGE_DAMPING, HINGE_FRICTION_NM = 1.0, 0.25
BOWL_SIDES = 12


def add_fixture(spec: Any, fixture: Fixture) -> None:
    """A piece of furniture or a person."""
    name = f"furniture/{fixture.name}"
    body = spec.worldbody.add_body(
        name=name, pos=(*fixture.center_m, 0.0), quat=_turned(fixture.yaw_rad)
    )
    for number, panel in enumerate(fixture.panels):
        is_button = fixture.button is not None and number == len(fixture.panels) - 1
        tail = "/button" if is_button else f"/{number}" if number else ""
        _add_panel(body, f"{name}{tail}", fixture, panel)
    for mover in fixture.movers:
        _add_mover(body, name, fixture, mover)
    bodies = [name, *(f"{name}/{mover.thing}" for mover in fixture.movers)]
    for k, one in enumerate(bodies):
        for two in bodies[k + 1 :]:
            spec.add_exclude(bodyname1=one, bodyname2=two)


def _add_panel(body: Any, name: str, fixture: Fixture, panel: Panel) -> Any:
    import mujoco

    kinds = {
        "box": mujoco.mjtGeom.mjGEOM_BOX,
        "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
        "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    }
    geom = body.add_geom(
        name=name,
        type=kinds[panel.shape],
        size=panel.half_m,
        pos=panel.center_m,
        rgba=fixture.colour(panel),
        friction=FRICTION,
    )
    if panel.hollow:
        geom.contype = geom.conaffinity = 0
        geom.group = 1
    return geom


def _add_mover(body: Any, name: str, fixture: Fixture, mover: Mover) -> None:
    import mujoco

    slides = mover.joint == "slide"
    name = f"{name}/{mover.thing}"
    child = body.add_body(name=name)
    child.add_joint(
        name=name,
        type=mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE,
        pos=mover.anchor_m,
        axis=mover.axis,
        range=(0.0, mover.open_at),
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        damping=SLIDE_DAMPING if slides else HINGE_DAMPING,
        frictionloss=SLIDE_FRICTION_N if slides else HINGE_FRICTION_NM,
    )
    for number, panel in enumerate(mover.panels):
        geom = _add_panel(child, f"{name}/{number}", fixture, panel)
        geom.density = MOVER_DENSITY
        if panel.center_m == mover.handle_m:
            geom.friction = HANDLE_FRICTION
    child.add_site(name=f"{name}/handle", pos=mover.handle_m, group=4)


def add_palms(spec: Any, world: WorldFile) -> None:
    """What can weld objects to palms."""
    import mujoco

    for person in world.people:
        for name in world.object_entries:
            spec.add_equality(
                name=f"palm/{person}/{name}",
                type=mujoco.mjtEq.mjEQ_WELD,
                objtype=mujoco.mjtObj.mjOBJ_BODY,
                name1=f"furniture/{person}",
                name2=f"object/{name}",
                active=False,
            )


def add_hollow(body: Any, name: str, kind: ObjectKind, **options: Any) -> None:
    """The geoms of a box or bowl that is open at its top, its origin in the middle of its base."""
    import mujoco

    length, width, height = kind.extent_m
    box = mujoco.mjtGeom.mjGEOM_BOX
    half_wall, up = WALL_M / 2, (height - FLOOR_M) / 2
    middle = FLOOR_M + up
    if kind.shape == "open_box":
        walls = [
            ((sx * (length / 2 - half_wall), 0.0, middle), (half_wall, width / 2, up), 0.0)
            for sx in (-1, 1)
        ] + [
            ((0.0, sy * (width / 2 - half_wall), middle), (length / 2, half_wall, up), 0.0)
            for sy in (-1, 1)
        ]
        floor, floor_size = box, (length / 2, width / 2, FLOOR_M / 2)
    else:
        radius = length / 2 - half_wall
        half_side = math.tan(math.pi / BOWL_SIDES) * length / 2
        walls = []
        for k in range(BOWL_SIDES):
            angle = math.tau * k / BOWL_SIDES
            at = (radius * math.cos(angle), radius * math.sin(angle), middle)
            walls.append((at, (half_wall, half_side, up), angle))
        floor = mujoco.mjtGeom.mjGEOM_CYLINDER
        floor_size = (length / 2 - half_wall, FLOOR_M / 2, 0.0)
    share = kind.mass_kg / (len(walls) + 2)
    body.add_geom(
        name=name,
        type=floor,
        size=floor_size,
        pos=(0.0, 0.0, FLOOR_M / 2),
        mass=2 * share,
        **options,
    )
    for number, (at, half, turn) in enumerate(walls):
        body.add_geom(
            name=f"{name}/{number}",
            type=box,
            size=half,
            pos=at,
            quat=_turned(turn),
            mass=share,
            **options,
        )


def _turned(yaw_rad: float) -> tuple[float, float, float, float]:
    return (math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2))
