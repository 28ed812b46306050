"""`Launch`: a robot's worker as a container, whatever runs it; a function of file and settings.

What is run comes from the file of whoever deploys, never from a key: else who can write keys could
have any program run by whoever types `deploy`.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import PurePosixPath

from cli.errors import BadArgument
from sim.files.deployment_schema import ROBOT, DeploymentEntry

DATA = "/data"
"""Where the image keeps what must last: the journal of the robot's orders."""
CONFIG = "/etc/robotfleet"
"""Where the folder with the Zenoh configuration and its certificates is mounted."""
_LOOPBACK = re.compile(r"[a-z]+/(localhost|127\.[0-9.]+|\[::1\])(:|$)")
LONGEST = 38
"""A cluster writes the name into labels, with ten letters more, and takes 63."""


@dataclass(frozen=True)
class Launch:
    """What is run, and as what: `name` is the container's, and that of its volume.

    `certificates` is a folder on the host where it runs, mounted at `CONFIG`.
    """

    robot: str
    name: str
    image: str
    arguments: tuple[str, ...]
    environment: dict[str, str] = field(default_factory=dict)
    devices: tuple[str, ...] = ()
    certificates: str | None = None

    @property
    def health(self) -> tuple[str, ...]:
        """How it is asked, inside, whether it is well."""
        return "robotctl", "health", "worker", self.robot

    @property
    def routers(self) -> tuple[str, ...]:
        """Where it looks for a router; none: where its Zenoh configuration says."""
        return tuple(self.environment.get("ROBOTFLEET_ROUTER", "").replace(",", " ").split())

    def check_reaches(self, where: str) -> None:
        """That a worker `where` looks for its router elsewhere than on its own loopback.

        Raises:
            BadArgument: it does not.
        """
        for endpoint in self.routers:
            if _LOOPBACK.match(endpoint):
                raise BadArgument(
                    f"the router {endpoint} is the loopback of this machine, which a worker "
                    f"{where} cannot reach: name the router as it is reached from there, with "
                    "--router or with ROBOTFLEET_ROUTER under deployment.environment"
                )


def launch(
    robot: str, entry: DeploymentEntry, routers: Iterable[str], realm: str, *, said: bool
) -> Launch:
    """How a robot's worker is run. `routers` are those of the command, which somebody has `said` or
    not; those of the file's environment, and of its Zenoh configuration, go before."""
    environment = {"ROBOTFLEET_REALM": realm}
    certificates = None
    if entry.zenoh_config is not None:
        path = PurePosixPath(entry.zenoh_config)
        certificates = str(path.parent)
        environment["ROBOTFLEET_ZENOH_CONFIG"] = f"{CONFIG}/{path.name}"
    if said or entry.zenoh_config is None:
        environment["ROBOTFLEET_ROUTER"] = ",".join(routers)
    return Launch(
        robot=robot,
        name=container_name(robot, realm),
        image=entry.image,
        arguments=tuple(word.replace(ROBOT, robot) for word in entry.command),
        environment=environment | entry.environment,
        devices=entry.devices,
        certificates=certificates,
    )


def container_name(robot: str, realm: str) -> str:
    """What a robot's container is called, on every engine; two robots never share a name."""
    own = f"{realm}-{robot}"
    plain = re.sub(r"[^a-z0-9]+", "-", own.lower()).strip("-")[:LONGEST].rstrip("-")
    # `a-b` in realm `c` is not `b` in realm `c-a`.
    if plain != own or "-" in robot:
        plain += f"-{hashlib.sha256(f'{realm}/{robot}'.encode()).hexdigest()[:6]}"
    return f"{plain}-worker"
