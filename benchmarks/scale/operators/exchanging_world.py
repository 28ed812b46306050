"""A kinematic world in which somebody exchanges batteries: a line `ROBOT PERCENT` on its standard
input does so. With that it ends, too.

`python -m benchmarks.scale.operators.exchanging_world MISSION --router ENDPOINT --realm REALM`.
"""

from __future__ import annotations

import argparse
import asyncio
import sys
from pathlib import Path

from keyexpr_schema.signals import run_until_signal
from keyexpr_schema.transport.session import SessionConfig, open_session
from sim.backend import Backend
from sim.files.mission_file import load_mission
from sim.kinematic.backend import MotionModel
from sim.server.process import make_backend
from sim.server.sim_server import SimServer

FAILING = 0.2
"""The share of grasps that fail."""


async def run(mission: Path, endpoint: str, realm: str, seed: int) -> None:
    """Serve the world, as fast as it goes, until standard input ends."""
    loaded = load_mission(mission)
    model = MotionModel(spread=0.2, failure_chance={"grasp": FAILING})
    world = make_backend(loaded, "kinematic", seed=seed, motion_model=model)
    config = SessionConfig((endpoint,), realm=realm, component="sim", connect_timeout_s=None)
    async with open_session(config) as session:
        server = SimServer(session, world, speed=None)
        serving = asyncio.create_task(server.run())
        await server.ready()
        print(f"world {loaded.world.world} running", flush=True)
        await _exchange(world)
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)


async def _exchange(world: Backend) -> None:
    lines = asyncio.StreamReader()
    loop = asyncio.get_running_loop()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(lines), sys.stdin)
    async for line in lines:
        robot, percent = line.decode().split()
        world.batteries.set_charge(robot, float(percent))


def main() -> None:
    """The command."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("mission", type=Path)
    options.add_argument("--router", required=True)
    options.add_argument("--realm", required=True)
    options.add_argument("--seed", type=int, default=0)
    given = options.parse_args()
    run_until_signal(run(given.mission, given.router, given.realm, given.seed))


if __name__ == "__main__":
    main()
