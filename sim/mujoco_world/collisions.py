"""Counts how often robots run into each other, or into walls and furniture.

A touch is counted once: it ends when nothing of the pair has met for half a second. Not counted:
what a robot holds or carries, the floor, a hand that is grasping or setting something down against
furniture, and a hand that reaches into another robot's basket.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sim.mujoco_world.motion import MotionRun
from sim.mujoco_world.robot_body import RobotBody

ENDS_AFTER_S = 0.5

_OTHER, _FIXED = -1, -2


class Collisions:
    """Watches the contacts of a running world."""

    def __init__(self, model: Any, data: Any, robots: Mapping[str, RobotBody]) -> None:
        import numpy as np

        self._data = data
        self._names = tuple(robots)
        self.robot_robot = 0
        self.robot_wall = 0
        self._seen_s: dict[tuple[str, str], float] = {}
        owner = np.full(model.ngeom, _OTHER)
        hand = np.zeros(model.ngeom, dtype=bool)
        self._body_names: list[str] = []
        for geom in range(model.ngeom):
            body = int(model.geom_bodyid[geom])
            name = str(model.body(body).name)
            head = name.partition("/")[0]
            self._body_names.append(head if head == "walls" else name)
            if head in robots:
                owner[geom] = self._names.index(head)
                hand[geom] = body in robots[head].hand_bodies
            elif head in ("walls", "furniture"):
                owner[geom] = _FIXED
        self._owner, self._hand = owner, hand

    def watch(self, time_s: float, runs: Mapping[str, MotionRun | None]) -> None:
        """Look at the contacts of the last physics step."""
        count = self._data.ncon
        if count == 0:
            return
        geoms = self._data.contact.geom[:count]
        one, two = self._owner[geoms[:, 0]], self._owner[geoms[:, 1]]
        # a robot with something that is not itself and that counts
        hits = ((one >= 0) & (two != _OTHER) | (two >= 0) & (one != _OTHER)) & (one != two)
        if not hits.any():
            return
        for first, second in geoms[hits].tolist():
            self._touch(time_s, first, second, runs)

    def _touch(
        self, time_s: float, first: int, second: int, runs: Mapping[str, MotionRun | None]
    ) -> None:
        if self._owner[first] < 0:
            first, second = second, first
        a, b = int(self._owner[first]), int(self._owner[second])
        name = self._names[a]
        if b == _FIXED:
            run = runs.get(name)
            if self._hand[first] and run is not None and run.handling:
                return
            pair = (name, self._body_names[second])
        else:
            other = self._names[b]
            if self._reaches_into(first, name, other, runs) or self._reaches_into(
                second, other, name, runs
            ):
                return
            pair = (name, other) if name < other else (other, name)
        last = self._seen_s.get(pair)
        self._seen_s[pair] = time_s
        if last is not None and time_s - last <= ENDS_AFTER_S:
            return
        if b == _FIXED:
            self.robot_wall += 1
        else:
            self.robot_robot += 1

    def _reaches_into(
        self, geom: int, name: str, other: str, runs: Mapping[str, MotionRun | None]
    ) -> bool:
        run = runs.get(name)
        return bool(self._hand[geom]) and run is not None and run.guest_of == other
