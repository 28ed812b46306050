"""What `robotctl up` was asked for, and the fleet that this makes."""

from __future__ import annotations

import getpass
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from cli.errors import BadArgument, check_known
from cli.processes.child_processes import ChildProcesses, free_endpoint
from cli.processes.composition import ROUTER, Composition, World
from cli.processes.data_folder import data_folder
from cli.processes.fleet_up import FleetUp
from cli.processes.run_folder import DATA, RECORDING, claim_folder, claim_run_folder, new_run_folder
from cli.settings import Settings
from keyexpr_schema.payloads.robots import RobotSpec
from sim.files.mission_file import Mission, load_mission
from sim.files.robot_file import load_robot
from sim.server.process import BACKENDS

if TYPE_CHECKING:
    from cli.certificates.fleet_certificates import FleetCertificates

ROLLS = ("--roll-every", "500MB", "--keep", "10")
"""A fleet is up for months; the disk has an end."""


@dataclass(frozen=True)
class UpOptions:
    """A mission, or files of robots, or neither: then the robots that are registered.

    `folder`: where logs and the recording go, and what a simulated fleet keeps. `secure`: over TLS,
    with certificates on both sides.
    """

    mission: str | None
    files: tuple[str, ...]
    folder: Path | None
    backend: str
    speed: str
    embodiment: str
    record: bool
    secure: bool = False

    @property
    def title(self) -> str:
        """What is started, for a person."""
        return self.mission or (
            f"a fleet of {', '.join(self.files)}" if self.files else "the fleet"
        )

    def arguments(self) -> tuple[str, ...]:
        """The command line that says the same."""
        named = self.files if self.mission is None else (self.mission,)
        return (
            *named,
            *(("--robots",) if self.files else ()),
            *(() if self.folder is None else ("--dir", str(self.folder))),
            *("--backend", self.backend, "--speed", self.speed),
            *("--embodiment", self.embodiment),
            "--record" if self.record else "--no-record",
            *(("--secure",) if self.secure else ()),
        )

    def read(self) -> tuple[Mission | None, tuple[RobotSpec, ...]]:
        """The mission and the robots of the files that are named.

        Raises:
            BadArgument: two files are of one robot.
            BadFile: the mission or a robot's file is missing or wrong.
            Unknown: there is no such backend.
        """
        check_known("backend", self.backend, BACKENDS)
        mission = None if self.mission is None else load_mission(self.mission)
        specs = tuple(load_robot(file) for file in self.files)
        names = [spec.robot for spec in specs]
        for name in names:
            if names.count(name) > 1:
                raise BadArgument(
                    f"two of the files are of a robot {name!r}: register the second with "
                    "`robotctl register FILE --as NAME`, and `robotctl up` takes it in, too"
                )
        return mission, specs

    def fleet(
        self, settings: Settings, state: Path, say: Callable[[str], None], by: str
    ) -> FleetUp:
        """The fleet, nothing of it started. Where somebody said which router, it listens there.

        Raises:
            BadArgument: another run lies in the folder; and what `read` raises.
        """
        mission, specs = self.read()
        names = [spec.robot for spec in specs]
        if mission is None:
            folder = self.folder or state
            claim_folder(folder)
        elif self.folder is None:
            folder = new_run_folder(mission.mission)
            claim_run_folder(folder)
        else:
            folder = self.folder
            claim_run_folder(folder)
        world = None
        if mission is not None:
            world = World(str(self.mission), mission, self.backend, self.speed)
        in_mission = () if mission is None else tuple(each.spec for each in mission.robots)
        given = in_mission or specs
        processes, certificates = self._processes(settings, folder)
        if certificates is not None:
            certificates.admit(spec.robot for spec in given)

        def compose(known: tuple[RobotSpec, ...]) -> Composition:
            others = () if mission else tuple(spec for spec in known if spec.robot not in names)
            return Composition(
                robots=(*given, *others),
                recording=folder / RECORDING if self.record else None,
                data=None if mission is None else folder / DATA,
                # Of one realm: the router of `up` in another one has a store of its own.
                store=None if mission else data_folder(None, ROUTER, settings.realm),
                world=world,
                rolls=ROLLS,
                embodiment=self.embodiment,
                registered=mission is None,
                apart=self.secure,
            )

        admit = None if certificates is None else certificates.admit
        by = by if certificates is None else certificates.user
        return FleetUp(processes, state, mission, compose, say, by, admit)

    def _processes(
        self, settings: Settings, folder: Path
    ) -> tuple[ChildProcesses, FleetCertificates | None]:
        if not self.secure:
            endpoint = settings.routers[0] if settings.said else free_endpoint()
            return ChildProcesses(endpoint, settings.realm, folder, settings.zenoh_config), None
        if settings.zenoh_config is not None:
            raise BadArgument(
                "--secure makes Zenoh configurations of its own: leave it out where "
                f"{settings.zenoh_config} says how to connect"
            )
        endpoint = settings.routers[0] if settings.said else free_endpoint("tls")
        if not endpoint.startswith("tls/"):
            raise BadArgument(f"--secure is over TLS: the router's endpoint is not {endpoint}")
        from cli.certificates.fleet_certificates import FleetCertificates

        made = FleetCertificates(
            data_folder(None, "certs", settings.realm), settings.realm, getpass.getuser()
        )
        processes = ChildProcesses(endpoint, settings.realm, folder, made.operator, made.processes)
        return processes, made
