"""Publishes the state of the simulated world, no faster than listeners can take."""

from __future__ import annotations

import asyncio
import time

from keyexpr_schema.errors import SchemaError
from keyexpr_schema.keyspace import (
    SIM_CLOCK,
    SIM_CONTACTS,
    SIM_FRAMES,
    SIM_SCENE,
    SIM_SENSES,
    SIM_TRUTH,
)
from keyexpr_schema.payloads.motions import Senses
from keyexpr_schema.payloads.simulation import (
    Frame,
    Frames,
    SimAddress,
    SimClock,
    SimRobotAddress,
    TruthAddress,
)
from keyexpr_schema.transport.session import Session
from sim.backend import Backend

CLOCK_S, CLOCK_WALL_S = 0.1, 0.05
SENSES_S, SENSES_WALL_S = 0.2, 0.1
TRUTH_S, TRUTH_WALL_S = 0.1, 0.05
"""No more often than this in simulated time, and in wall time."""
MOVED_M, TURNED_RAD = 0.005, 0.02
"""Senses that differ by less say nothing new."""
FRAME_S, FRAMES_WALL_S, FRAMES = 0.1, 0.05, 100
"""A frame is kept this often in simulated time; they go out together this often in wall time, or
as soon as there are so many."""
REPEAT_WALL_S = 1.0
"""Everything is put again after this: a put is lost silently while a router is away."""


class WorldPublisher:
    """What of a backend goes out on which key, and how often."""

    def __init__(self, session: Session, backend: Backend, speed: float | None) -> None:
        self._session, self._backend, self._speed = session, backend, speed
        self._clock_wall_s = self._senses_wall_s = self._truth_wall_s = -1.0
        self._clock_s = self._senses_s = self._truth_s = self._frame_s = -1.0
        self._senses: dict[str, Senses] = {}
        self._frames: list[Frame] = []
        self._frames_wall_s = -1.0
        self._repeat_wall_s = 0.0
        self._truths: dict[str, tuple[object, ...]] = {}
        self._contacts = (-1, -1)

    def _keep_frame(self) -> None:
        if self._backend.time_s - self._frame_s >= FRAME_S - 1e-9:
            self._frame_s = self._backend.time_s
            self._frames.append(self._backend.frame())

    def publish(self, robots: tuple[str, ...] = ()) -> None:
        """Whatever is due; of `robots`, whose motion just ended, the senses in any case."""
        self._keep_frame()
        now_s, wall_s = self._backend.time_s, time.monotonic()
        repeat = wall_s - self._repeat_wall_s >= REPEAT_WALL_S
        if repeat:
            self._repeat_wall_s = wall_s
        if (
            robots
            or repeat
            or (now_s - self._clock_s >= CLOCK_S and wall_s - self._clock_wall_s >= CLOCK_WALL_S)
        ):
            self._clock_s, self._clock_wall_s = now_s, wall_s
            self._session.put(
                SIM_CLOCK,
                SimAddress(),
                SimClock(time_s=now_s, wall_time_s=time.time(), speed=self._speed),
            )
        if repeat or (
            now_s - self._senses_s >= SENSES_S and wall_s - self._senses_wall_s >= SENSES_WALL_S
        ):
            self._senses_s, self._senses_wall_s = now_s, wall_s
            for robot in self._backend.robots:
                self._publish_senses(robot, always=repeat or robot in robots)
        else:
            for robot in robots:
                self._publish_senses(robot, always=True)
        if repeat or (
            now_s - self._truth_s >= TRUTH_S and wall_s - self._truth_wall_s >= TRUTH_WALL_S
        ):
            self._truth_s, self._truth_wall_s = now_s, wall_s
            self._publish_truth(repeat)
        elif robots:
            self._publish_truth(False)
        if repeat:
            self._frames.append(self._backend.frame())
        if self._frames and (
            repeat or len(self._frames) >= FRAMES or wall_s - self._frames_wall_s >= FRAMES_WALL_S
        ):
            self._session.put(SIM_FRAMES, SimAddress(), Frames(frames=tuple(self._frames)))
            self._frames, self._frames_wall_s = [], wall_s

    def _publish_senses(self, robot: str, *, always: bool) -> None:
        senses = self._backend.senses(robot)
        if always or _differ(self._senses.get(robot), senses):
            self._senses[robot] = senses
            self._session.put(SIM_SENSES, SimRobotAddress(robot), senses)

    def _publish_truth(self, repeat: bool) -> None:
        for truth in self._backend.truths():
            state = (truth.place, truth.support, truth.held_by, truth.settled, truth.states)
            if repeat or self._truths.get(truth.object) != state:
                self._truths[truth.object] = state
                self._session.put(SIM_TRUTH, TruthAddress(truth.object), truth)
        contacts = self._backend.contacts()
        counts = (contacts.robot_robot, contacts.robot_wall)
        if repeat or counts != self._contacts:
            self._contacts = counts
            self._session.put(SIM_CONTACTS, SimAddress(), contacts)

    async def keep_scene(self) -> None:
        """See to it that the scene is stored; again whenever a router comes back."""
        scene = self._backend.scene()
        while True:
            await self._session.wait_connected()
            connections = self._session.connections
            try:
                await self._session.confirm(SIM_SCENE, SimAddress(), scene)
            except SchemaError:
                # No store there yet: without one there is nothing to look at, either. Or the clock
                # of this host is behind that of an earlier run: it will have passed it some time.
                await asyncio.sleep(REPEAT_WALL_S)
                continue
            await self._session.wait_reconnected(connections)


def _differ(before: Senses | None, now: Senses) -> bool:
    """Whether there is news in `now`."""
    if before is None:
        return True
    (x, y, yaw), (old_x, old_y, old_yaw) = now.pose_m_rad, before.pose_m_rad
    return (
        abs(x - old_x) > MOVED_M
        or abs(y - old_y) > MOVED_M
        or abs(yaw - old_yaw) > TURNED_RAD
        or (now.place, now.holding, now.basket, now.moving)
        != (before.place, before.holding, before.basket, before.moving)
    )
