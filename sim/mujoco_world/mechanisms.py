"""What gives way to a hand: doors, drawers and buttons, and the palms that things are given into.

Doors turn on hinges and drawers run on slides, with friction, and nothing moves them but what
touches them: a hand holds a handle by friction, as it holds a cup. A button changes over when a
robot's hand presses on it. A thing let go on a person's palm is welded to it until a hand takes it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from keyexpr_schema.facts import IS_ON, IS_OPEN
from keyexpr_schema.payloads.motions import PointM
from sim.files.solids import Solid
from sim.files.world_schema import WorldFile
from sim.mujoco_world.robot_body import RobotBody
from sim.states import ThingStates

OPEN_SHARE = 0.5
"""What is open further than this part of its way counts as open."""
AJAR_SHARE = 0.05
"""What is open further than this is in the way of those who drive."""
PRESS_N = 1.0
PROCESS_S = 0.25
"""How often it is looked what is in appliances that are on."""
RELEASED_S = 0.3
"""A finger that has been off a button for this long presses it anew."""


class Mechanisms:
    """The moving parts of a world's furniture, and its people's palms."""

    def __init__(
        self,
        model: Any,
        data: Any,
        world: WorldFile,
        robots: Mapping[str, RobotBody],
        states: ThingStates,
    ) -> None:
        import numpy as np

        self._model, self._data, self._world, self._robots = model, data, world, robots
        self.states = states
        self._joints: dict[str, int] = {}
        self._handles: dict[str, int] = {}
        for thing, (fixture, mover) in world.fixtures.movers.items():
            name = f"furniture/{fixture.name}/{thing}"
            self._joints[thing] = int(model.joint(name).qposadr[0])
            self._handles[thing] = int(model.site(f"{name}/handle").id)
            if world.starts_open(thing):
                data.qpos[self._joints[thing]] = mover.open_at
        self._equalities = {str(model.equality(number).name): number for number in range(model.neq)}
        # A geom that is a button has the thing's number, one that is a palm the person's.
        self._button = np.full(model.ngeom, -1)
        self._switched = list(world.fixtures.buttons)
        for number, thing in enumerate(self._switched):
            fixture, _ = world.fixtures.buttons[thing]
            self._button[int(model.geom(f"furniture/{fixture.name}/button").id)] = number
        self._palm = np.full(model.ngeom, -1)
        self._people = list(world.people)
        for number, name in enumerate(self._people):
            last = len(world.fixtures.by_name[name].panels) - 1
            self._palm[int(model.geom(f"furniture/{name}/{last}").id)] = number
        self._reacting = (self._button >= 0) | (self._palm >= 0)
        self._hands = np.zeros(model.ngeom, dtype=bool)
        self._object_of: dict[int, str] = {}
        for geom in range(model.ngeom):
            body = int(model.geom_bodyid[geom])
            head, _, tail = str(model.body(body).name).partition("/")
            if head in robots:
                self._hands[geom] = body in robots[head].hand_bodies
            elif head == "object":
                self._object_of[geom] = tail
        self._pressed_s: dict[str, float] = {}
        self._advanced_s = 0.0
        self.given: dict[str, str] = {}
        """What people have in their hands: by object, the person."""

    def opening(self, thing: str) -> float:
        """How far something is open, from 0 to 1."""
        _, mover = self._world.fixtures.movers[thing]
        return float(self._data.qpos[self._joints[thing]]) / mover.open_at

    def is_open(self, thing: str) -> bool:
        """Whether something is open; what does not open is."""
        return thing not in self._joints or self.opening(thing) > OPEN_SHARE

    def is_ajar(self, thing: str | None) -> bool:
        """Whether something opens, and stands open so far that it is in the way."""
        return thing is not None and thing in self._joints and self.opening(thing) > AJAR_SHARE

    def handle_m(self, thing: str) -> PointM:
        """Where the middle of a handle is now, world frame."""
        x, y, z = (float(v) for v in self._data.site_xpos[self._handles[thing]])
        return (x, y, z)

    def face_m(self, thing: str) -> PointM:
        """What one looks at to see how a thing is: its handle, its button, a person's chest."""
        if thing in self._joints:
            return self.handle_m(thing)
        if thing in self._world.fixtures.buttons:
            fixture, button = self._world.fixtures.buttons[thing]
            return fixture.point_m(button.top_m)
        return (*self._world.fixture_of[thing].center_m, 1.1)

    def state_of(self, thing: str) -> dict[str, Any]:
        """The states of a thing, as its joints are and as it has been treated."""
        found = self.states.of(thing)
        if thing in self._joints:
            found[IS_OPEN] = self.is_open(thing)
        return found

    def obstacles(self) -> tuple[Solid, ...]:
        """The doors and drawers that stand open, as upright boxes on the floor."""
        found = []
        for thing, (fixture, mover) in self._world.fixtures.movers.items():
            if not self.is_ajar(thing):
                continue
            value = self.opening(thing) * mover.open_at
            turn = fixture.yaw_rad
            if mover.joint == "hinge":
                turn += value * mover.axis[2]
            front = mover.panels[0]
            x, y, _ = fixture.point_m(mover.moved_m(front.center_m, value))
            found.append(
                Solid("door", thing, (x, y), (front.half_m[0], front.half_m[1]), turn, 1.0)
            )
            x, y, _ = self.handle_m(thing)
            found.append(Solid("handle", thing, (x, y), (0.01, 0.01), 0.0, 1.0))
        return tuple(found)

    def watch(self, time_s: float) -> None:
        """Look at the contacts of the last physics step: what was pressed, what was given."""
        if not (self._switched or self._people):
            return
        for name, person in list(self.given.items()):
            if any(robot.held == name for robot in self._robots.values()):
                self._data.eq_active[self._equalities[f"palm/{person}/{name}"]] = 0
                del self.given[name]
        geoms = self._data.contact.geom[: self._data.ncon]
        reacting = self._reacting[geoms]
        if not reacting.any():
            return
        hits = reacting.any(axis=1).nonzero()[0]
        for number in hits.tolist():
            one, two = (int(geom) for geom in geoms[number])
            for fixed, other in ((one, two), (two, one)):
                if self._button[fixed] >= 0 and self._hands[other]:
                    self._press(time_s, self._switched[int(self._button[fixed])], number)
                elif self._palm[fixed] >= 0 and other in self._object_of:
                    self._take(self._people[int(self._palm[fixed])], self._object_of[other])

    def advance(self, time_s: float, contents: Any) -> None:
        """Let appliances go on with what is in them."""
        if time_s - self._advanced_s >= PROCESS_S and self.states.processing:
            self._advanced_s = time_s
            for thing in self._joints:
                self.states.set(thing, IS_OPEN, self.is_open(thing))
            self.states.advance(time_s, contents)

    def _press(self, time_s: float, thing: str, contact: int) -> None:
        import mujoco
        import numpy as np

        force = np.zeros(6)
        mujoco.mj_contactForce(self._model, self._data, contact, force)
        if abs(float(force[0])) < PRESS_N:
            return
        before = self._pressed_s.get(thing, -math.inf)
        self._pressed_s[thing] = time_s
        if time_s - before > RELEASED_S:
            self.states.set(thing, IS_ON, self.states.get(thing, IS_ON) is not True)

    def _take(self, person: str, name: str) -> None:
        """Close a person's hand on a thing that nobody else has hold of."""
        import mujoco
        import numpy as np

        held = any(robot.held == name for robot in self._robots.values())
        if held or name in self.given or person in self.given.values():
            return
        number = self._equalities[f"palm/{person}/{name}"]
        palm = int(self._model.eq_obj1id[number])
        thing = int(self._model.eq_obj2id[number])
        data = self._data
        back, turn, away = np.zeros(4), np.zeros(4), np.zeros(3)
        mujoco.mju_negQuat(back, data.xquat[palm])
        mujoco.mju_rotVecQuat(away, data.xpos[thing] - data.xpos[palm], back)
        mujoco.mju_mulQuat(turn, back, data.xquat[thing])
        self._model.eq_data[number, :10] = [0.0, 0.0, 0.0, *away, *turn]
        data.eq_active[number] = 1
        self.given[name] = person
