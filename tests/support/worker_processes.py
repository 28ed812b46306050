"""A simulated world and workers as processes, in front of a test's router."""

from __future__ import annotations

import asyncio
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.child_process import end_child
from tests.support.router_process import RouterProcess
from tests.support.worker_world import DEADLINE_S
from workers.only_run import GONE_S

SIM = """
import sys
from sim.server.process import run_simulation
endpoint, speed = sys.argv[1], float(sys.argv[2])
run_simulation("two-cups", (endpoint,), backend="kinematic", speed=speed)
"""
WORKER = """
import sys
from pathlib import Path
from sim.embodiment import sim_embodiment
import workers.only_run, workers.runtime
from workers.errors import WorkerError
from workers.process import run_worker
endpoint, robot, data, gone_s = sys.argv[1:]
workers.only_run.GONE_S = float(gone_s)
workers.runtime.DRAIN_S = 240.0
try:
    run_worker(robot, (endpoint,), "robotfleet", Path(data), sim_embodiment)
except WorkerError as error:
    sys.exit(f"robotctl: {error}")
"""


WORKERS = """
import sys
import workers.process, workers.runtime
from cli.main import main
workers.runtime.DRAIN_S = 240.0
workers.process.AGAIN_S = workers.process.HELD_UP_S = workers.process.OTHERS_S = 0.3
endpoint, data, *robots = sys.argv[1:]
sys.argv = ["robotctl", "worker", *robots, "--data", data, "--router", endpoint]
main()
"""


class Processes:
    """Starts the processes of a test, and ends every one of them."""

    def __init__(self, router: RouterProcess, data_dir: Path) -> None:
        self.endpoint, self.data_dir = router.endpoint, data_dir
        self._all: list[subprocess.Popen[str]] = []

    def start(self, program: str, *args: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, "-c", program, self.endpoint, *args],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._all.append(process)
        return process

    def sim(self, speed: float) -> subprocess.Popen[str]:
        process = self.start(SIM, str(speed))
        assert process.stdout is not None
        assert "running" in process.stdout.readline()
        return process

    def worker(
        self, robot: str = "hsr", data: str = "", after_a_kill: bool = False
    ) -> subprocess.Popen[str]:
        """`after_a_kill`: one waits for the token of the worker before it as long as it takes."""
        gone_s = DEADLINE_S if after_a_kill else GONE_S
        return self.start(WORKER, robot, str(self.data_dir / data), str(gone_s))

    def end(self) -> None:
        for process in self._all:
            end_child(process)

    def workers(self, *robots: str, program: str = WORKERS) -> subprocess.Popen[str]:
        """One process for several robots."""
        return self.start(program, str(self.data_dir), *robots)


async def kill(process: subprocess.Popen[str]) -> None:
    """`kill -9`, and until it is gone: what waits for its disk dies when that has answered, and
    keeps its journal until then."""
    process.kill()
    await asyncio.to_thread(process.wait)


async def line(process: subprocess.Popen[str]) -> str:
    """What it says next; one that says nothing is killed, or its reader would wait for ever."""
    assert process.stdout is not None
    reading = asyncio.create_task(asyncio.to_thread(process.stdout.readline))
    try:
        done, _ = await asyncio.wait({reading}, timeout=DEADLINE_S)
    except BaseException:
        process.kill()
        raise
    if not done:
        process.kill()
    return (await reading).strip()


async def ready_line(process: subprocess.Popen[str]) -> str:
    """The next line but one that says that a robot is waited for: on a busy machine it takes a
    worker more than a second to see that its robot is registered."""
    while (said := await line(process)).endswith(" waits: the robot is not registered yet"):
        pass
    return said


async def ready(process: subprocess.Popen[str], robot: str = "hsr") -> str:
    """Waits for the line that says that a worker is ready; its incarnation."""
    said = await ready_line(process)
    if not said:  # it ended
        assert process.stderr is not None
        pytest.fail(await asyncio.to_thread(process.stderr.read))
    assert said.startswith(f"worker {robot} ready (incarnation {robot}-"), said
    return said.removeprefix(f"worker {robot} ready (incarnation ").removesuffix(")")
