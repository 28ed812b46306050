"""Which processes a fleet on this machine is made of."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from cli.processes.child_processes import ChildProcesses

if TYPE_CHECKING:
    from keyexpr_schema.payloads.robots import RobotSpec
    from sim.files.mission_file import Mission

ROUTER, RECORDER, SIM, PLANNER, WORKERS = "router", "record", "sim", "planner", "workers"


def worker_of(robot: str) -> str:
    """The name of the process that is the worker of one robot alone."""
    return f"worker-{robot}"


@dataclass(frozen=True)
class World:
    """A simulated world: the `mission` that was named as `file`, and how time runs in it."""

    file: str
    mission: Mission
    backend: str
    speed: str


@dataclass(frozen=True)
class Composition:
    """A router, a planner, a recorder, workers of `robots`, and the world that they are in.

    `data` is where what must last lies; `None`: where the processes keep it by themselves, and the
    router in `store`. No `recording`: no recorder. All workers are one process, which starts sooner
    and costs less, or are `apart`, so that one can go down without the others, and has a
    certificate of its own. With `registered`, unless they are apart, also each other robot has a
    worker, for as long as it is registered. `rolls`: what `record` takes to begin new files.
    """

    robots: tuple[RobotSpec, ...]
    recording: Path | None
    data: Path | None
    store: Path | None = None
    world: World | None = None
    apart: bool = False
    view: bool = False
    rolls: tuple[str, ...] = ()
    embodiment: str | None = None
    registered: bool = False
    planner: tuple[str, ...] = ()
    """Flags of the planner, which go before what robotctl.yaml says."""

    @property
    def names(self) -> tuple[str, ...]:
        """The robots' names."""
        return tuple(spec.robot for spec in self.robots)

    def worker_process(self, robot: str) -> str:
        """The name of the process that is a robot's worker."""
        return worker_of(robot) if self.apart else WORKERS

    def declare(self, processes: ChildProcesses) -> None:
        """Say which processes there are besides the router, and which are stopped first."""
        view = ("--view",) if self.view else ()
        if self.recording is not None:
            how = (str(self.recording), *view, *self.rolls)
            processes.declare(RECORDER, "record", *how, layer=1)
        if self.world is not None:
            pace = ("--backend", self.world.backend, "--speed", self.world.speed)
            processes.declare(SIM, "sim", self.world.file, *pace, layer=2)
        processes.declare(PLANNER, "planner", *self.planner, *self._data(PLANNER), layer=2)
        driver = () if self.embodiment is None else ("--embodiment", self.embodiment)
        groups = [(robot,) for robot in self.names] if self.apart else [self.names]
        for group in [("--all", "--follow")] if self.registered and not self.apart else groups:
            if group:
                name = self.worker_process(group[0])
                processes.declare(name, "worker", *group, *self._data(name), *driver, layer=2)

    def declare_router(self, processes: ChildProcesses) -> None:
        """Say how the router is run, which comes first."""
        listen = ("--listen", processes.endpoint)
        store = self._data(ROUTER) if self.store is None else ("--data", str(self.store))
        processes.declare(ROUTER, "router", *listen, *store)

    def _data(self, name: str) -> tuple[str, ...]:
        return () if self.data is None else ("--data", str(self.data / name))
