"""Reads the physical world: who touches what, where things rest, what a camera sees."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Any

from keyexpr_schema.payloads.motions import Detection
from keyexpr_schema.payloads.simulation import Truth
from keyexpr_schema.payloads.world import Object
from sim.files.world_schema import FLOOR, FLOOR_M, WorldFile
from sim.mujoco_world.baskets import Baskets
from sim.mujoco_world.carriers import Carriers
from sim.mujoco_world.mechanisms import Mechanisms
from sim.mujoco_world.robot_body import RobotBody

SETTLED_M_S = 0.02
SETTLED_RAD_S = 0.3
POINTS = tuple((up, across) for up in (0.15, 0.5, 0.85) for across in (-1.0, 0.0, 1.0))
"""Of a thing that is looked at: shares of its height, and of its half width to either side."""

VISIBLE = 3
"""A thing is recognised when so many of its `POINTS` can be seen."""

NEAR_ENOUGH_M = 0.5
"""The base of an object can be that much farther off than its middle."""

NOISE_M = 0.003
"""Standard deviation of a seen point, each axis in the plane: what an RGB-D camera gives at 2 m."""


SPOT_M = 0.08
"""What is less than twice as long has room for one thing only."""


class Observer:
    """Truths, and what the robots' sensors get of them. `seed` makes the cameras' noise."""

    def __init__(
        self,
        model: Any,
        data: Any,
        world: WorldFile,
        robots: Mapping[str, RobotBody],
        things: Mapping[str, Object],
        mechanisms: Mechanisms,
        seed: int,
    ) -> None:
        import numpy as np

        self._model, self._data, self._world, self._robots = model, data, world, robots
        self._mechanisms = mechanisms
        self._carriers = Carriers(model, data, world, mechanisms)
        self.noticed = {
            name: things[name].kind
            for name in things
            if name in world.fixtures.movers
            or name in world.fixtures.buttons
            or name in world.people
        }
        """Furniture whose states can be seen, and people, with their kinds."""
        self._random = np.random.default_rng(seed)
        self._objects = {
            name: int(model.body(f"object/{name}").id) for name in world.object_entries
        }
        self._bodies = np.array(list(self._objects.values()), dtype=int)
        first = model.body_dofadr[self._bodies].reshape(-1, 1)
        self._dofs = first + np.arange(6)  # (n, 6): of all objects, velocities and turning rates
        self._baskets = Baskets(model, data, robots.values(), self._objects)
        self._trees = model.body_treeid[self._bodies]
        self._asleep = data.tree_asleep[self._trees] >= 0
        self._at_rest: dict[str, set[tuple[str, str]]] = {}
        """What objects touched when they fell asleep: while they sleep, contacts are not listed."""
        self._of_geom: dict[int, tuple[str, str]] = {}
        self._pads = {pad: robot.name for robot in robots.values() for pad in robot.pads}
        for geom in range(model.ngeom):
            body = str(model.body(int(model.geom_bodyid[geom])).name)
            head, _, tail = body.partition("/")
            if head == "object":
                self._of_geom[geom] = ("object", tail)
            elif head == "furniture":
                self._of_geom[geom] = ("surface", tail.partition("/")[0])
            elif body == "floor":
                self._of_geom[geom] = ("surface", FLOOR)
            elif head in robots:
                self._of_geom[geom] = ("robot", head)
            else:
                self._of_geom[geom] = ("other", body)

    def base_point(self, object: str) -> tuple[float, float, float]:
        """The centre of an object's base, world frame."""
        x, y, z = (float(v) for v in self._data.xpos[self._objects[object]])
        return (x, y, z)

    def opening_rad(self, object: str) -> float | None:
        """The heading along which fingers shall open around it; `None` for a round thing."""
        kind = self._world.kind_of(object)
        if kind.shape not in ("box", "open_box"):
            return None
        frame = self._data.xmat[self._objects[object]].reshape(3, 3)
        length, width, _ = kind.extent_m
        axis = frame[:, 1] if width <= length else frame[:, 0]
        return math.atan2(float(axis[1]), float(axis[0]))

    def basket(self, robot: RobotBody) -> tuple[str, ...]:
        """What lies in a robot's basket and not on anything in it, in the world file's order."""
        lying = self._baskets.contents().get(robot.name, ())
        return tuple(name for name in lying if self._carriers.object_below(name, lying) is None)

    def note_sleepers(self) -> None:
        """Take down what objects touch that fell asleep in this physics step."""
        asleep = self._data.tree_asleep[self._trees] >= 0
        if asleep.tobytes() == self._asleep.tobytes():  # numpy compares in ten times as long
            return
        fell, self._asleep = asleep & ~self._asleep, asleep
        for name in itertools.compress(self._objects, (~asleep).tolist()):
            self._at_rest.pop(name, None)
        if fell.any():
            touching = self._contacts()
            for name in itertools.compress(self._objects, fell.tolist()):
                self._at_rest[name] = touching[name]

    def touching(self) -> dict[str, set[tuple[str, str]]]:
        """What each object touches: `("pad", robot)`, `("robot", r)`, `("surface", s)`, …

        Two pads of one hand are two entries, `("pad", "hsr:0")` and `("pad", "hsr:1")`.
        """
        return {
            name: self._at_rest.get(name, set()) | now for name, now in self._contacts().items()
        }

    def _contacts(self) -> dict[str, set[tuple[str, str]]]:
        found: dict[str, set[tuple[str, str]]] = {name: set() for name in self._objects}
        for one, two in self._data.contact.geom[: self._data.ncon].tolist():
            for geom, other in ((one, two), (two, one)):
                kind, name = self._of_geom[geom]
                if kind != "object":
                    continue
                if other in self._pads:
                    robot = self._pads[other]
                    number = self._robots[robot].pads.index(other)
                    found[name].add(("pad", f"{robot}:{number}"))
                else:
                    found[name].add(self._of_geom[other])
        return found

    def truths(self, time_s: float) -> tuple[Truth, ...]:
        """Where every object really is, and how everything is that has states."""
        supports, touching = self._supports()
        points_m = self._data.xpos[self._bodies].tolist()
        speeds = self._data.qvel[self._dofs].tolist()
        found = []
        for name, (x, y, z), speed in zip(self._objects, points_m, speeds, strict=True):
            support = supports[name]
            found.append(
                Truth(
                    object=name,
                    kind=self._world.object_entries[name].kind,
                    time_s=time_s,
                    point_m=(x, y, z),
                    place=self._world.place_at(x, y),
                    support=support,
                    held_by=self._holder(touching[name]) if support is None else None,
                    settled=math.hypot(*speed[:3]) < SETTLED_M_S
                    and math.hypot(*speed[3:]) < SETTLED_RAD_S,
                    states=self._mechanisms.state_of(name),
                )
            )
        for name, kind in self.noticed.items():
            x, y = self._world.fixture_of[name].center_m
            found.append(
                Truth(
                    object=name,
                    kind=kind,
                    time_s=time_s,
                    point_m=(x, y, 0.0),
                    place=self._world.place_at(x, y),
                    support=FLOOR,
                    held_by=None,
                    settled=True,
                    states=self._mechanisms.state_of(name),
                )
            )
        return tuple(found)

    def spots_on(self, object: str) -> list[tuple[float, float, float]]:
        """Points on or in an object that carries others, its middle first, world frame."""
        length, width, _ = self._world.kind_of(object).extent_m
        along = [0.0] if length < SPOT_M * 2 else [-length / 4, length / 4]
        across = [0.0] if width < SPOT_M * 2 else [-width / 4, width / 4]
        x, y, z = self.base_point(object)
        kind = self._world.kind_of(object)
        frame = self._data.xmat[self._objects[object]].reshape(3, 3)
        level = FLOOR_M if kind.hollow else kind.extent_m[2]
        found = []
        for a in along:
            for b in across:
                dx, dy, dz = (float(v) for v in frame @ (a, b, level))
                found.append((x + dx, y + dy, z + dz))
        return found

    def rim_m(self, point_m: tuple[float, float, float]) -> float | None:
        """How high the edge is over which a hand gets to a point in a drawer or a basin [m]."""
        for name, fixture in self._world.fixtures.by_name.items():
            thing = self._carriers.at_fixture(name, point_m)
            if thing is None:
                continue
            carrier = self._world.fixtures.carriers[thing][1]
            if carrier.inside and not carrier.roofed:
                mover = fixture.mover(thing)
                if mover is None:
                    return fixture.height_m
                front = mover.panels[0]
                return front.center_m[2] + front.half_m[2]
        return None

    def contents(self, carrier: str) -> list[str]:
        """What is directly on or in a thing."""
        return [name for name, support in self._supports()[0].items() if support == carrier]

    def _supports(self) -> tuple[dict[str, str | None], dict[str, set[tuple[str, str]]]]:
        """What carries each object directly, and what it touches."""
        touching = self.touching()
        baskets = {
            name: robot
            for robot in self._baskets.contents()
            for name in self.basket(self._robots[robot])
        }
        return {
            name: self._support(name, baskets.get(name), touching) for name in self._objects
        }, touching

    def _support(
        self,
        name: str,
        basket: str | None,
        touching: Mapping[str, set[tuple[str, str]]],
        above: frozenset[str] = frozenset(),
    ) -> str | None:
        """What carries an object: a hand that a person holds it in, a box that it is in, a basket,
        furniture, or what carries the object that it lies on."""
        if name in self._mechanisms.given:
            return self._mechanisms.given[name]
        touches = touching[name]
        others = sorted(other for kind, other in touches if kind == "object")
        below = self._carriers.object_below(name, others)
        if below is not None:
            return below
        if basket is not None:
            return basket if others or ("robot", basket) in touches else None
        surfaces = sorted(surface for kind, surface in touches if kind == "surface")
        if surfaces:
            point = self.base_point(name)
            found = [self._carriers.at_fixture(surface, point) for surface in surfaces]
            return next((one for one in found if one is not None), surfaces[0])
        for other in others:
            if other not in above:
                support = self._support(other, None, touching, above | {name})
                # What it has in it does not carry it.
                if support is not None and support not in above | {name}:
                    return support
        return None

    def _holder(self, touches: set[tuple[str, str]]) -> str | None:
        for name in sorted({pad.rpartition(":")[0] for kind, pad in touches if kind == "pad"}):
            pads = range(len(self._robots[name].pads))
            if all(("pad", f"{name}:{number}") in touches for number in pads):
                return name
        return None

    def in_view(self, robot: RobotBody) -> list[str]:
        """The objects ahead of a robot's camera and not too far off: those worth a closer look."""
        import numpy as np

        camera = robot.description.camera
        if camera is None or not self._objects:
            return []
        away = self._data.xpos[self._bodies] - self._data.site_xpos[robot.camera]  # (n, 3) m
        reach_m = robot.spec.capabilities.get("see", 0.0) + NEAR_ENOUGH_M
        near = (away**2).sum(axis=1) <= reach_m**2
        x, y, _ = self._data.site_xmat[robot.camera].reshape(3, 3)[:, 0]
        bearing = np.arctan2(x * away[:, 1] - y * away[:, 0], x * away[:, 0] + y * away[:, 1])
        near &= abs(bearing) <= math.radians(camera.fov_deg) / 2 + 1e-6
        return list(itertools.compress(self._objects, near.tolist()))

    def sees(self, robot: RobotBody, object: str) -> bool:
        """Whether a robot's camera sees an object now: in range, in its field of view, not hidden.

        Rays go from the camera to points around the object's upper and lower half.
        """
        import mujoco
        import numpy as np

        camera = robot.description.camera
        if camera is None:
            return False
        eye = np.array(self._data.site_xpos[robot.camera])
        ahead = self._data.site_xmat[robot.camera].reshape(3, 3)[:, 0]
        base = np.array(self.base_point(object))
        length, width, height = self._world.kind_of(object).extent_m
        to = base + np.array([0.0, 0.0, height / 2]) - eye
        if np.linalg.norm(to) > robot.spec.capabilities.get("see", 0.0):
            return False
        bearing = math.atan2(
            ahead[0] * to[1] - ahead[1] * to[0], ahead[0] * to[0] + ahead[1] * to[1]
        )
        if abs(bearing) > math.radians(camera.fov_deg) / 2:
            return False
        side = np.array([-to[1], to[0], 0.0]) / max(math.hypot(to[0], to[1]), 1e-6)
        half = 0.4 * min(length, width)
        upwards = self._data.xmat[self._objects[object]].reshape(3, 3)[:, 2]
        own_head = int(self._model.site_bodyid[robot.camera])
        geom = np.zeros(1, dtype=np.int32)
        hits = 0
        for number, (up, across) in enumerate(POINTS):
            if hits + len(POINTS) - number < VISIBLE:
                return False
            ray = base + upwards * (up * height) + across * half * side - eye
            mujoco.mj_ray(self._model, self._data, eye, ray, None, 1, own_head, geom)
            hits += self._of_geom.get(int(geom[0])) == ("object", object)
            if hits == VISIBLE:
                return True
        return False

    def detect(self, robot: RobotBody, object: str) -> Detection:
        """What the camera reports of an object that it sees (see `sees`)."""
        x, y, z = self.base_point(object)
        dx, dy = (float(v) for v in self._random.normal(0.0, NOISE_M, 2))
        x, y = x + dx, y + dy
        entry = self._world.object_entries[object]
        return Detection(
            object=object,
            kind=entry.kind,
            point_m=(x, y, z),
            place=self._world.place_at(x, y),
            support=self._seen_support(object, x, y, z),
            states=self._mechanisms.state_of(object),
        )

    def _seen_support(self, object: str, x: float, y: float, z: float) -> str:
        if object in self._mechanisms.given:
            return self._mechanisms.given[object]
        below = self._carriers.object_below(object, self._objects)
        if below is not None:
            return below
        for other in self._robots.values():
            if other.held == object or object in self.basket(other):
                return other.name
        for fixture in self._world.fixtures.by_name:
            carrier = self._carriers.at_fixture(fixture, (x, y, z), above_m=0.06)
            if carrier is not None:
                return carrier
        return FLOOR

    def notices(self, robot: RobotBody, thing: str) -> bool:
        """Whether a robot's camera sees furniture or a person well enough to tell its states."""
        import mujoco
        import numpy as np

        camera = robot.description.camera
        if camera is None:
            return False
        eye = np.array(self._data.site_xpos[robot.camera])
        ahead = self._data.site_xmat[robot.camera].reshape(3, 3)[:, 0]
        ray = np.array(self._mechanisms.face_m(thing)) - eye
        if np.linalg.norm(ray) > robot.spec.capabilities.get("see", 0.0):
            return False
        bearing = math.atan2(
            ahead[0] * ray[1] - ahead[1] * ray[0], ahead[0] * ray[0] + ahead[1] * ray[1]
        )
        if abs(bearing) > math.radians(camera.fov_deg) / 2:
            return False
        geom = np.zeros(1, dtype=np.int32)
        own_head = int(self._model.site_bodyid[robot.camera])
        # A little further, so as to end in it and not before it.
        mujoco.mj_ray(self._model, self._data, eye, 1.05 * ray, None, 1, own_head, geom)
        owner = self._world.fixture_of[thing].name
        return self._of_geom.get(int(geom[0])) == ("surface", owner)

    def detect_fixture(self, thing: str) -> Detection:
        """What the camera reports of furniture or a person that it notices."""
        movers = self._world.fixtures.movers
        opening = self._mechanisms.opening(thing) if thing in movers else 0.0
        x, y = self._world.fixture_of[thing].center_m
        return Detection(
            object=thing,
            kind=self.noticed[thing],
            point_m=self._world.fixtures.face_m(thing, opening),
            place=self._world.place_at(x, y),
            states=self._mechanisms.state_of(thing),
        )
