"""Hosts on this machine: network namespaces on one switch, whose cables can be pulled out.

They need the right to make namespaces (root, on most machines). Where that is missing, `why_not`
says so, for tests to be skipped with.
"""

from __future__ import annotations

import functools
import itertools
import os
import subprocess
import sys
import uuid
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from tests.support.child_process import blocking_child
from tests.support.polling import DEADLINE_S

_NETWORK = "10.213.7."


def _ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True, timeout=DEADLINE_S)


@functools.cache
def why_not() -> str | None:
    """Why no hosts can be made here; `None`: they can."""
    name = f"rf-{uuid.uuid4().hex[:8]}"
    try:
        _ip("netns", "add", name)
    except FileNotFoundError:
        return "there is no `ip` (Debian: iproute2)"
    except subprocess.CalledProcessError as error:
        return f"network namespaces cannot be made: {error.stderr.decode().strip()}"
    try:
        _ip("-n", name, "link", "add", "name", "one", "type", "veth", "peer", "name", "two")
    except subprocess.CalledProcessError as error:
        return f"no cables can be made: {error.stderr.decode().strip()}"
    finally:
        _ip("netns", "del", name)
    return None


@dataclass
class Host:
    """One host: its `address`, and what is started on it with `folder` for a home."""

    name: str
    address: str
    namespace: str
    switch: str
    port: str
    folder: Path
    stack: ExitStack
    configuration: Path | None = None
    """The Zenoh configuration that its processes are given."""
    logs: dict[str, Path] = field(default_factory=dict)

    def robotctl(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run a command to its end."""
        return subprocess.run(
            self._command(arguments),
            capture_output=True,
            text=True,
            env=self._environment(),
            cwd=self.folder,
            timeout=DEADLINE_S,
        )

    def start(self, *arguments: str, ready: str) -> subprocess.Popen[str]:
        """Start a command that stays; returns when it has printed a line that begins with `ready`.

        It is killed with the hosts.
        """
        log = self.folder / f"{'-'.join(arguments[:2])}.log"
        self.logs[" ".join(arguments)] = log
        errors: IO[str] = self.stack.enter_context(log.open("w"))
        process = self.stack.enter_context(
            blocking_child(
                *self._command(arguments), env=self._environment(), cwd=self.folder, stderr=errors
            )
        )
        assert process.stdout is not None
        for line in process.stdout:
            if line.startswith(ready):
                return process
        raise AssertionError(f"{arguments} on {self.name} has ended: {log.read_text()}")

    def cut(self) -> None:
        """Pull out its cable: packets are lost, and nobody is told."""
        _ip("-n", self.switch, "link", "set", self.port, "down")

    def mend(self) -> None:
        """Put its cable back."""
        _ip("-n", self.switch, "link", "set", self.port, "up")

    def _command(self, arguments: Sequence[str]) -> list[str]:
        inside = ("ip", "netns", "exec", self.namespace)
        return [*inside, sys.executable, "-P", "-m", "cli.main", *arguments]

    def _environment(self) -> dict[str, str]:
        kept = {name: v for name, v in os.environ.items() if not name.startswith("ROBOTFLEET_")}
        given = (
            {}
            if self.configuration is None
            else {"ROBOTFLEET_ZENOH_CONFIG": str(self.configuration)}
        )
        return {**kept, **given, "HOME": str(self.folder), "PYTHONUNBUFFERED": "1"}


@contextmanager
def hosts(folder: Path, *names: str) -> Iterator[tuple[Host, ...]]:
    """So many hosts, connected with each other and with nothing else."""
    tag = uuid.uuid4().hex[:6]
    with ExitStack() as stack:

        def namespace(name: str) -> str:
            made = f"rf-{tag}-{name}"
            _ip("netns", "add", made)
            stack.callback(_ip, "netns", "del", made)
            _ip("-n", made, "link", "set", "lo", "up")
            return made

        switch = namespace("switch")
        _ip("-n", switch, "link", "add", "name", "br0", "type", "bridge")
        _ip("-n", switch, "link", "set", "br0", "up")
        made: list[Host] = []
        for number, name in zip(itertools.count(1), names, strict=False):
            inside, port = namespace(name), f"p{number}"
            _ip("-n", inside, "link", "add", "name", "eth0", "type", "veth", "peer", "name", port)
            _ip("-n", inside, "link", "set", port, "netns", switch)
            _ip("-n", switch, "link", "set", port, "master", "br0", "up")
            _ip("-n", inside, "address", "add", f"{_NETWORK}{number}/24", "dev", "eth0")
            _ip("-n", inside, "link", "set", "eth0", "up")
            home = folder / name
            home.mkdir()
            made.append(Host(name, f"{_NETWORK}{number}", inside, switch, port, home, stack))
        yield tuple(made)
