"""What a robot's file says of the container in which its worker runs."""

from __future__ import annotations

import re
from collections.abc import Iterator

from keyexpr_schema.payloads.deployments import HOST_PATTERN
from sim.files.yaml_file import FileEntry

IMAGE = "robotfleet-worker"
ROBOT = "{robot}"
"""In a command: the robot's name, of which a file may have several."""
_IMAGE = re.compile(r"[a-z0-9][A-Za-z0-9._/:@-]{0,254}", re.ASCII)
_VARIABLE = re.compile(r"[A-Za-z_][A-Za-z0-9_]*", re.ASCII)
_DEVICE = re.compile(r"/dev/[A-Za-z0-9._/+-]+(:/[A-Za-z0-9._/+-]+)?(:[rwm]{1,3})?", re.ASCII)
_CONFIG = re.compile(r"/[^:,\0\n]+/[^:,/\0\n]+\.json5", re.ASCII)


class DeploymentEntry(FileEntry, frozen=True):
    """Where and how a worker is deployed; all of it may be left out.

    `host`: as ssh takes it (`ana@lab-3`), or a node of a cluster; else this machine. `command`:
    what the image is started with, in place of `worker {robot}`. `devices`: as in `docker run`.
    `zenoh_config`: a Zenoh configuration of the worker's own, on the host where it runs; its
    folder, with the certificates that it names, is mounted and not copied.
    """

    image: str = IMAGE
    host: str | None = None
    command: tuple[str, ...] = ("worker", ROBOT)
    environment: dict[str, str] = {}
    devices: tuple[str, ...] = ()
    zenoh_config: str | None = None

    def faults(self) -> Iterator[tuple[str, str]]:
        """The field, and a sentence, for each thing that could not be meant."""
        if not _IMAGE.fullmatch(self.image):
            yield "image", f"{self.image!r} is not the name of an image, as robotfleet-worker:1.2"
        if self.host is not None and not re.fullmatch(HOST_PATTERN, self.host):
            yield "host", f"{self.host!r} is not a host as ssh takes it, as ana@lab-3"
        if not self.command:
            yield "command", f"it is empty; leave it out for `worker {ROBOT}`"
        for name, value in self.environment.items():
            if not _VARIABLE.fullmatch(name):
                yield f"environment.{name}", f"{name!r} is not the name of a variable, as ROBOT_IP"
            if "\0" in value or "\n" in value:
                yield f"environment.{name}", "a value is one line"
        for number, device in enumerate(self.devices):
            if not _DEVICE.fullmatch(device):
                yield (
                    f"devices[{number}]",
                    f"{device!r} is not a device, as /dev/ttyUSB0 or /dev/video0:/dev/video0:rw",
                )
        if self.zenoh_config is not None and not _CONFIG.fullmatch(self.zenoh_config):
            yield (
                "zenoh_config",
                f"{self.zenoh_config!r} is not the whole path of a .json5 file on the host, "
                "as /etc/robotfleet/robot-hsr.json5",
            )
