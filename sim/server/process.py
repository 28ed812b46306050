"""The simulation as a process: `run_simulation` is the main function of `robotctl sim`."""

from __future__ import annotations

import asyncio
import secrets
from asyncio import FIRST_COMPLETED
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from keyexpr_schema.keyspace import SIM_ALIVE
from keyexpr_schema.payloads.simulation import SimAliveAddress
from keyexpr_schema.signals import run_until_signal
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from sim.backend import Backend
from sim.errors import SimError, WorldRuns
from sim.files.mission_file import Mission, load_mission
from sim.server.sim_server import SimServer
from workers.only_run import OnlyRun

if TYPE_CHECKING:
    from sim.kinematic.backend import MotionModel

BACKENDS = ("mujoco", "kinematic")


def run_simulation(
    mission: str,
    endpoints: tuple[str, ...],
    realm: str = "robotfleet",
    backend: str = "mujoco",
    speed: float | None = 1.0,
    *,
    seed: int = 0,
    motion_model: MotionModel | None = None,
    zenoh_config: Path | None = None,
) -> None:
    """Be the simulated world of `mission` until SIGTERM or SIGINT.

    Waits for a router. Prints one line to stdout once calls are answered. `speed` is simulated
    seconds a second; `None` is as fast as it goes (see `SimServer`). `motion_model` is for the
    kinematic backend alone.

    Raises:
        BadFile: the mission, its world or one of its robots is missing or wrong.
        SimError: there is no such backend, or the speed is not above 0.
        WorldRuns: a simulated world runs in the realm already.
        InvalidId: `realm` cannot stand in a key.
    """
    if backend not in BACKENDS:
        raise SimError(f"there is no backend {backend!r}; there are {', '.join(BACKENDS)}")
    if speed is not None and not speed > 0.0:
        raise SimError(f"a speed of {speed:g} will not do; give a number above 0")
    loaded = load_mission(mission)
    config = SessionConfig(
        endpoints=endpoints,
        realm=realm,
        component="sim",
        connect_timeout_s=None,
        zenoh_config=zenoh_config,
    )
    world = make_backend(loaded, backend, seed=seed, speed=speed, motion_model=motion_model)

    async def serve() -> None:
        async with open_session(config) as session, only_world(session) as giving_way:
            server = SimServer(session, world, speed)
            serving = asyncio.create_task(server.run())
            ready = asyncio.create_task(server.ready())
            await asyncio.wait({serving, ready}, return_when=FIRST_COMPLETED)
            ready.cancel()
            print(  # noqa: T201
                f"world {loaded.world.world} running: "
                f"{_count(len(loaded.robots), 'robot')}, "
                f"{_count(len(loaded.world.object_entries), 'object')}",
                flush=True,
            )
            ended, _ = await asyncio.wait({serving, giving_way}, return_when=FIRST_COMPLETED)
            serving.cancel()
            await asyncio.gather(serving, return_exceptions=True)
            await ended.pop()

    run_until_signal(serve())


@asynccontextmanager
async def only_world(session: Session) -> AsyncIterator[asyncio.Task[None]]:
    """Be the simulated world of the realm; yields what ends if another one is before this one.

    Raises:
        WorldRuns: one is. Both would move a robot of the same name for each call of its worker.
    """

    def taken(others: str) -> WorldRuns:
        return WorldRuns(
            f"a simulated world runs in realm {session.config.realm} already ({others}): end that "
            "one, or use another --realm"
        )

    own = SimAliveAddress(f"i{secrets.token_hex(6)}")
    async with OnlyRun(session, SIM_ALIVE, own, taken).connected() as only:
        await only.settled()
        giving_way = asyncio.create_task(only.give_way())
        try:
            yield giving_way
        finally:
            giving_way.cancel()
            await asyncio.gather(giving_way, return_exceptions=True)


def make_backend(
    mission: Mission,
    backend: str,
    *,
    seed: int = 0,
    speed: float | None = None,
    motion_model: MotionModel | None = None,
) -> Backend:
    """The world of `mission` by the name of its backend.

    Raises:
        BadFile: there is no usable model for one of the robots.
    """
    robots = tuple((robot.spec, robot.start_m_rad) for robot in mission.robots)
    charge = {robot.spec.robot: robot.charge for robot in mission.robots}
    if backend == "kinematic":
        from sim.kinematic.backend import KinematicBackend

        # A world that jumps cannot keep up with a wall clock: there it goes in small steps.
        step_s = None if speed is None else 0.05
        return KinematicBackend(mission.world, robots, motion_model, seed, step_s, charge)
    from sim.mujoco_world import MujocoBackend

    folders = {robot.spec.robot: robot.folder for robot in mission.robots}
    return MujocoBackend(mission.world, robots, seed, folders, charge)


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"
