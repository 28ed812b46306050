"""The two cups in containers, where Podman is: images, health checks, and workers by `deploy`.

The base image must be there, since tests pull nothing: ROBOTFLEET_BASE names another one than the
Containerfile does. ROBOTFLEET_PODMAN_BUILD are further words for `podman build`, such as volumes
with the configuration by which pip finds packages.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from uuid import uuid4

import pytest
import yaml

from cli.deployment.launch import container_name
from cli.processes.child_processes import free_endpoint
from keyexpr_schema.keyspace import SIM_TRUTH
from keyexpr_schema.payloads.simulation import TruthAddress
from keyexpr_schema.transport.session import SessionConfig, open_session
from tests.support.polling import until
from tests.support.robotctl import Robotctl

ROOT = Path(__file__).parents[2]
COMPOSE = yaml.safe_load((ROOT / "deploy" / "compose.yaml").read_text(encoding="utf-8"))
CONTAINERFILE = ROOT / "deploy" / "Containerfile"
ROLES = ("router", "planner", "recorder", "sim", "worker")
TAG = "test"


def podman(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["podman", *words], capture_output=True, text=True, cwd=ROOT)


def base() -> str:
    default = re.search(r"^ARG BASE=(\S+)$", CONTAINERFILE.read_text(), re.MULTILINE)
    assert default is not None
    return os.environ.get("ROBOTFLEET_BASE", default[1])


def why_not() -> str | None:
    if shutil.which("podman") is None:
        return "podman is not on the path: no image was built and nothing ran in containers"
    if podman("image", "exists", base()).returncode != 0:
        return f"the base image {base()} is not here: no image was built (`podman pull {base()}`)"
    return None


pytestmark = [
    pytest.mark.e2e,
    pytest.mark.slow,
    pytest.mark.timeout(1800),  # pip may have to fetch all there is
    pytest.mark.skipif((reason := why_not()) is not None, reason=reason or ""),
]


@dataclass
class Fleet:
    """What runs in containers of one realm, and robotctl beside them."""

    endpoint: str
    realm: str
    robotctl: Robotctl
    stack: ExitStack

    def name(self, role: str) -> str:
        return f"{self.realm}-{role}"

    def run(self, role: str, *command: str) -> None:
        """Run a service as compose.yaml has it, on a port of its own."""
        service = COMPOSE["services"][role]
        name = self.name(role)
        self.stack.callback(podman, "rm", "--force", "--volumes", name)
        done = podman(
            *("run", "--detach", "--name", name, "--network", "host"),
            *(("--read-only",) if service["read_only"] else ()),
            *(word for each in service["tmpfs"] for word in ("--tmpfs", each)),
            *(word for each in service["cap_drop"] for word in ("--cap-drop", each)),
            *(word for each in service["security_opt"] for word in ("--security-opt", each)),
            *("--env", f"ROBOTFLEET_ROUTER={self.endpoint}"),
            *("--env", f"ROBOTFLEET_REALM={self.realm}"),
            f"robotfleet-{role}:{TAG}",
            *(command or service["command"]),
        )
        assert done.returncode == 0, done.stderr

    async def well(self, name: str) -> None:
        """Wait until the container's own health check says so."""
        await until(
            lambda: podman("healthcheck", "run", name).returncode == 0,
            f"{name} to be well; {podman('logs', '--tail', '5', name)}",
        )

    def said(self, *words: str) -> str:
        done = self.robotctl(*words)
        assert done.code == 0, (words, done.out, done.err)
        return done.out


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Fleet]:
    for role in ROLES:
        built = podman(
            *("build", "--format", "docker", "--file", str(CONTAINERFILE), "--target", role),
            *("--tag", f"robotfleet-{role}:{TAG}", "--build-arg", f"BASE={base()}"),
            *shlex.split(os.environ.get("ROBOTFLEET_PODMAN_BUILD", "")),
            str(ROOT),
        )
        assert built.returncode == 0, built.stderr[-3000:]
    endpoint, realm = free_endpoint(), f"t{uuid4().hex[:8]}"
    robotctl = Robotctl(endpoint, tmp_path, realm)
    # Podman finds its own images by it.
    robotctl.env["HOME"] = os.environ["HOME"]
    with ExitStack() as stack:
        yield Fleet(endpoint, realm, robotctl, stack)


async def test_the_two_cups_are_brought_in_containers(fleet: Fleet, tmp_path: Path) -> None:
    fleet.run("router", "router", "--listen", fleet.endpoint)
    await fleet.well(fleet.name("router"))
    for role in ("planner", "recorder"):
        fleet.run(role)
    fleet.run("sim", "sim", "two-cups", "--speed", "max")
    for role in ("planner", "recorder", "sim"):
        await fleet.well(fleet.name(role))
    fleet.said("register", "hsr", "locobot")
    fleet.said("world", "load", "home")
    for robot in ("hsr", "locobot"):
        file = tmp_path / f"{robot}.yaml"
        spec = (ROOT / "configs" / "robots" / f"{robot}.yaml").read_text(encoding="utf-8")
        file.write_text(f"{spec}\ndeployment: {{image: 'robotfleet-worker:{TAG}'}}\n")
        worker = container_name(robot, fleet.realm)
        fleet.stack.callback(podman, "volume", "rm", "--force", worker)
        fleet.stack.callback(podman, "rm", "--force", worker)
        fleet.said("deploy", str(file))
        await fleet.well(worker)
    user = podman("exec", fleet.name("planner"), "id", "-u").stdout.strip()
    assert user == "10001"
    assert podman("exec", fleet.name("planner"), "touch", "/opt/x").returncode != 0

    fleet.said("world", "add", "Both cups are in the kitchen.")
    fleet.said("goal", "add", "Bring the first cup to the hallway.", "--id", "first")
    fleet.said("goal", "add", "Bring the second cup to the living room.", "--id", "second")
    fleet.said("plan", "create", "big-dag", "makespan")
    fleet.said("goal", "wait", "first", "second", "--timeout-s", "240")
    assert fleet.said("health").startswith("well: ")
    config = SessionConfig(endpoints=(fleet.endpoint,), realm=fleet.realm, component="test")
    async with open_session(config) as session:
        for cup, place in (("cup_1", "hallway"), ("cup_2", "living_room")):
            truth = await session.get(SIM_TRUTH, TruthAddress(cup))
            assert truth is not None
            assert truth.place == place

    assert "worker hsr ready" in fleet.said("logs", "hsr")
    for robot in ("hsr", "locobot"):
        fleet.said("undeploy", robot)
    assert not fleet.robotctl("health").out.startswith("well: ")
