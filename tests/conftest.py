"""Fixtures for everybody: a real router with its store, in a process of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from fleet.llm.client import ModelClient
from fleet.service.router_process import with_port
from keyexpr_schema.transport.session import SessionConfig

# No timing decides a test. A merge is judged by the same examples each time; people draw new ones,
# and what those find becomes a test of its own.
settings.register_profile("people", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "people")

# The tests start hundreds of processes. Where the environment forbids to keep what was compiled,
# each would compile our source again: a third of the time that a planner takes to start.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


class RouterProcess:
    """A router on a free port; `kill` is `kill -9`, `restart` keeps port and data."""

    def __init__(self, data_dir: Path) -> None:
        self.data_dir = data_dir
        self.endpoint = with_port("tcp/127.0.0.1:0")
        self._process: subprocess.Popen[str] | None = None
        self.start()

    def start(self) -> None:
        """Start, and return once it listens."""
        process = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "fleet.service.router_process",
                self.endpoint,
                str(self.data_dir),
            ],
            stdout=subprocess.PIPE,
            text=True,
        )
        self._process = process
        assert process.stdout is not None
        line = process.stdout.readline()
        if line.strip() != f"router listening on {self.endpoint}":
            self._end(signal.SIGKILL)
            raise RuntimeError(f"the router did not start: {line!r}")

    @property
    def pid(self) -> int:
        assert self._process is not None
        return self._process.pid

    def kill(self) -> None:
        """End it without a chance to tidy up."""
        self._end(signal.SIGKILL)

    def stop(self) -> int | None:
        """Ask it to end; its exit status."""
        return self._end(signal.SIGTERM)

    def restart(self) -> None:
        """Start it again on the same port and data, ending it first if it still runs."""
        self.kill()
        self.start()

    def freeze(self) -> None:
        """Stop it from running, as a lost network would."""
        os.kill(self.pid, signal.SIGSTOP)

    def thaw(self) -> None:
        """Let a frozen one go on."""
        os.kill(self.pid, signal.SIGCONT)

    def _end(self, number: signal.Signals) -> int | None:
        process, self._process = self._process, None
        if process is None:
            return None
        process.send_signal(number)
        try:
            return process.wait(10)
        finally:
            process.kill()
            process.wait()
            assert process.stdout is not None
            process.stdout.close()


@pytest.fixture
def router(tmp_path: Path) -> Iterator[RouterProcess]:
    """A real router and store on a free port of the loopback, in a process of its own."""
    process = RouterProcess(tmp_path / "router")
    try:
        yield process
    finally:
        process.kill()


@pytest.fixture(scope="session")
def model_client() -> Iterator[ModelClient]:
    """The processes that ask language models: one set for all tests, as LiteLLM starts slowly."""
    client = ModelClient()
    yield client
    client.close()


@pytest.fixture
def session_config(router: RouterProcess) -> Callable[..., SessionConfig]:
    """Makes a `SessionConfig` for the fixture `router`: `session_config(component="me")`."""

    def make(**fields: object) -> SessionConfig:
        return SessionConfig(endpoints=(router.endpoint,), **fields)  # type: ignore[arg-type]

    return make
