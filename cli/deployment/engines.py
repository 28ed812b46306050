"""Which commands run, end and show a container: podman and docker, here or on a host over ssh."""

from __future__ import annotations

import shlex
from dataclasses import dataclass

from cli.deployment.kubernetes import manifest
from cli.deployment.launch import CONFIG, DATA, Launch
from keyexpr_schema.payloads.deployments import Engine

STOP_S = 20
"""How long a worker has to bring its robot to rest [s]; then it is killed."""
CONNECT_S = 10
"""How long ssh tries to connect [s]."""
_WORKLOAD = "statefulset"


@dataclass(frozen=True)
class Step:
    """One command, and what it reads from its standard input."""

    argv: tuple[str, ...]
    stdin: str | None = None

    def __str__(self) -> str:
        """As a shell takes it."""
        typed = shlex.join(self.argv)
        return typed if self.stdin is None else f"{typed} <<'END'\n{self.stdin}END"


@dataclass(frozen=True)
class Target:
    """An engine on this machine (no `host`) or on a host over ssh; a cluster, or a node of it."""

    engine: Engine
    host: str | None = None

    @property
    def in_a_cluster(self) -> bool:
        """Whether a cluster runs it."""
        return self.engine is Engine.KUBERNETES

    @property
    def over_ssh(self) -> bool:
        """Whether its commands are typed on another host."""
        return self.host is not None and not self.in_a_cluster

    @property
    def where(self) -> str:
        """For sentences: `on lab-3`."""
        if self.in_a_cluster:
            return "in the cluster"
        return "on this machine" if self.host is None else f"on {self.host}"

    def start(self, launch: Launch) -> Step:
        """Run a container, and return when it has begun."""
        if self.in_a_cluster:
            return Step(("kubectl", "apply", "--filename", "-"), manifest(launch, self.host))
        devices = (word for device in launch.devices for word in ("--device", device))
        variables = (
            word
            for name, value in launch.environment.items()
            for word in ("--env", f"{name}={value}")
        )
        certificates = (
            ()
            if launch.certificates is None
            else ("--volume", f"{launch.certificates}:{CONFIG}:ro")
        )
        return self._step(
            *("run", "--detach", "--name", launch.name, "--restart", "unless-stopped"),
            # A router is named as on the host itself, and drivers find what is on its network.
            *("--network", "host"),
            *("--read-only", "--tmpfs", "/tmp"),
            *("--cap-drop", "ALL", "--security-opt", "no-new-privileges"),
            *("--volume", f"{launch.name}:{DATA}", *certificates),
            *devices,
            *variables,
            *("--health-cmd", shlex.join(launch.health), "--health-interval", "30s"),
            *("--health-timeout", "6s", "--health-start-period", "30s"),
            launch.image,
            *launch.arguments,
        )

    def has_image(self, image: str) -> Step:
        """Fails where an image is not there."""
        return self._step("image", "inspect", "--format", "{{.Id}}", image)

    def has_container(self, name: str) -> Step:
        """Fails where a container is not there."""
        if self.in_a_cluster:
            return self._step("get", _WORKLOAD, name, "--output", "name")
        return self._step("container", "inspect", "--format", "{{.Id}}", name)

    def end(self, name: str) -> tuple[Step, ...]:
        """Have the robot brought to rest, and take the container away; its volume stays."""
        if self.in_a_cluster:
            return (self._step("delete", _WORKLOAD, name, "--wait=true"),)
        return (self._step("stop", "--time", str(STOP_S), name), self._step("rm", name))

    def discard(self, name: str) -> Step:
        """Take a container away that has not begun."""
        return self._step("rm", "--force", name)

    def logs(self, name: str, lines: int, *, follow: bool) -> Step:
        """What it has printed."""
        tail = ("--tail", str(lines), *(("--follow",) if follow else ()))
        if self.in_a_cluster:
            return self._step("logs", f"{_WORKLOAD}/{name}", *tail)
        return self._step("logs", *tail, name)

    def _step(self, *arguments: str) -> Step:
        if self.in_a_cluster:
            return Step(("kubectl", *arguments))
        own = (self.engine.value, *arguments)
        if self.host is None:
            return Step(own)
        options = ("-o", "BatchMode=yes", "-o", f"ConnectTimeout={CONNECT_S}")
        # ssh hands its words to a shell over there, so they are quoted once more.
        return Step(("ssh", *options, "--", self.host, shlex.join(own)))
