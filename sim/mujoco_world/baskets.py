"""What lies in robots' baskets, as the sensors in them say."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from typing import Any

from sim.mujoco_world.robot_body import RobotBody

GIVES_M = 0.003
"""A thing may be that far outside of a basket's volume and lie in it: contacts give way by less."""


class Baskets:
    """The baskets of all robots, looked into once for a moment."""

    def __init__(
        self, model: Any, data: Any, robots: Iterable[RobotBody], objects: Mapping[str, int]
    ) -> None:
        """`objects` has the body of each."""
        import numpy as np

        self._data, self._objects = data, tuple(objects)
        self._bodies = np.array(list(objects.values()), dtype=int)
        with_basket = [robot for robot in robots if robot.basket >= 0]
        self._robots = [robot.name for robot in with_basket]
        self._trays = np.array([robot.basket for robot in with_basket], dtype=int)
        self._trays_m = model.site_size[self._trays][:, None] + GIVES_M  # (robots, 1, 3)
        self._found: dict[str, tuple[str, ...]] = {}
        self._at_s = -math.inf

    def contents(self) -> Mapping[str, tuple[str, ...]]:
        """By robot, where anything does, what lies in its basket, in the order of the objects."""
        data = self._data
        if self._at_s != data.time:
            self._at_s, self._found = data.time, {}
            away = data.xpos[self._bodies] - data.site_xpos[self._trays][:, None]
            local = abs(away @ data.site_xmat[self._trays].reshape(-1, 3, 3))  # (robots, n, 3)
            inside = (local <= self._trays_m).all(axis=2)
            for number in inside.any(axis=1).nonzero()[0].tolist():
                lying = itertools.compress(self._objects, inside[number].tolist())
                self._found[self._robots[number]] = tuple(lying)
        return self._found
