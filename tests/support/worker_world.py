"""For tests of workers: a simulated world that runs in this process, and a fleet's other half.

The world is a real `Backend`; the workers are real ones, each with a Zenoh session of its own.
Only the way between a worker and its robot's driver is short: a call instead of a query.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from pathlib import Path

from msgspec.structs import replace

from keyexpr_schema.keyspace import FACT, OBJECT, ORDER, PLACE, REPORT, ROBOT_SPEC
from keyexpr_schema.payloads.motions import Motion, MotionOutcome, MotionState, Senses
from keyexpr_schema.payloads.programs import DO, Program
from keyexpr_schema.payloads.robots import RobotAddress
from keyexpr_schema.payloads.tasks import FINAL_REPORTS, Order, OrderAddress, Report, ReportState
from keyexpr_schema.payloads.world import Fact, FactAddress, ObjectAddress, PlaceAddress
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from sim.backend import Backend
from sim.files.mission_file import Mission, load_mission
from sim.files.world_payloads import object_payloads, place_payloads
from tests.support.beside import running_beside
from tests.support.polling import DEADLINE_S
from workers.orders.journal import Journal
from workers.runtime import Worker
from workers.shared_watch import SharedWatch
from workers.skill_registry import Skill, SkillRegistry
from workers.skills.household import HOUSEHOLD

TICK_S = 0.001


class LiveWorld:
    """A backend that goes on by itself, `steps` control periods a tick."""

    def __init__(self, backend: Backend, steps: int = 5) -> None:
        self.backend = backend
        self.paused = False
        self.begun: list[tuple[str, Motion]] = []
        self.steps = steps
        self._ticked = asyncio.Event()
        self._began = asyncio.Event()

    async def run(self) -> None:
        while True:
            if not self.paused:
                for _ in range(self.steps):
                    self.backend.advance()
                self._ticked.set()
                self._ticked = asyncio.Event()
            await asyncio.sleep(TICK_S)

    def begin(self, robot: str, motion: Motion) -> None:
        self.begun.append((robot, motion))
        self.backend.begin(robot, motion)
        self._began.set()
        self._began = asyncio.Event()

    async def until_begun(self, condition: Callable[[list[tuple[str, Motion]]], bool]) -> None:
        """Wait until what the robots were told to do meets a condition."""
        async with asyncio.timeout(DEADLINE_S):
            while not condition(self.begun):
                await self._began.wait()

    async def tick(self) -> None:
        await self._ticked.wait()


class BackendBody:
    """The embodiment of one robot of a `LiveWorld`."""

    def __init__(self, world: LiveWorld, robot: str) -> None:
        self.robot = robot
        self._world = world

    async def perform(self, motion: Motion) -> MotionOutcome:
        backend = self._world.backend
        self._world.begin(self.robot, motion)
        try:
            while True:
                outcome = backend.outcome(self.robot)
                assert outcome is not None
                if outcome.state is not MotionState.RUNNING:
                    return outcome
                await self._world.tick()
        except asyncio.CancelledError:
            backend.stop(self.robot)
            raise

    async def senses(self) -> Senses:
        return self._world.backend.senses(self.robot)

    async def stop(self) -> None:
        self._world.backend.stop(self.robot)

    def now_s(self) -> float:
        return self._world.backend.time_s


class Planner:
    """The planner's side of the keys."""

    def __init__(self, session: Session, mission: Mission) -> None:
        self.session, self.mission = session, mission

    async def register(self) -> None:
        """Put places, objects and robots on their keys."""
        for place in place_payloads(self.mission.world):
            await self.session.confirm(PLACE, PlaceAddress(place.place), place)
        for thing in object_payloads(self.mission.world):
            await self.session.confirm(OBJECT, ObjectAddress(thing.object), thing)
        for robot in self.mission.robots:
            await self.session.confirm(ROBOT_SPEC, RobotAddress(robot.spec.robot), robot.spec)

    async def order(
        self,
        robot: str,
        task: str,
        skill: str,
        /,
        *,
        deadline_s: float = 600.0,
        attempt: int = 1,
        epoch: int = 1,
        revision: int = 1,
        cancelled: bool = False,
        planner: str | None = None,
        serial: int = 0,
        program: Program | None = None,
        lease_s: float = 0.0,
        **args: str,
    ) -> Order:
        """Give an order, as a planner would."""
        order = Order(
            robot=robot,
            plan="p",
            revision=revision,
            task=task,
            attempt=attempt,
            epoch=epoch,
            skill=skill,
            args={"robot": robot, **args},
            deadline_s=deadline_s,
            cancelled=cancelled,
            planner=planner,
            serial=serial,
            lease_s=lease_s,
            program=program,
        )
        await self.session.confirm(ORDER, OrderAddress(robot, "p", task), order)
        return order

    async def programmed(
        self, robot: str, code: str, *, task: str = "t1", deadline_s: float = 600.0
    ) -> Order:
        """Order a program."""
        program = Program(text="a sentence", code=code)
        return await self.order(robot, task, DO, deadline_s=deadline_s, program=program)

    async def report(
        self, order: Order, *states: ReportState, newer_than: Report | None = None
    ) -> Report:
        """The report of an order as soon as it is final, or in one of `states`."""
        fixed: dict[str, str | int] = {
            "robot": order.robot,
            "plan": order.plan,
            "task": order.task,
            "attempt": order.attempt,
        }
        async with asyncio.timeout(DEADLINE_S), self.session.watch((REPORT, fixed)) as watch:
            async for change in watch:
                if change.value is None or change.value == newer_than:
                    continue
                if change.value.state in (states or FINAL_REPORTS):
                    return change.value  # type: ignore[no-any-return]
        raise AssertionError("a watch does not end")

    async def fact(self, relation: str, subject: str) -> Fact | None:
        """A fact as it is stored now."""
        return await self.session.get(FACT, FactAddress(subject, relation))


class Fleet(Planner):
    """The planner's side of the keys, and as many workers as a test starts."""

    def __init__(
        self,
        config: Callable[..., SessionConfig],
        session: Session,
        mission: Mission,
        world: LiveWorld,
        data_dir: Path,
    ) -> None:
        super().__init__(session, mission)
        self.world = world
        self._config = config
        self._data_dir = data_dir

    @asynccontextmanager
    async def worker(
        self, robot: str, *more: Skill, skills: tuple[str, ...] = ()
    ) -> AsyncIterator[Worker]:
        """A worker that is ready; the block's end cancels it."""
        spec = next(r.spec for r in self.mission.robots if r.spec.robot == robot)
        if skills:
            spec = replace(spec, skills=(*spec.skills, *skills))
            await self.session.confirm(ROBOT_SPEC, RobotAddress(robot), spec)
        async with AsyncExitStack() as stack:
            journal = stack.enter_context(Journal(self._data_dir / f"{robot}.journal"))
            session = await stack.enter_async_context(
                open_session(self._config(component=f"worker-{robot}"))
            )
            body = BackendBody(self.world, robot)
            registry = SkillRegistry([*HOUSEHOLD, *more])
            shared = SharedWatch(session, robot)
            following = asyncio.create_task(shared.run())
            stack.callback(following.cancel)
            worker = Worker(session, spec, body, journal, registry, f"{robot}-1", shared)
            beside = running_beside(worker.run(), "the worker")
            running = await stack.enter_async_context(beside)
            ready = asyncio.create_task(worker.ready())
            try:
                async with asyncio.timeout(DEADLINE_S):
                    await asyncio.wait({running, ready}, return_when=asyncio.FIRST_COMPLETED)
                if running.done():
                    await running
                yield worker
            finally:
                ready.cancel()


MakeFleet = Callable[..., AbstractAsyncContextManager[Fleet]]
"""What the fixture `fleet_of` is."""


@asynccontextmanager
async def running_fleet(
    config: Callable[..., SessionConfig],
    data_dir: Path,
    make: Callable[[Mission], Backend],
) -> AsyncIterator[Fleet]:
    """The two-cups mission, registered, in a world that goes on."""
    mission = load_mission("two-cups")
    async with open_session(config(component="test")) as session:
        world = LiveWorld(make(mission))
        async with running_beside(world.run(), "the world"):
            fleet = Fleet(config, session, mission, world, data_dir)
            await fleet.register()
            yield fleet
