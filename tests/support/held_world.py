"""A simulated world that a test holds: worker processes drive in it, and it goes on when told."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

from keyexpr_schema.transport.session import SessionConfig, open_session
from sim.files.mission_file import load_mission
from sim.kinematic.backend import KinematicBackend, MotionModel
from sim.server.sim_server import SimServer
from tests.support.beside import running_beside
from tests.support.polling import until

SPEED = 10.0


class HeldWorld(KinematicBackend):
    """The kinematic world, whose time stands still while it `stands`."""

    stands = False
    stands_when: Callable[[], bool] | None = None
    """It stands still as soon as this is so."""

    def advance(self) -> None:
        """As ever, unless it stands still."""
        if not self.stands:
            super().advance()
            self.stands = self.stands_when is not None and self.stands_when()

    def let_go(self) -> None:
        """Let it go on."""
        self.stands, self.stands_when = False, None

    async def until_on_the_way_with(self, thing: str, robot: str = "hsr") -> None:
        """Let it go on until the robot holds a thing in the hallway, and stand still there."""

        def there() -> bool:
            senses = self.senses(robot)
            return (senses.place, senses.holding) == ("hallway", thing)

        self.stands_when = there
        self.stands = False
        await until(lambda: self.stands, f"{robot} to be in the hallway with {thing}")


@asynccontextmanager
async def held_world(make: Callable[..., SessionConfig]) -> AsyncIterator[HeldWorld]:
    """The world of two-cups, served as `robotctl sim` serves it."""
    mission = load_mission("two-cups")
    robots = [(robot.spec, robot.start_m_rad) for robot in mission.robots]
    world = HeldWorld(mission.world, robots, MotionModel(), step_s=0.05)
    async with open_session(make(component="sim")) as session:
        server = SimServer(session, world, SPEED)
        async with running_beside(server.run(), "the world"):
            await server.ready()
            yield world
