"""The simulation as a process: `run_simulation` is the main function of `robotctl sim`."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import TYPE_CHECKING

from keyexpr_schema.keyspace import SIM_CLOCK, SIM_SCENE
from keyexpr_schema.signals import run_until_signal
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from sim.backend import Backend
from sim.errors import SimError, WorldRuns
from sim.files.mission_file import Mission, load_mission
from sim.server.sim_server import SimServer

if TYPE_CHECKING:
    from sim.kinematic.backend import MotionModel

BACKENDS = ("mujoco", "kinematic")
CLOCK_S = 0.6
"""How long to listen for another world's clock [s, wall]; it ticks twenty times a second."""


def run_simulation(
    mission: str,
    endpoints: tuple[str, ...],
    realm: str = "robotfleet",
    backend: str = "mujoco",
    speed: float | None = 1.0,
    *,
    seed: int = 0,
    motion_model: MotionModel | None = None,
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
        endpoints=endpoints, realm=realm, component="sim", connect_timeout_s=None
    )
    world = make_backend(loaded, backend, seed=seed, speed=speed, motion_model=motion_model)

    async def serve() -> None:
        async with open_session(config) as session:
            await ensure_single_world(session)
            server = SimServer(session, world, speed)
            serving = asyncio.create_task(server.run())
            ready = asyncio.create_task(server.ready())
            await asyncio.wait({serving, ready}, return_when=asyncio.FIRST_COMPLETED)
            ready.cancel()
            print(  # noqa: T201
                f"world {loaded.world.world} running: "
                f"{_count(len(loaded.robots), 'robot')}, "
                f"{_count(len(loaded.world.object_entries), 'object')}",
                flush=True,
            )
            await serving

    run_until_signal(serve())


async def ensure_single_world(session: Session) -> None:
    """Return when no other simulation is heard; where none ever was, at once.

    Two that start at the same moment in a new realm do not hear each other here.

    Raises:
        WorldRuns: one is. Both would move a robot of the same name for each call of its worker.
    """
    if not await session.list(SIM_SCENE):
        return
    async with session.watch(SIM_CLOCK) as watch:
        with suppress(TimeoutError):
            async with asyncio.timeout(CLOCK_S):
                await anext(watch)
                raise WorldRuns(
                    f"a simulated world runs in realm {session.config.realm} already: end that "
                    "one, or use another --realm"
                )


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
    if backend == "kinematic":
        from sim.kinematic.backend import KinematicBackend

        # A world that jumps cannot keep up with a wall clock: there it goes in small steps.
        step_s = None if speed is None else 0.05
        return KinematicBackend(mission.world, robots, motion_model, seed, step_s)
    from sim.mujoco_world import MujocoBackend

    folders = {robot.spec.robot: robot.folder for robot in mission.robots}
    return MujocoBackend(mission.world, robots, seed, folders)


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"
