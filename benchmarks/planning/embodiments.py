"""One kinematic world for several robots' skills, in one process: embodiments without a network."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial

from benchmarks.planning.household_world import Deed, HouseholdWorld
from keyexpr_schema.payloads.motions import Motion, MotionKind, MotionOutcome, MotionState, Senses


class SharedWorld:
    """The backend, who waits for it, and every look that anybody took."""

    def __init__(self, backend: HouseholdWorld) -> None:
        self.backend = backend
        self.looks: list[tuple[str, float, float, str]] = []
        """Place, x [m], y [m], and the robot that looked."""
        self._waiting: dict[str, asyncio.Future[MotionOutcome]] = {}

    def advance(self) -> float | None:
        """To the world's next event; the seconds that takes, or `None` while nothing moves."""
        if not self._waiting:
            return None
        before_s = self.backend.time_s
        self.backend.advance()
        for robot, waiting in list(self._waiting.items()):
            outcome = self.backend.outcome(robot)
            assert outcome is not None
            if outcome.state is not MotionState.RUNNING:
                del self._waiting[robot]
                if not waiting.done():
                    waiting.set_result(outcome)
        return self.backend.time_s - before_s

    async def perform(self, robot: str, motion: Motion) -> MotionOutcome:
        """One motion, to its end."""
        outcome = await self._to_its_end(robot, partial(self.backend.begin, robot, motion))
        if motion.kind is MotionKind.LOOK and outcome.state is MotionState.SUCCEEDED:
            senses = outcome.senses
            if senses.place is not None:
                self.looks.append((senses.place, *senses.pose_m_rad[:2], robot))
        return outcome

    async def work(self, robot: str, takes_s: float, deed: Deed) -> MotionOutcome:
        """One piece of work, to its end."""
        return await self._to_its_end(robot, partial(self.backend.begin_work, robot, takes_s, deed))

    async def _to_its_end(self, robot: str, begin: Callable[[], None]) -> MotionOutcome:
        begin()
        outcome = self.backend.outcome(robot)
        assert outcome is not None
        if outcome.state is MotionState.RUNNING:
            waiting = asyncio.get_running_loop().create_future()
            self._waiting[robot] = waiting
            try:
                outcome = await waiting
            except asyncio.CancelledError:
                self._waiting.pop(robot, None)
                self.backend.stop(robot)
                raise
        return outcome


class KinematicEmbodiment:
    """`workers.embodiment.Embodiment` for one robot of a shared world, and its work there."""

    def __init__(self, world: SharedWorld, robot: str) -> None:
        self.robot = robot
        self._world = world

    async def perform(self, motion: Motion) -> MotionOutcome:
        """Carry out `motion`; returns when it has ended."""
        return await self._world.perform(self.robot, motion)

    async def work(self, takes_s: float, deed: Deed) -> MotionOutcome:
        """Be at work for so long; what that does to the world happens at its end."""
        return await self._world.work(self.robot, takes_s, deed)

    async def perform_as(self, robot: str, motion: Motion) -> MotionOutcome:
        """A motion of a partner, to its end."""
        return await self._world.perform(robot, motion)

    async def senses(self) -> Senses:
        """What the robot knows of itself."""
        return self._world.backend.senses(self.robot)

    async def stop(self) -> None:
        """Bring the robot to rest."""
        self._world.backend.stop(self.robot)

    def now_s(self) -> float:
        """Simulated seconds."""
        return self._world.backend.time_s
